"""Trajectory of a run: time, columns, steps, events, statistics and specification.

A contact of an FMU of this project has a friction force and a mode. Its name is that of its force.
"""

from collections.abc import Collection, ItemsView, Iterator, KeysView, Mapping, Sequence, ValuesView
from dataclasses import dataclass, field
from itertools import pairwise
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import HarnessError, check_names, import_optional
from ..results.files import column_heading, write_csv, write_signals
from ..results.provenance import describe_sources
from ..results.quantity import Quantity, format_number, step_size_quantities
from ..results.result import Result
from ..results.summary import PICTURE_FILE, STEPS_TABLE, Summary, SummaryTable, make_table, make_terminal_table
from ..scenes.run_spec import RunSpec

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_PANELS = 8  # of a plot without named outputs
MIN_SAMPLES = 8  # in a half cycle or a slip: a parabola through the top samples is then accurate to 1e-4


@dataclass(frozen=True)
class SolverSteps:
    """Internal steps of the solver.

    Attributes
    ----------
    t : numpy.ndarray
        Start of the run and ends of the steps (n + 1,) in s.
    h : numpy.ndarray
        Step sizes (n,) in s.
    rejected : numpy.ndarray
        Number (n,) of rejected attempts before each step.
    """

    t: np.ndarray
    h: np.ndarray
    rejected: np.ndarray


@dataclass(frozen=True)
class ModeChanges:
    """Changes of mode. Each mode begins at its time; the first entry is the start.

    Attributes
    ----------
    t : numpy.ndarray
        Times (n,) in s.
    modes : dict
        Modes (n,) of each contact by the name of its friction force: -1, 0 while it sticks, or 1.
    mode_names : mapping
        Name of the output that is the mode of a contact, by that of its friction force, where it is known.
    """

    t: np.ndarray
    modes: dict[str, np.ndarray]
    mode_names: Mapping[str, str] = field(default_factory=dict)

    @property
    def mode(self) -> np.ndarray:
        """Return the modes (n,) of the only contact.

        Raises
        ------
        HarnessError
            If there are several contacts.
        """
        if len(self.modes) > 1:
            names = ", ".join(self.modes)
            raise HarnessError(
                f"there are {len(self.modes)} contacts ({names}): name one, as in events.modes['{names.split(',')[0]}']"
            )
        (mode,) = self.modes.values()
        return mode

    @property
    def headings(self) -> list[str]:
        """Return the headings of a table of the modes: the names of the contacts, or `mode` for a single contact."""
        return list(self.modes) if len(self.modes) > 1 else ["mode"]

    def changes(self, contact: str) -> tuple[np.ndarray, np.ndarray]:
        """Return times (m,) in s and modes (m,) of one contact, without the changes of the others."""
        modes = self.modes[contact]
        is_change = np.append(True, (np.diff(modes) != 0) | (len(self.modes) == 1))
        return self.t[is_change], modes[is_change]

    def sticking(self, contact: str, stop: float) -> list[tuple[float, float]]:
        """Return the intervals of time in s in which a contact sticks, up to the stop."""
        times, modes = self.changes(contact)
        intervals = pairwise([*times.tolist(), stop])
        return [interval for interval, mode in zip(intervals, modes, strict=True) if mode == 0]


@dataclass(frozen=True)
class Statistics:
    """Counts of a run.

    Attributes
    ----------
    steps, rejected : int
        Accepted and rejected steps of the solver.
    evaluations : int
        Evaluations of the right-hand side.
    seconds : float
        Run time in s of the fastest repetition.
    events : int
        Changes of mode.
    last_event : float
        Time of the last change of mode in s, or of the start without changes; NaN if the FMU does not expose it.
    """

    steps: int
    rejected: int
    evaluations: int
    seconds: float
    events: int = 0
    last_event: float = nan

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        return (
            Quantity("run_time", self.seconds, "s", "run time"),
            Quantity("evaluations", self.evaluations, "", "right-hand sides"),
        )


