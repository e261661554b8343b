"""Trajectory of a run: time, columns, steps, events, statistics and specification.

A contact of an FMU of this project has a friction force and a mode. Its name is that of its force.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import HarnessError, check_names, import_optional
from ..results.files import column_heading, write_csv, write_signals
from ..results.quantity import Quantity, format_number, step_size_quantities
from ..results.summary import STEPS_TABLE, Summary, SummaryTable, make_table, write_summary
from ..scenes.run_spec import RunSpec

if TYPE_CHECKING:
    import pandas
    import xarray

FILES = ("trajectory.csv", "steps.csv", "events.csv")
MAX_PANELS = 8  # of a plot without named outputs
MIN_SAMPLES = 8  # in a half cycle or a slip: a parabola through the top samples is then accurate to 1e-4
MODE_TEXT = re.compile(r"mode of (\w+): ")  # how the description of a mode begins; it names the force of the contact


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
    """

    t: np.ndarray
    modes: dict[str, np.ndarray]

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


@dataclass(frozen=True)
class Trajectory:
    """Result of one run, or signals over time that were read from a file.

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

    def __repr__(self) -> str:
        """Describe the run in one line; its arrays may be long."""
        span = f"{len(self.time)} points from {self.time[0]:g} to {self.time[-1]:g} s"
        return f"<{type(self).__name__} of {self.spec.model}: {', '.join(self.columns)}; {span}>"

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values (n,) of an output by its name."""
        check_names("column", [name], self.columns)
        return self.columns[name]

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

    def plot(self, *names: str) -> "np.ndarray":
        """Plot outputs over time, one panel each, and input signals; shade the times when the contact sticks.

        With several contacts, the panel of a friction force is shaded, and a further panel shows when each contact
        sticks.

        Parameters
        ----------
        *names : str
            The outputs to plot; by default the first that are numbers and all friction forces, eight in all.

        Returns
        -------
        numpy.ndarray
            The matplotlib axes (n,), one for each panel.
        """
        from .plot import plot

        check_names("column", names, self.columns)
        numeric = [name for name, column in self.columns.items() if column.dtype.kind != "U"]
        texts = [name for name in names if name not in numeric]
        if texts:
            raise HarnessError(f"{texts[0]} is a text, which has no curve: name other outputs")
        inputs = [] if names else [name for name in self.spec.inputs if name != "time" and name not in self.columns]
        return plot(self, names or choose_outputs(numeric, self.contacts, MAX_PANELS), inputs)

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
        candidates = (name, contact_of_mode(self.descriptions.get(name)))
        return next((contact for contact in candidates if contact in self.contacts), "")

    def save(self, folder: str | Path) -> None:
        """Write the trajectory, its events, its steps, its provenance and its summary into a result folder.

        `load_result` reads the folder, and `simulate` repeats the run from it.

        Parameters
        ----------
        folder : path
            A new folder, or one that holds a result of the same FMU.

        Raises
        ------
        HarnessError
            If the folder holds other files or the result of another FMU.
        """
        from ..results.folder import replace_folder
        from ..results.provenance import PYTHON_API, describe_sources, write_provenance

        fmu = self.spec.fmu
        with replace_folder(Path(folder), FILES, describe_sources(str(fmu))) as new_folder:
            self.write_tables(new_folder)
            write_provenance(
                new_folder,
                [fmu],
                self.effective_parameters,
                source=describe_sources(str(fmu)),
                command=PYTHON_API,
                run=self.spec,
            )
            write_summary(new_folder, summarize_run(self, Path(folder).name))

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
    return Summary("run", title, tables=tables, picture=f"{title}: plots of the run")


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


def contact_of_mode(description: str | None) -> str:
    """Return the friction force that the description of a mode names; empty if it names none."""
    named = MODE_TEXT.match(description or "")
    return named[1] if named else ""


def find_contacts(variables: Mapping[str, Any]) -> dict[str, str]:
    """Return the contacts of an FMU of this project: the mode, an output, by the name of the contact.

    A contact has the name of its friction force, or that of its mode if the description of the mode names no force.
    """
    modes = [
        variable for variable in variables.values() if (variable.causality, variable.type) == ("output", "Integer")
    ]
    named = {mode.name: contact_of_mode(mode.description) for mode in modes}
    return {force if force in variables else mode: mode for mode, force in named.items()}


def choose_outputs(outputs: Sequence[str], contacts: Collection[str], count: int) -> tuple[str, ...]:
    """Return the first outputs, at most `count`, with preference for friction forces."""
    forces = [name for name in outputs if name in contacts][:count]
    others = [name for name in outputs if name not in contacts][: count - len(forces)]
    return tuple(name for name in outputs if name in forces or name in others)
