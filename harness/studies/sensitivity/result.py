"""Derivatives of a motion by parameters, with their files, their figure and what the command prints."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arguments import AXES, FLAG, TEXT, check_arguments
from ...errors import check_names, import_optional
from ...results.files import column_heading, write_csv, write_csv_rows
from ...results.provenance import describe_sources
from ...results.quantity import divide_units, format_number
from ...results.result import Result
from ...results.summary import ResultColumn, ResultTable
from ...scenes.run_spec import RunSpec

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
        contacts = [name for name, mode in self.after.items() if mode != self.before[name]]
        return ", ".join(f"{name} {self.before[name]} to {self.after[name]}" for name in contacts) or self.contact


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

    study, _function = "sensitivity", "sensitivity"

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
    def _headline(self) -> str:
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

    @property
    def _caption(self) -> str:
        return f"{self.title}: {self.outputs[0]} and its derivatives over time; sticking is shaded"

    def _tabulate(self) -> tuple[ResultTable, ...]:
        """Return the derivatives at the last time and the largest ones, and the events."""
        pairs = [measure_pair(self, output, name) for output in self.outputs for name in self.parameters]
        event = ResultColumn(
            "modes" if any(event.after for event in self.events) else "event", "{0.text}", is_text=True
        )
        columns = [ResultColumn("t [s]", "{0.t:.9g}"), event]
        for name in self.parameters:
            heading = f"by {name} [{divide_units('s', self.units[name])}]"
            columns.append(ResultColumn(heading, partial(format_derivative, name)))
        return ResultTable(pairs, COLUMNS), ResultTable(self.events, columns, EVENTS_TITLE)

    def sentences(self) -> list[str]:
        return [*self.remarks]

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

    def _origin(self) -> dict[str, Any]:
        fmu, source = self.spec.fmu, describe_sources(str(self.spec.fmu))
        parameters = {name: (value, self.units.get(name, "")) for name, value in self.settings.items()}
        return {"files": [fmu], "parameters": parameters, "source": source, "run": self.spec}

    def _write_tables(self, folder: Path) -> None:
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

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure, self.outputs[:1])

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_slope

        plot_slope(axes, self, self.outputs[0], next(iter(self.parameters)))
        axes.set_xlabel("t [s]")


def measure_pair(result: SensitivityResult, output: str, parameter: str) -> dict[str, Any]:
    """Return the derivative of an output by a parameter at the last time, its elasticity, and the largest one."""
    slope, relative = result[output, parameter], float(result.relative(output, parameter)[-1])
    k = int(np.argmax(np.where(np.isfinite(slope), np.abs(slope), -1.0)))
    return {
        "output": output,
        "by": parameter,
        "derivative": float(slope[-1]),
        "relative": relative,
        "largest": float(slope[k]),
        "at": float(result.t[k]),
        "unit": divide_units(result.units[output], result.units[parameter]),
    }


def format_field(name: str, pair: dict[str, Any]) -> str:
    """Return a number; "none" for one that does not exist."""
    text = format_number(pair[name])
    return "none" if text == "nan" else text


def format_derivative(parameter: str, event: SensitivityEvent) -> str:
    """Return the derivative of the time of an event by a parameter."""
    return format_number(event.derivatives[parameter])


COLUMNS = (
    ResultColumn("output", "{0[output]}", is_text=True),
    ResultColumn("by", "{0[by]}", is_text=True),
    ResultColumn("at the end", partial(format_field, "derivative")),
    ResultColumn("relative", partial(format_field, "relative")),
    ResultColumn("largest", partial(format_field, "largest")),
    ResultColumn("at t [s]", "{0[at]:.6g}"),
    ResultColumn("unit", "{0[unit]}", is_text=True),
)