@dataclass(frozen=True, repr=False)
class Trajectory(Result):
    """Result of one run, or signals over time that were read from a file.

    It is a mapping from the names of the recorded outputs to their values: ``run["x"]``, ``"x" in run``, ``dict(run)``.

    Attributes
    ----------
    spec : RunSpec
        Effective settings of the run. For signals from a file, `fmu` is the path of that file.
    time : numpy.ndarray
        Time (n,) in s.
    columns : dict
        Recorded outputs (n,) by name.
    units : dict
        Units of columns and parameters by name.
    descriptions : dict
        Descriptions of columns by name.
    parameters : dict
        Effective values by name.
    steps, events, statistics : SolverSteps, ModeChanges, Statistics
        Internal steps, changes of mode, and counts; None if the FMU does not expose them.
    note : str
        Estimated accuracy.
    failure : str
        Reason why the run is incomplete; empty if it is complete.
    label : str
        Name for display; empty for that of the model.
    """

    study, function = "run", "simulate"

    spec: RunSpec
    time: np.ndarray
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    descriptions: dict[str, str]
    parameters: dict[str, float | str]
    steps: SolverSteps | None = None
    events: ModeChanges | None = None
    statistics: Statistics | None = None
    note: str = ""
    failure: str = ""
    label: str = ""

    @property
    def name(self) -> str:
        """Return the name for display."""
        return self.label or self.spec.model

    @property
    def accuracy(self) -> str:
        """Return the estimated accuracy, or the settings of the solver of an FMU of this project."""
        return self.note or (f"solver: {self.settings_label}" if self.settings_label else "")

    @property
    def settings_label(self) -> str:
        """Return method, friction law and tolerance for titles; empty for external FMUs."""
        words = [str(self.parameters[name]) for name in ("solver.method", "friction") if name in self.parameters]
        if "solver.rtol" in self.spec.values:
            words.append(f"rtol {self.spec.values['solver.rtol']:g}")
        return ", ".join(words)

    @property
    def effective_parameters(self) -> dict[str, tuple[object, str]]:
        """Return value and unit of every parameter, by name."""
        return {name: (value, self.units[name]) for name, value in self.parameters.items()}

    @property
    def title(self) -> str:
        return self.name

    @property
    def headline(self) -> str:
        span = f" from {self.time[0]:g} to {self.time[-1]:g} s" if len(self.time) else ""
        return f"{', '.join(self.columns) or 'no outputs'}; {len(self.time)} points{span}"

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values (n,) of an output by its name."""
        check_names("column", [name], self.columns)
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        """Return the number of outputs."""
        return len(self.columns)

    def __bool__(self) -> bool:
        return True  # also without outputs

    def keys(self) -> KeysView[str]:
        """Return the names of the outputs."""
        return self.columns.keys()

    def values(self) -> ValuesView[np.ndarray]:
        """Return the values (n,) of each output."""
        return self.columns.values()

    def items(self) -> ItemsView[str, np.ndarray]:
        """Return name and values (n,) of each output."""
        return self.columns.items()

    def to_pandas(self) -> "pandas.DataFrame":
        """Convert to a DataFrame with the time in s as its index.

        Returns
        -------
        pandas.DataFrame
            A column for each output; ``attrs["units"]`` holds the units by name.

        Raises
        ------
        HarnessError
            If pandas is not installed.
        """
        library = import_optional("pandas", "to_pandas()", "sweep")
        frame: pandas.DataFrame = library.DataFrame(self.columns, index=library.Index(self.time, name="time"))
        frame.attrs["units"] = {"time": "s"} | {name: self.units[name] for name in self.columns}
        return frame

    def to_xarray(self) -> "xarray.Dataset":
        """Convert to a Dataset over the dimension ``time``.

        Returns
        -------
        xarray.Dataset
            A variable for each output with the attributes ``units`` and ``long_name``; the effective parameters
            are attributes of the dataset.

        Raises
        ------
        HarnessError
            If xarray is not installed.
        """
        library = import_optional("xarray", "to_xarray()", "sweep")
        variables = {
            name: ("time", column, {"units": self.units[name] or "1", "long_name": self.descriptions.get(name, name)})
            for name, column in self.columns.items()
        }
        time = ("time", self.time, {"units": "s", "long_name": "time"})
        attributes = {"model": self.spec.model, **self.parameters}
        dataset: xarray.Dataset = library.Dataset(variables, {"time": time}, attributes)
        return dataset

    def plot(self, *names: str, x: str | None = None, ax: "Axes | None" = None) -> "np.ndarray":
        """Plot outputs over time, one panel each, and input signals; shade the times when the contact sticks.

        With several contacts, the panel of a friction force is shaded, and a further panel shows when each contact
        sticks.

        Parameters
        ----------
        *names : str
            The outputs to plot; by default the first that are numbers and all friction forces, eight in all.
        x : str, optional
            Output of the horizontal axis instead of time, as in ``run.plot("v", x="x")`` for a phase plane.
        ax : matplotlib.axes.Axes, optional
            Axes in which to plot a single output; by default the first.

        Returns
        -------
        numpy.ndarray
            The matplotlib axes (n,), one for each panel.
        """
        import matplotlib.pyplot as plt

        from .plot import draw_panels, plot_output

        check_names("column", (*names, *filter(None, [x])), self.columns)
        texts = [name for name in (*names, *filter(None, [x])) if self.columns[name].dtype.kind == "U"]
        if texts:
            raise HarnessError(f"{texts[0]} is a text, which has no curve: name other outputs")
        if ax is not None:
            if len(names) > 1:
                raise HarnessError(f"ax has room for one output, and {len(names)} are named: name one")
            plot_output(ax, self, (*names, *self.plotted)[0], x)
            return np.array([ax])
        figure = plt.figure()
        return draw_panels(figure, self, names or self.plotted, [] if names or x else self.plotted_inputs, x)

    @property
    def plotted(self) -> tuple[str, ...]:
        """The outputs that are plotted if none is named."""
        numeric = [name for name, column in self.columns.items() if column.dtype.kind != "U"]
        return choose_outputs(numeric, self.contacts, MAX_PANELS)

    @property
    def plotted_inputs(self) -> list[str]:
        """The input signals that are plotted."""
        return [name for name in self.spec.inputs if name != "time" and name not in self.columns]

    def draw(self, figure: "Figure") -> None:
        from .plot import draw_panels

        if self.plotted:
            draw_panels(figure, self, self.plotted, self.plotted_inputs)

    def draw_panel(self, axes: "Axes") -> None:
        self.plot(ax=axes)

    @property
    def contacts(self) -> tuple[str, ...]:
        """The names of the contacts; none where the modes are not known."""
        return tuple(self.events.modes) if self.events else ()

    @property
    def sticking(self) -> dict[str, list[tuple[float, float]]]:
        """The intervals of time in s in which each contact sticks, by its name."""
        if self.events is None:
            return {}
        return {contact: self.events.sticking(contact, float(self.time[-1])) for contact in self.contacts}

    def contact_of(self, name: str) -> str:
        """Return the contact whose sticking is shown in the panel of an output; empty if there is none.

        It is the only contact of the model, or the contact whose friction force or mode the output is.
        """
        if len(self.contacts) == 1:
            return self.contacts[0]
        mode_names = self.events.mode_names if self.events else {}
        return next((contact for contact in self.contacts if name in (contact, mode_names.get(contact))), "")

    def summary(self) -> Summary:
        return summarize_run(self, self.name)

    def as_json(self) -> dict[str, Any]:
        spans = {name: dict(zip(SPAN, span_of(column), strict=True)) for name, column in self.columns.items()}
        stuck = {name: {"changes": changes, "stuck": duration} for name, changes, duration in self.rests()}
        return {
            "fmu": self.name,
            "note": self.accuracy,
            "failed": self.failure,
            "final": {name: span["end"] for name, span in spans.items()},
            "outputs": {name: {"unit": self.units[name]} | span for name, span in spans.items()},
            **({"contacts": stuck} if self.events else {}),
        }

    def rests(self) -> list[tuple[str, int, float]]:
        """Return for each contact its name, its number of changes of mode, and the time in s for which it sticks."""
        if self.events is None:
            return []
        return [
            (name, len(self.events.changes(name)[0]) - 1, sum(end - begin for begin, end in rests))
            for name, rests in self.sticking.items()
        ]

    def blocks(self) -> list[Any]:
        table = make_terminal_table()
        table.add_column("output")
        for heading in SPAN:
            table.add_column(heading, justify="right")
        table.add_column("unit")
        for name, column in self.columns.items():
            cells = (value if isinstance(value, str) else f"{value:.6g}" for value in span_of(column))
            table.add_row(name, *cells, "" if self.units[name] == "1" else self.units[name])
        contacts = (
            f"{name}: {changes} change{'s' * (changes != 1)} of mode, sticks for {duration:.6g} s"
            for name, changes, duration in self.rests()
        )
        return [table, "", *contacts, *filter(None, [self.accuracy])]

    def origin(self) -> dict[str, Any]:
        fmu = self.spec.fmu
        parameters = self.effective_parameters
        return {"files": [fmu], "parameters": parameters, "source": describe_sources(str(fmu)), "run": self.spec}

    def write(self, folder: Path) -> None:
        """Write tables and figure; the tables hold all data."""
        self.write_tables(folder)
        self.write_figure(folder / PICTURE_FILE)

    @classmethod
    def is_stored(cls, folder: Path) -> bool:
        return (folder / "trajectory.csv").is_file()

    def sample_at(self, times: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Return the named outputs, (n, names), at the recorded times nearest to `times` (n,) in s."""
        nearest = np.abs(self.time[:, None] - times).argmin(axis=0)
        return np.column_stack([self.columns[name][nearest] for name in names])

    def find_changes(self, name: str) -> list[tuple[float, int]]:
        """Return every change of an integer output as (time in s, new value)."""
        values = self.columns[name]
        after = np.flatnonzero(np.diff(values)) + 1
        return list(zip(self.time[after].tolist(), values[after].tolist(), strict=True))

    def column_of_role(self, role: str) -> np.ndarray:
        """Return the recorded position, velocity or acceleration (n,)."""
        return self.columns[self.spec.motion_outputs[role]]

    def get_parameter(self, name: str, purpose: str) -> float:
        """Return a parameter's value; raise HarnessError if the model does not have it."""
        value = self.parameters.get(name)
        if not isinstance(value, float):
            raise HarnessError(
                f"{purpose} needs the parameter '{name}', which {self.spec.model} does not have: remove it"
            )
        return value

    def check_sampling(self, starts: np.ndarray, ends: np.ndarray, interval_name: str) -> None:
        """Raise HarnessError if an interval between `starts` and `ends` (n,), in s, has fewer than MIN_SAMPLES samples.

        `interval_name` is the name of an interval in the message.
        """
        counts = np.searchsorted(self.time, ends, "right") - np.searchsorted(self.time, starts, "left")
        if len(counts) and counts.min() < MIN_SAMPLES:
            i = int(np.argmin(counts))
            # half of the necessary step: with few samples the bounds of an interval are uncertain
            step = 0.5 * float((ends - starts).min()) / MIN_SAMPLES
            raise HarnessError(
                f"each {interval_name} needs at least {MIN_SAMPLES} samples, and the one from t = {starts[i]:.6g} s to "
                f"{ends[i]:.6g} s has {counts[i]}: set grid to {step:.1g} s or less"
            )

    def write_tables(self, directory: Path) -> None:
        """Write trajectory.csv, and steps.csv and events.csv if there are steps and events."""
        write_signals(directory / "trajectory.csv", self.time, self.columns, self.units)
        if self.steps:
            columns = [self.steps.t[1:], self.steps.h, self.steps.rejected]
            write_csv(directory / "steps.csv", ["t [s]", "h [s]", "rejected"], columns)
        if self.events:
            columns = [self.events.t, *self.events.modes.values()]
            write_csv(directory / "events.csv", ["t [s]", *self.events.headings], columns)


