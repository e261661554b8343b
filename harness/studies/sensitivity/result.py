"""Derivatives of a motion by parameters, with their files, their figure and what the command prints."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arguments import AXES, FLAG, TEXT, check_arguments
from ...errors import check_names, import_optional
from ...results.files import column_heading, write_csv, write_csv_rows
from ...results.provenance import describe_sources
from ...results.quantity import divide_units, format_number
from ...results.result import Result
from ...results.summary import Summary, make_terminal_table, read_cells
from ...scenes.run_spec import RunSpec

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from rich.table import Table

EVENTS_TITLE = "Events, and the derivatives of their times"


@dataclass(frozen=True)
class SensitivityEvent:
    """An event.

    Attributes
    ----------
    t : float
        Time in s.
    contact : str
        Friction force of the contact, or the number of the condition or of the event indicator.
    before, after : dict
        Mode of each contact before and after the event; empty for FMUs that are not of this project.
    derivatives : dict
        Derivative of the time by each parameter.
    """

    t: float
    contact: str
    before: dict[str, int]
    after: dict[str, int]
    derivatives: dict[str, float]

    @property
    def text(self) -> str:
        """Return the contacts that change, with their modes before and after the event."""
        changed = [name for name, mode in self.after.items() if mode != self.before[name]]
        return ", ".join(f"{name} {self.before[name]} to {self.after[name]}" for name in changed) or self.contact


@dataclass(frozen=True, repr=False)
class SensitivityResult(Result):
    """Derivatives of the outputs of a run by parameters: ``s["x", "k"]`` is dx/dk over ``s.t``, ``s["x"]`` is x.

    Attributes
    ----------
    spec : RunSpec
        Settings of the run.
    t : numpy.ndarray
        Times (n,) in s.
    outputs : tuple of str
        Names of the outputs.
    parameters : dict
        Value of each parameter; that of an input with a signal is the factor 1 of the signal.
    units : dict
        Units of outputs and parameters.
    values : numpy.ndarray
        Outputs (n, outputs).
    left, right : numpy.ndarray
        Derivatives (n, parameters, outputs) for a decrease and for an increase of the parameter, NaN where they do not
        exist. Where they differ there is no derivative.
    events : tuple of SensitivityEvent
        Events, with the derivatives of their times.
    remarks : tuple of str
        Parameters without an effect, and times without derivatives.
    settings : dict
        Effective values of all parameters of the FMU.
    """

    study, function = "sensitivity", "sensitivity"

    spec: RunSpec
    t: np.ndarray
    outputs: tuple[str, ...]
    parameters: dict[str, float]
    units: dict[str, str]
    values: np.ndarray
    left: np.ndarray
    right: np.ndarray
    events: tuple[SensitivityEvent, ...]
    remarks: tuple[str, ...]
    settings: dict[str, Any]

    @property
    def title(self) -> str:
        return self.spec.model

    @property
    def headline(self) -> str:
        return f"{', '.join(self.outputs)} by {', '.join(self.parameters)}; {len(self.events)} events"

    def __getitem__(self, name: Any) -> Any:
        """Return an output (n,), its derivative (n,), as in ``s["x", "k"]``, or a part of the JSON.

        The derivative is NaN where it does not exist.
        """
        if isinstance(name, tuple) and len(name) == 2:
            left, right = self.one_sided(*name)
            return np.where(left == right, left, np.nan)
        if isinstance(name, str) and name in self.outputs:
            return self.values[:, self.outputs.index(name)]
        return super().__getitem__(name)

    @check_arguments(output=TEXT, parameter=TEXT)
    def one_sided(self, output: str, parameter: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives (n,) of an output for a decrease and for an increase of a parameter."""
        check_names("output", [output], self.outputs)
        check_names("parameter", [parameter], self.parameters)
        i, j = list(self.parameters).index(parameter), self.outputs.index(output)
        return self.left[:, i, j], self.right[:, i, j]

    @check_arguments(output=TEXT, parameter=TEXT)
    def relative(self, output: str, parameter: str) -> np.ndarray:
        """Return the elasticity (n,), the relative change of an output by that of a parameter; NaN where x is zero."""
        slope, value = self[output, parameter], self[output]
        return np.divide(self.parameters[parameter] * slope, value, out=np.full(len(value), np.nan), where=value != 0)

    @check_arguments(relative=FLAG)
    def to_pandas(self, relative: bool = False) -> "pandas.DataFrame":
        """Convert to a DataFrame with the time in s as its index, and a column ``(output, parameter)`` for each pair.

        Parameters
        ----------
        relative : bool
            Whether the columns are elasticities.

        Raises
        ------
        HarnessError
            If pandas is not installed.
        """
        library = import_optional("pandas", "to_pandas()", "sweep")
        pairs = [(output, parameter) for output in self.outputs for parameter in self.parameters]
        columns = {pair: self.relative(*pair) if relative else self[pair] for pair in pairs}
        frame: pandas.DataFrame = library.DataFrame(columns, index=library.Index(self.t, name="time"))
        return frame

    def rows(self) -> tuple[list[Mapping[str, Any]], str]:
        names = [(output, parameter) for output in self.outputs for parameter in self.parameters]
        return [{"output": pair[0], "parameter": pair[1], "derivative": self[pair][-1]} for pair in names], "output"

    def table(self) -> "Table":
        """Return the table of the derivatives at the last time and of the largest ones."""
        table = make_terminal_table()
        table.add_column("output", no_wrap=True)
        table.add_column("by", no_wrap=True)
        for heading in ("at the end", "relative", "largest", "at t [s]"):
            table.add_column(heading, justify="right")
        table.add_column("unit", no_wrap=True)
        for output in self.outputs:
            for parameter in self.parameters:
                slope, relative = self[output, parameter], float(self.relative(output, parameter)[-1])
                size = np.where(np.isfinite(slope), np.abs(slope), -1.0)
                k = int(np.argmax(size))
                cells = [format_number(value) for value in (float(slope[-1]), relative, float(slope[k]))]
                cells = ["none" if cell == "nan" else cell for cell in cells]
                unit = divide_units(self.units[output], self.units[parameter])
                table.add_row(output, parameter, *cells, f"{self.t[k]:.6g}", unit)
        return table

    def event_table(self) -> "Table":
        """Return the table of the events."""
        table = make_terminal_table(EVENTS_TITLE)
        table.add_column("t [s]", justify="right")
        table.add_column("modes" if any(event.after for event in self.events) else "event")
        for name in self.parameters:
            table.add_column(f"by {name} [{divide_units('s', self.units[name])}]", justify="right")
        for event in self.events:
            table.add_row(f"{event.t:.9g}", event.text, *map(format_number, event.derivatives.values()))
        return table

    def summary(self) -> Summary:
        tables = (*read_cells(self.table()), *read_cells(self.event_table(), EVENTS_TITLE))
        picture = f"{self.title}: {self.outputs[0]} and its derivatives over time; sticking is shaded"
        return Summary("sensitivity", self.title, self.remarks, tables, picture)

    def blocks(self) -> list[Any]:
        return [self.table(), "", *([self.event_table(), ""] if self.events else []), *self.remarks]

    def as_json(self) -> dict[str, Any]:
        pairs = {output: {name: self[output, name].tolist()[-1] for name in self.parameters} for output in self.outputs}
        return {
            "model": self.title,
            "stop": float(self.t[-1]),
            "parameters": self.parameters,
            "final": {output: float(self[output][-1]) for output in self.outputs},
            "derivatives": pairs,
            "events": [vars(event) for event in self.events],
            "remarks": list(self.remarks),
        }

    def origin(self) -> dict[str, Any]:
        fmu, source = self.spec.fmu, describe_sources(str(self.spec.fmu))
        parameters = {name: (value, self.units.get(name, "")) for name, value in self.settings.items()}
        return {"files": [fmu], "parameters": parameters, "source": source, "run": self.spec}

    def write_tables(self, folder: Path) -> None:
        headings, columns = ["t [s]"], [self.t]
        for output in self.outputs:
            headings.append(column_heading(output, self.units[output]))
            columns.append(self[output])
            for name in self.parameters:
                headings.append(
                    column_heading(f"d {output} / d {name}", divide_units(self.units[output], self.units[name]))
                )
                columns.append(self[output, name])
        write_csv(folder / "sensitivity.csv", headings, columns)
        headings = [
            "t [s]",
            "event",
            *(f"dt / d {name} [{divide_units('s', self.units[name])}]" for name in self.parameters),
        ]
        rows = [(event.t, event.text, *event.derivatives.values()) for event in self.events]
        write_csv_rows(folder / "events.csv", headings, rows)

    @check_arguments(ax=AXES)
    def plot(self, *names: str, ax: "Axes | None" = None) -> "np.ndarray":
        """Plot outputs and their derivatives over time; sticking is shaded.

        Parameters
        ----------
        *names : str
            Outputs; by default the first.
        ax : matplotlib.axes.Axes, optional
            Axes for the derivative of the first output by the first parameter alone.

        Returns
        -------
        numpy.ndarray
            The matplotlib axes (n,), one for each panel.
        """
        check_names("output", names, self.outputs)
        if not names or ax is not None:
            return super().plot(ax=ax)
        import matplotlib.pyplot as plt

        from ...results.style import DPI, use_style
        from .figure import draw

        with use_style():
            figure = plt.figure(dpi=DPI)
            draw(self, figure, names)
        return np.array(figure.axes)

    def draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure, self.outputs[:1])

    def draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_slope

        plot_slope(axes, self, self.outputs[0], next(iter(self.parameters)))
        axes.set_xlabel("t [s]")
