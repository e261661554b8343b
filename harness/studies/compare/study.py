"""Comparison of two trajectories, from result folders, files, or runs of FMUs and scenes.

It measures the largest and root-mean-square difference of each variable, and of event times.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import isnan
from os.path import abspath
from pathlib import Path

import numpy as np

from ...analyses.slip import upward_crossings
from ...arguments import NONNEGATIVE, check_arguments
from ...errors import HarnessError, SceneError
from ...records.units import conversion_factor
from ...scenes.run_spec import RunOptions, RunSpec
from ...simulation.external.step_refinement import communication_step, declared_step
from ...simulation.fmu_archive import read_description, resolve_stop, resolve_time_span
from ...simulation.resolve import FMU_SUFFIXES, prefer_scene, resolve
from ...simulation.runner import DEFAULT_COMMUNICATION_STEPS, run
from ...simulation.session import ProgressCallback
from ...simulation.signals import Signals, column_of_role
from ...simulation.trajectory import Trajectory
from ...simulation.trajectory_files import read_signals
from .event_pairs import END, MAX_LISTED, START, EventPairs, match_events, stack_events
from .interpolation import SignalInterpolant, ValueBounds

FILE_SUFFIXES = (".csv", ".txt", ".mat", ".xlsx", ".ods", ".npz")
RUN_SUFFIXES = (*FMU_SUFFIXES, ".toml")  # sources that are run


def load_both(
    sources: Sequence[str | Signals],
    options: RunOptions,
    report: ProgressCallback,
    adjust: Callable[[list[RunSpec]], list[RunSpec]] = lambda runs: runs,
) -> tuple[Signals, Signals]:
    """Load the trajectories of two folders, files, FMUs or scenes; return given trajectories unchanged.

    Both sides share one time grid: FMUs and scenes are run with the communication step of the other side, if it has
    one, or else with the fixed internal step that one of them declares, and to the same stop time. `options` holds
    the other settings of FMUs, and `adjust` may change those of all runs.
    """
    recordings: list[Signals | None] = [
        source if isinstance(source, Signals) else read_recorded(source) for source in sources
    ]
    adjusted_runs = iter(
        adjust(
            [
                resolve(prefer_scene(str(source)), options)
                for item, source in zip(recordings, sources, strict=True)
                if not item
            ]
        )
    )
    runs = [None if item else next(adjusted_runs) for item in recordings]
    grids = [grid_spacing(item.time) for item in recordings if item] + [item.grid for item in runs if item]
    grids += [fixed_grid(item) for item in runs if item]
    grid = next(filter(None, grids), None)
    ends = [resolve_stop(item, read_description(item.fmu, item.lenient)) for item in runs if item]
    stops = {*ends, *(float(item.time[-1]) for item in recordings if item)}
    stop = options.stop if None in stops or len(stops) == 1 else min(filter(None, stops))
    sides = []
    for item, spec in zip(recordings, runs, strict=True):
        if spec:
            spec = replace(
                spec,
                grid=grid,
                equal_steps=DEFAULT_COMMUNICATION_STEPS,
                stop=stop if options.stop is None else options.stop,
            )
            item = run(spec, report)
        assert item
        sides.append(item)
    return sides[0], sides[1]


def display_names(sources: tuple[str, str]) -> list[str]:
    """Return short names of two sources; equal names are extended by folders or suffixes that differ."""
    paths = [Path(abspath(source)) if Path(source).exists() else Path("scene", source) for source in sources]
    stems = [path if path.is_dir() or path.parts[0] == "scene" else path.with_suffix("") for path in paths]
    has_same_stem = stems[0] == stems[1] and paths[0] != paths[1]
    first, second = (path.parts for path in (paths if has_same_stem else stems))
    n_parts = next(
        (k for k, ends in enumerate(zip(first[::-1], second[::-1], strict=False), 1) if ends[0] != ends[1]), 1
    )
    return ["/".join(parts[-n_parts:]) for parts in (first, second)]


def read_recorded(source: str) -> Signals | None:
    """Read the trajectory of a folder or file; None for sources that are run."""
    path = Path(source)
    if path.exists() and path.suffix not in RUN_SUFFIXES:
        return read_signals(path)
    if path.suffix in FILE_SUFFIXES:
        raise SceneError(f"{path} does not exist: give an existing file or result folder, an FMU, or a scene")
    return None


def grid_spacing(time: np.ndarray) -> float | None:
    """Return the communication step in s if most of the times (n,) are multiples of one, otherwise None."""
    h = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    multiples = (time - time[0]) / h if h > 0 else np.full(len(time), np.nan)
    is_multiple = np.abs(multiples - np.rint(multiples)) < 1e-6 * np.maximum(multiples, 1)
    return h if is_multiple.mean() > 0.5 else None


def fixed_grid(spec: RunSpec) -> float | None:
    """Return the communication step in s that the fixed internal step of an FMU prescribes, None if there is none."""
    description = read_description(spec.fmu, spec.lenient)
    if description.coSimulation is None or spec.exchange:
        return None
    start, stop = resolve_time_span(spec, description)
    fixed_step = declared_step(description)
    return communication_step(fixed_step, stop - start) if fixed_step else None


def common_span(first: Signals, second: Signals) -> tuple[float, float]:
    """Return the common time span in s; HarnessError if there is none."""
    begin, end = max(first.time[0], second.time[0]), min(first.time[-1], second.time[-1])
    if not end > begin:
        raise HarnessError(f"{first.name} and {second.name} have no time in common")
    return float(begin), float(end)


DRIVER = "x_driver"  # output: position of the driver that pulls a body at a constant speed
MIN_COMMON = 0.5  # fraction of common times from which no interpolation is needed
TIME_TOLERANCE = 1e-9  # times closer than this fraction of the time span are equal


@dataclass(frozen=True)
class Difference:
    """Difference of one variable.

    Attributes
    ----------
    name, unit : str
        Name and unit of the variable.
    largest : float
        Largest absolute difference, NaN if a value is not finite.
    at : float
        Time in s of the largest difference, or of the first value that is not finite.
    rms : float
        Root-mean-square difference.
    relative : float
        `largest` divided by `size`.
    size : float
        Largest absolute value of either side.
    left, right : numpy.ndarray
        Values (n,) of both sides at the times of comparison; for strings 0, or 1 if they differ.
    """

    name: str
    unit: str
    largest: float
    at: float
    rms: float
    relative: float
    size: float
    left: np.ndarray
    right: np.ndarray


@dataclass(frozen=True, repr=False)
class Comparison:
    """Comparison of two trajectories.

    Attributes
    ----------
    one, two : Trajectory or Signals
        The two sides: runs, or signals of files and of Python.
    time : numpy.ndarray
        Times (n,) in s of the comparison.
    interpolated : bool
        Whether one side is interpolated.
    differences : tuple of Difference
        Differences of the variables.
    left_out : tuple of str
        Remarks on variables that are skipped, converted or only on one side.
    pairs : EventPairs or None
        Matched changes of mode; None if a side has none.
    slips : EventPairs or None
        Without these, matched starts and ends of slips against a driver; None if a side has no driver.
    """

    one: Trajectory | Signals
    two: Trajectory | Signals
    time: np.ndarray
    interpolated: bool
    differences: tuple[Difference, ...]
    left_out: tuple[str, ...]
    pairs: EventPairs | None
    slips: EventPairs | None = None

    @property
    def worst(self) -> float:
        """Return the largest relative difference; NaN if any is NaN."""
        return float(np.max([variable.relative for variable in self.differences]))

    @check_arguments(rtol=NONNEGATIVE, atol=NONNEGATIVE)
    def violations(self, rtol: float, atol: float) -> list[str]:
        """Return messages on variables that differ by more than atol + rtol * size, and on unmatched events."""
        messages = [
            f"{variable.name} differs by {variable.largest:.3g}{f' {variable.unit}' if variable.unit else ''} "
            f"at t = {variable.at:.6g} s, more than {atol + rtol * variable.size:.3g}"
            for variable in self.differences
            if not isnan(variable.largest) and variable.largest > atol + rtol * variable.size
        ]
        nonfinite = [variable.name for variable in self.differences if isnan(variable.largest)]
        messages += [f"{name} has values that are not finite" for name in nonfinite]
        if self.pairs and isnan(self.pairs.shift):
            messages.append(f"their events do not match: {self.pairs.summary((self.one.name, self.two.name))}")
        return messages

    @property
    def events(self) -> str:
        """Return what differs in the events: changes of mode, slips, or sticks of one side; empty if none is known."""
        names = self.one.name, self.two.name
        if pairs := self.pairs or self.slips:
            return "; ".join(filter(None, (pairs.summary(names), pairs.describe_first_difference(names))))
        sides = ((self.one, self.two), (self.two, self.one))
        return next((describe_sticks(side, other) for side, other in sides if side.events and not other.events), "")


def compare(first: Signals, second: Signals) -> Comparison:
    """Compare the common variables over the common time span.

    Raises
    ------
    HarnessError
        If there are no common variables or times.
    """
    common_names = [name for name in first.columns if name in second.columns]
    if not common_names:
        contents = [f"{side.name} ({', '.join(side.columns)})" for side in (first, second)]
        raise HarnessError(f"{' and '.join(contents)} have no variable in common")
    begin, end = common_span(first, second)
    time, is_interpolated = choose_times(first, second, begin, end)
    pairs, jumps = pair_events(first, second, begin, end)
    motions, differences, left_out = tuple(make_interpolants(first, second)), [], []
    for name in common_names:
        unit, factor, remark = compare_units(first, second, name)
        left_out += [remark] if remark else []
        if unit is not None:
            left_bounds, right_bounds = (
                side.bounds_at(name, time, at) for side, at in zip(motions, jumps, strict=True)
            )
            left, right = closest_values(
                left_bounds, ValueBounds(factor * right_bounds.low, factor * right_bounds.high)
            )
            if is_string(first, name):
                left, right = np.zeros(len(time)), (left != right).astype(float)
            differences.append(measure_difference(name, unit, time, left, right))
    if not differences:
        raise HarnessError(f"nothing to compare: {'; '.join(left_out)}")
    for side, other in ((first, second), (second, first)):
        unmatched_names = [name for name in side.columns if name not in other.columns]
        left_out += [f"only in {side.name}: {', '.join(unmatched_names)}"] if unmatched_names else []
    slips = None if pairs else pair_slips(first, second, begin, end)
    return Comparison(first, second, time, is_interpolated, tuple(differences), tuple(left_out), pairs, slips)


def pair_slips(first: Signals, second: Signals, begin: float, end: float) -> EventPairs | None:
    """Match the starts and ends of slips between two times in s; None if a side has no moving driver or no speed.

    A slip lasts while the body is faster than its driver, which needs no modes.
    """
    events: list[np.ndarray] = []
    for side in (first, second):
        if not {DRIVER, side.motion_outputs.get("velocity", "")} <= {*side.columns}:
            return None
        position = side.columns[DRIVER]
        driver = float(position[-1] - position[0]) / float(side.time[-1] - side.time[0])
        if not driver:
            return None
        relative_speed = column_of_role(side, "velocity") * np.sign(driver) - abs(driver)
        starts, ends = (upward_crossings(side.time, sign * relative_speed) for sign in (1.0, -1.0))
        rows = [[t, state, 0.0] for times, state in ((starts, START), (ends, END)) for t in times if begin <= t <= end]
        events.append(np.array(sorted(rows)).reshape(-1, 3))
    left, right = events
    return match_events(left, right, has_slips=True)


def describe_sticks(side: Signals, other: Signals) -> str:
    """Return when the contacts of a side stick, where the law of the other one has no modes."""
    rests = [(name, *rest) for name, intervals in side.sticking.items() for rest in intervals]
    descriptions = [
        f"{f'{name} ' if len(side.sticking) > 1 else ''}from t = {begin:.6g} to {end:.6g} s"
        for name, begin, end in rests[:MAX_LISTED]
    ]
    remainder = [f"{len(rests) - MAX_LISTED} more"] * (len(rests) > MAX_LISTED)
    text = f"{side.name} sticks {', '.join(descriptions + remainder)}" if rests else f"{side.name} never sticks"
    return f"{text}; {other.name} has no modes"


def compare_units(first: Signals, second: Signals, name: str) -> tuple[str | None, float, str]:
    """Return the unit of comparison (None if impossible), the factor from the second unit to it, and a remark."""
    left, right = (side.units[name] for side in (first, second))
    if is_string(first, name) != is_string(second, name):
        text, number = (first, second) if is_string(first, name) else (second, first)
        return None, 1.0, f"{name} is a string in {text.name} and a number in {number.name}; skipped"
    if bool(left) != bool(right):
        without_unit = (second if left else first).name
        return left or right, 1.0, f"{name} has no unit in {without_unit}; assumed {left or right}"
    factor = conversion_factor(right, left)
    if factor is None:
        return None, 1.0, f"{name} is in {left} in {first.name} and in {right} in {second.name}; skipped"
    return left, factor, "" if factor == 1.0 else f"{name} is in {right} in {second.name}; compared in {left}"


def is_string(signals: Signals, name: str) -> bool:
    return signals.columns[name].dtype.kind == "U"


def is_discrete(signals: Signals, name: str) -> bool:
    """Return whether a variable is an Integer, a Boolean, an Enumeration or a String."""
    return signals.columns[name].dtype.kind in "biuU"


def make_interpolants(first: Signals, second: Signals) -> Iterator[SignalInterpolant]:
    """Yield interpolants of both trajectories, with strings replaced by numbers.

    A variable that is discrete on one side is held on both, because many files have no types. Whole numbers alone do
    not make a variable discrete: they may be a position in whole millimetres.
    """
    texts = [
        name for name in first.columns if name in second.columns and is_string(first, name) and is_string(second, name)
    ]
    values = {name: np.unique(np.concatenate([side.columns[name] for side in (first, second)])) for name in texts}
    discrete_names = {name for side in (first, second) for name in side.columns if is_discrete(side, name)}
    for side in (first, second):
        codes = {name: np.searchsorted(values[name], side.columns[name]).astype(float) for name in texts}
        yield SignalInterpolant(replace(side, columns=side.columns | codes), discrete_names)


def closest_values(left: ValueBounds, right: ValueBounds) -> tuple[np.ndarray, np.ndarray]:
    """Return the closest pair of values (n,) within the bounds of both sides."""
    left_values = np.clip(np.maximum(left.low, right.low), left.low, left.high)
    return left_values, np.clip(left_values, right.low, right.high)


def measure_difference(name: str, unit: str, time: np.ndarray, left: np.ndarray, right: np.ndarray) -> Difference:
    """Return the difference of one variable. Values are divided by the largest one to avoid overflow."""
    nonfinite = ~(np.isfinite(left) & np.isfinite(right))
    if nonfinite.any():
        at = float(time[int(np.argmax(nonfinite))])
        return Difference(name, unit, np.nan, at, np.nan, np.nan, np.nan, left, right)
    size = float(max(np.abs(left).max(), np.abs(right).max()))
    deviation = np.abs(left / size - right / size) if size else np.zeros(len(time))
    i, rms = int(np.argmax(deviation)), float(np.sqrt(np.mean(deviation * deviation)))
    relative = float(deviation[i])
    return Difference(name, unit, relative * size, float(time[i]), rms * size, relative, size, left, right)


def choose_times(first: Signals, second: Signals, begin: float, end: float) -> tuple[np.ndarray, bool]:
    """Return the times of comparison (n,) and whether one side is interpolated.

    These are the common times if there are enough of them, otherwise the times of the coarser side.
    """
    tolerance = TIME_TOLERANCE * (end - begin)
    grids = [np.unique(side.time[(side.time >= begin) & (side.time <= end)]) for side in (first, second)]
    coarser, finer = sorted(grids, key=len)
    at = np.clip(np.searchsorted(finer, coarser - tolerance), 0, len(finer) - 1)
    common = coarser[np.abs(finer[at] - coarser) <= tolerance]
    if len(common) >= MIN_COMMON * len(coarser):
        return common, False
    return coarser, True


def pair_events(
    first: Signals, second: Signals, begin: float, end: float
) -> tuple[EventPairs | None, tuple[np.ndarray, np.ndarray]]:
    """Match the events of both sides, and return the time intervals (k, 2) in s in which each side jumps.

    Such an interval extends between the two times of a matched event; an unmatched event is an interval of length zero.
    """
    mode_changes = [side.events for side in (first, second) if side.events is not None]
    names = list(dict.fromkeys(contact for changes in mode_changes for contact in changes.modes))
    contacts = names if any(len(changes.modes) > 1 for changes in mode_changes) else []
    first_events, second_events = (
        np.empty((0, 3)) if side.events is None else stack_events(side.events, contacts, begin, end)
        for side in (first, second)
    )
    if first.events is None or second.events is None:
        return None, (first_events[:, [0, 0]], second_events[:, [0, 0]])
    pairs = match_events(first_events, second_events, contacts)
    intervals = pairs.intervals[pairs.is_isolated(np.sort(np.concatenate([first_events[:, 0], second_events[:, 0]])))]
    unmatched_times = [rows[~np.isin(rows[:, 0], intervals)][:, [0, 0]] for rows in (first_events, second_events)]
    left, right = (np.vstack([intervals, rows]) for rows in unmatched_times)
    return pairs, (left, right)