def summarize_run(run: Trajectory, title: str) -> Summary:
    """Return the summary of a run without analyses."""
    signals = {"t [s]": run.time} | {column_heading(name, run.units[name]): run.columns[name] for name in run.columns}
    rows = ((heading, *map(format_value, span_of(column))) for heading, column in signals.items())
    tables = make_table(("variable", *SPAN), rows) + summarize_steps(run, title)
    remarks = tuple(filter(None, [run.note]))
    return Summary("run", title, remarks, tables=tables, picture=f"{title}: plots of the run")


SPAN = ("start", "end", "smallest", "largest")  # what `span_of` returns


def span_of(column: np.ndarray) -> list[Any]:
    """Return the first, the last, the smallest and the largest value of a signal (n,); of texts the first and last."""
    ends = column[[0, -1]].tolist()
    return [
        *ends,
        *(["", ""] if column.dtype.kind == "U" else [np.fmin.reduce(column).item(), np.fmax.reduce(column).item()]),
    ]


def format_value(value: object) -> str:
    """Return a number with five digits, any other value as text."""
    return format_number(value) if isinstance(value, float) else str(value)


def summarize_steps(run: Trajectory, title: str) -> tuple[SummaryTable, ...]:
    """Return a table with one row, the statistics of the internal steps; nothing if there are none."""
    if run.steps is None or not len(run.steps.h):
        return ()
    quantities = step_size_quantities(run.steps.h, int(run.steps.rejected.sum()))
    row = (title, *(" ".join(quantity.format()).strip() for quantity in quantities))
    return make_table(("case", *(quantity.text for quantity in quantities)), (row,), STEPS_TABLE)


def choose_outputs(outputs: Sequence[str], contacts: Collection[str], count: int) -> tuple[str, ...]:
    """Return the first outputs, at most `count`, with preference for friction forces."""
    forces = [name for name in outputs if name in contacts][:count]
    others = [name for name in outputs if name not in contacts][: count - len(forces)]
    return tuple(name for name in outputs if name in forces or name in others)
