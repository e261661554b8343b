"""Signals over time: of a run, of a file, or of Python.

A contact of an FMU of this project has a friction force and a mode. Its name is that of its force.
"""

from collections.abc import ItemsView, Iterator, KeysView, Mapping, Sequence, ValuesView
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import AXES, FINITE, TEXT, check_arguments
from ..errors import HarnessError, check_names, import_optional
from ..scenes.roles import find_roles

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

MIN_SAMPLES = 8  # in a half cycle or a slip: a parabola through the top samples is then accurate to 1e-4


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
        check_names("contact", [contact], self.modes)
        modes = self.modes[contact]
        is_change = np.append(True, (np.diff(modes) != 0) | (len(self.modes) == 1))
        return self.t[is_change], modes[is_change]

    @check_arguments(stop=FINITE)
    def sticking(self, contact: str, stop: float) -> list[tuple[float, float]]:
        """Return the intervals of time in s in which a contact sticks, up to the stop."""
        times, modes = self.changes(contact)
        intervals = pairwise([*times.tolist(), stop])
        return [interval for interval, mode in zip(intervals, modes, strict=True) if mode == 0]


@dataclass(frozen=True, repr=False)
class Signals:
    """Signals over time.

    They are a mapping from names to values: ``signals["x"]``, ``"x" in signals``, ``dict(signals)``.

    Attributes
    ----------
    time : numpy.ndarray
        Time (n,) in s.
    columns : dict
        Values (n,) by name.
    units : dict
        Units of columns, and of the parameters of a run, by name.
    descriptions : dict
        Descriptions of columns by name.
    events : ModeChanges
        Changes of mode; None if they are not known.
    label : str
        Name for display.
    file : pathlib.Path or None
        File from which the signals were read.
    """

    time: np.ndarray
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    descriptions: dict[str, str] = field(default_factory=dict)
    events: ModeChanges | None = None
    label: str = ""
    file: Path | None = None

    @property
    def name(self) -> str:
        """Return the name for display."""
        return self.label

    @property
    def source(self) -> Path | None:
        """Return the file that the signals come from: a table, or the FMU of a run."""
        return self.file

    @property
    def _attributes(self) -> dict[str, Any]:
        """Return the attributes of the Dataset."""
        return {"name": self.name}

    @property
    def motion_outputs(self) -> dict[str, str]:
        """Return the column of each role: position, velocity, acceleration."""
        return find_roles([*self.columns])

    @property
    def _headline(self) -> str:
        span = f" from {self.time[0]:g} to {self.time[-1]:g} s" if len(self.time) else ""
        return f"{', '.join(self.columns) or 'no outputs'}; {len(self.time)} points{span}"

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {' '.join(self.name.split())}: {self._headline}>"

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values (n,) of an output by its name."""
        check_names("column", [name], self.columns)
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.columns

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
            of a run are attributes of the dataset.

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
        dataset: xarray.Dataset = library.Dataset(variables, {"time": time}, self._attributes)
        return dataset

    @check_arguments(x=TEXT, ax=AXES)
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

        from .plot import choose_plotted, draw_panels, list_inputs, plot_output

        check_names("column", (*names, *filter(None, [x])), self.columns)
        texts = [name for name in (*names, *filter(None, [x])) if self.columns[name].dtype.kind == "U"]
        if texts:
            raise HarnessError(f"{texts[0]} is a text, which has no curve: name other outputs")
        if ax is not None:
            if len(names) > 1:
                raise HarnessError(f"ax has room for one output, and {len(names)} are named: name one")
            if not (plotted_names := names or choose_plotted(self)):
                raise HarnessError(f"{self.name} has no output with a curve")
            plot_output(ax, self, plotted_names[0], x)
            return np.array([ax])
        figure = plt.figure()
        return draw_panels(figure, self, names or choose_plotted(self), [] if names or x else list_inputs(self), x)

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


def sample_at(signals: Signals, times: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Return the named outputs, (n, names), at the recorded times nearest to `times` (n,) in s."""
    nearest = np.abs(signals.time[:, None] - times).argmin(axis=0)
    return np.column_stack([signals.columns[name][nearest] for name in names])


def column_of_role(signals: Signals, role: str) -> np.ndarray:
    """Return the recorded position, velocity or acceleration (n,)."""
    return signals.columns[signals.motion_outputs[role]]


def check_sampling(time: np.ndarray, starts: np.ndarray, ends: np.ndarray, interval_name: str) -> None:
    """Raise HarnessError if an interval between `starts` and `ends` (n,), in s, has fewer than MIN_SAMPLES samples.

    Parameters
    ----------
    time : numpy.ndarray
        Times of the samples in s.
    interval_name : str
        Name of an interval in the message.
    """
    counts = np.searchsorted(time, ends, "right") - np.searchsorted(time, starts, "left")
    if len(counts) and counts.min() < MIN_SAMPLES:
        i = int(np.argmin(counts))
        # half of the necessary step: with few samples the bounds of an interval are uncertain
        step = 0.5 * float((ends - starts).min()) / MIN_SAMPLES
        raise HarnessError(
            f"each {interval_name} needs at least {MIN_SAMPLES} samples, and the one from t = {starts[i]:.6g} s to "
            f"{ends[i]:.6g} s has {counts[i]}: set grid to {step:.1g} s or less"
        )
