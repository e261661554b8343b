"""Trajectory of a run: its signals, internal steps, statistics and specification."""

from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import HarnessError
from ..results.files import column_heading, write_csv, write_signals
from ..results.provenance import describe_sources
from ..results.quantity import Quantity, format_number, step_size_quantities
from ..results.result import Result
from ..results.summary import PICTURE_FILE, STEPS_TABLE, Summary, SummaryTable, make_table, make_terminal_table
from ..scenes.run_spec import RunSpec
from .signals import Signals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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


@dataclass(frozen=True, repr=False, kw_only=True)
class Trajectory(Signals, Result):
    """Result of one run.

    It is a mapping from the names of the recorded outputs to their values: ``run["x"]``, ``"x" in run``, ``dict(run)``.

    Attributes
    ----------
    spec : RunSpec
        Effective settings of the run.
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
    parameters: dict[str, float | str] = field(default_factory=dict)
    steps: SolverSteps | None = None
    statistics: Statistics | None = None
    note: str = ""
    failure: str = ""

    @property
    def name(self) -> str:
        """Return the name for display."""
        return self.label or self.spec.model

    @property
    def source(self) -> Path:
        """Return the FMU."""
        return self.spec.fmu

    @property
    def attributes(self) -> dict[str, Any]:
        return {"model": self.spec.model, **self.parameters}

    @property
    def accuracy(self) -> str:
        """Return the estimated accuracy, or the settings of the solver of an FMU of this project."""
        return "; ".join(filter(None, [self.note, f"solver: {self.settings_label}" if self.settings_label else ""]))

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

    def draw(self, figure: "Figure") -> None:
        from .plot import choose_plotted, draw_panels, list_inputs

        if plotted := choose_plotted(self):
            draw_panels(figure, self, plotted, list_inputs(self))

    def draw_panel(self, axes: "Axes") -> None:
        self.plot(ax=axes)

    def summary(self) -> Summary:
        return summarize_run(self, self.name)

    def as_json(self) -> dict[str, Any]:
        spans = {name: dict(zip(SPAN, span_of(column), strict=True)) for name, column in self.columns.items()}
        stuck = {name: {"changes": changes, "stuck": duration} for name, changes, duration in list_rests(self)}
        return {
            "fmu": self.name,
            "note": self.accuracy,
            "failed": self.failure,
            "final": {name: span["end"] for name, span in spans.items()},
            "outputs": {name: {"unit": self.units[name]} | span for name, span in spans.items()},
            **({"contacts": stuck} if self.events else {}),
        }

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
            for name, changes, duration in list_rests(self)
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

    def write_tables(self, directory: Path) -> None:
        """Write trajectory.csv, and steps.csv and events.csv if there are steps and events."""
        write_signals(directory / "trajectory.csv", self.time, self.columns, self.units)
        if self.steps:
            columns = [self.steps.t[1:], self.steps.h, self.steps.rejected]
            write_csv(directory / "steps.csv", ["t [s]", "h [s]", "rejected"], columns)
        if self.events:
            columns = [self.events.t, *self.events.modes.values()]
            write_csv(directory / "events.csv", ["t [s]", *self.events.headings], columns)


def list_rests(run: Trajectory) -> list[tuple[str, int, float]]:
    """Return for each contact its name, its number of changes of mode, and the time in s for which it sticks."""
    if run.events is None:
        return []
    return [
        (name, len(run.events.changes(name)[0]) - 1, sum(end - begin for begin, end in rests))
        for name, rests in run.sticking.items()
    ]


def get_parameter(run: Trajectory, name: str, purpose: str) -> float:
    """Return a parameter's value; raise HarnessError if the model does not have it."""
    value = run.parameters.get(name)
    if not isinstance(value, float):
        raise HarnessError(f"{purpose} needs the parameter '{name}', which {run.spec.model} does not have: remove it")
    return value


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
