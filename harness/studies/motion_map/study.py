"""What motions end in at the points of a grid, and the edges between them along its lines, by bisection."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import pairwise
from threading import Lock
from typing import NamedTuple, Protocol

import numpy as np

from ...analyses.measured_runs import OUTPUT_MEASURES, SweepSpec, open_runner
from ...errors import HarnessError, SceneError, check_names
from ...process.interrupt import check_interrupt
from ...process.workers import open_workers
from ...scenes.fmu_files import check_built
from ...scenes.run_spec import RunSpec
from ...simulation.edges import find_edges
from ...simulation.fmu_archive import declared_parameters, exposes_solver_steps, read_description
from ...simulation.motion import SLIDING_ORBIT, STEADY, STICK_SLIP, count_text
from ...simulation.native_equivalent import native_equivalent, native_with_derivatives
from ...simulation.oscillator import Oscillator, SteadySliding, open_oscillator
from ...simulation.poincare import CYCLE, IRREGULAR, TURNING, NoOrbitError, ReturnMap
from ...simulation.saved_states import SavedStateMotion
from .result import Edge, MapResult

FAILED = "run failed"
BISTABLE, NEITHER = f"{STEADY} or {STICK_SLIP}", "neither"

BUSY = Lock()  # messages of FMUs are captured by one thread at a time


class Line(NamedTuple):
    """Labels (n,) of the points of a line, the edges between them, the number of runs, and messages of failed ones.

    `n_gaps` counts the edges after which another label follows than that of the next edge or of the end.
    """

    labels: list[str]
    edges: list[Edge]
    n_runs: int
    failures: list[str]
    n_gaps: int


class MapRequest(NamedTuple):
    """What a map shows of an FMU: names of its axes, and what its regions are.

    `period` in s, and `section`, are those of `Oscillator`. With a `measure` of a sweep the regions are its values, or
    the intervals between increasing `levels`.
    """

    spec: RunSpec
    names: tuple[str, ...]
    period: float | None = None
    section: str = ""
    measure: str = ""
    levels: tuple[float, ...] = ()


class Labels(Protocol):
    """Names of what motions do at points of the parameters."""

    @property
    def n_runs(self) -> int: ...

    def label(self, point: np.ndarray) -> str: ...


class MotionLabels:
    """What motions of an oscillator end in.

    Of one body that slides steadily, this is exact: by the eigenvalues of steady sliding, and by whether a motion that
    has stuck sticks again. Of any other model it is what the motions end in that begin at its start, and at the ends of
    motions at the nearest points on either side.
    """

    def __init__(self, oscillator: Oscillator) -> None:
        self.oscillator, self.map = oscillator, ReturnMap(oscillator)
        self.ends: dict[tuple[float, ...], dict[str, np.ndarray]] = {}  # states by name, at points in their order

    @property
    def n_runs(self) -> int:
        return self.oscillator.n_runs

    def label(self, point: np.ndarray) -> str:
        """Return what motions end in."""
        self.oscillator.set_point(point.tolist())
        steady = self.oscillator.find_steady_sliding()
        if steady is not None and self.oscillator.is_one_body:
            sticks = self.map.sticks_again(steady)
            return {(1, 0): STEADY, (0, 1): STICK_SLIP, (1, 1): BISTABLE, (0, 0): NEITHER}[steady.growth < 0.0, sticks]
        end_states = {} if steady is None or steady.growth >= 0.0 else {STEADY: steady.y}
        key = tuple(point.tolist())
        at = sorted([*self.ends, key]).index(key)
        neighbours = [self.ends[other] for other in sorted(self.ends.keys() - {key})[max(at - 1, 0) : at + 1]]
        starts = {name: y for ends in neighbours for name, y in ends.items()}
        for name, y in [("", self.oscillator.start), *starts.items()]:
            end, y = self.describe_end(y, steady) if name not in end_states else (IRREGULAR, y)
            if end != IRREGULAR or not name:  # it may also be on the way to another motion
                end_states.setdefault(end, y)
        self.ends[key] = {name: y for name, y in end_states.items() if name != IRREGULAR}
        return " or ".join(sorted(end_states))

    def describe_end(self, y: np.ndarray, steady: SteadySliding | None) -> tuple[str, np.ndarray]:
        """Return name and states of what the motion from states y ends in."""
        end = self.map.run_long(y)
        if end.kind == TURNING:
            try:
                if not self.map.approaches(steady, y, end):
                    return SLIDING_ORBIT, self.map.find_orbit(end).y
            except NoOrbitError:
                pass
            return STEADY if steady is not None and steady.growth < 0.0 else IRREGULAR, end.y
        return (count_text(end.n_sticks, "stick") if end.kind == CYCLE else end.kind), end.y


class ReturnLabels:
    """How often motions of any FMU return to a section in a period."""

    def __init__(self, motion: SavedStateMotion) -> None:
        self.motion = motion

    @property
    def n_runs(self) -> int:
        return self.motion.n_runs

    def label(self, point: np.ndarray) -> str:
        """Return the number of returns in a period."""
        count = self.motion.count_returns(point.tolist())
        return IRREGULAR if np.isnan(count) else count_text(int(count), "return") if count else "no return"


class MeasureLabels:
    """Values of a measure of a sweep: whole numbers, or the intervals between levels."""

    def __init__(self, request: MapRequest, resources: ExitStack) -> None:
        measure, levels = request.measure, request.levels
        family = measure.partition("_")[0]
        names = (family if family in OUTPUT_MEASURES else measure,)
        self.runner = resources.enter_context(
            open_runner(SweepSpec(replace(request.spec, follow=False), request.names, names))
        )
        columns = [column.name for column in self.runner.columns]
        check_names("measure", [measure], columns)
        self.measure, self.levels, self.column, self.n_runs = measure, levels, columns.index(measure), 0

    def label(self, point: np.ndarray) -> str:
        """Return the measure."""
        self.n_runs += 1
        row = self.runner.run(point.tolist())
        if isinstance(row, str):
            raise HarnessError(row)
        value = row[self.column]
        if np.isnan(value):
            return f"no {self.measure}"
        if not self.levels:
            if value % 1.0:
                raise SceneError(f"{self.measure} = {value:.6g} is not a whole number: give the levels between regions")
            return f"{self.measure} {value:.0f}"
        below = int(np.searchsorted(self.levels, value, side="right"))
        low = f"{self.levels[below - 1]:g} <= " if below > 0 else ""
        high = f" < {self.levels[below]:g}" if below < len(self.levels) else ""
        return f"{low}{self.measure}{high}"


@contextmanager
def open_labels(request: MapRequest) -> Iterator[Labels]:
    """Open what a request asks of its FMU."""
    with ExitStack() as resources:
        if request.measure:
            yield MeasureLabels(request, resources)
        elif exposes_solver_steps(read_description(request.spec.fmu, request.spec.lenient)):
            options = request.period, request.section
            yield MotionLabels(resources.enter_context(open_oscillator(request.spec, request.names, *options)))
        else:
            yield ReturnLabels(SavedStateMotion(request.spec, request.names, request.section, resources))


def search_points(labels: Labels, points: np.ndarray, axes: tuple[str, ...]) -> Line:
    """Label the points (n, axes) of a line, of which one coordinate varies, and bisect between different ones.

    Points at which a run fails are a region like any other.
    """
    failures = dict[tuple[float, ...], str]()

    def label(point: np.ndarray) -> str:
        try:
            return labels.label(point)
        except SceneError:  # of the settings, not of a point
            raise
        except HarnessError as error:
            place = ", ".join(f"{axis} = {value:.12g}" for axis, value in zip(axes, point, strict=True))
            failures[*point.tolist()] = f"{place}: {error}"
            return FAILED

    before, edges = labels.n_runs, list[Edge]()
    names = [label(point) for point in points]
    if isinstance(labels, MotionLabels) and labels.ends:  # motions that were found later may exist at earlier points
        names = [label(point) for point in points[::-1]][::-1] if len({*names}) > 1 else names
    is_final = False
    while not is_final:
        is_final, edges = True, []
        for number, (a, b) in enumerate(pairwise(points)):
            for low, high, *sides in find_edges(label, a, b, names[number], names[number + 1]):
                edges.append(Edge(tuple((0.5 * (low + high)).tolist()), *sides))
                for at, end in ((number, low), (number + 1, high)):
                    if (end == points[at]).all():  # motions that were followed up to this point
                        name, names[at] = names[at], label(end)
                        is_final &= names[at] == name
    below, above = [edge.below for edge in edges], [edge.above for edge in edges]
    n_gaps = sum(left != right for left, right in zip([names[0], *above], [*below, names[-1]], strict=True))
    return Line(names, edges, labels.n_runs - before, [*failures.values()], n_gaps)


def search_line(request: MapRequest, points: np.ndarray) -> Line:
    """Search a line in a worker."""
    with BUSY, open_labels(request) as labels:
        return search_points(labels, points, request.names)


def grid_lines(axes: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the lines of a grid along each of its axes, with their points (n, axes)."""
    if len(axes) == 1:
        return [axes[0][:, None]]
    x, y = axes
    rows = [np.column_stack([x, np.full(len(x), value)]) for value in y]
    columns = [np.column_stack([np.full(len(y), value), y]) for value in x]
    return rows + columns


def compute_map(
    request: MapRequest,
    grid: tuple[np.ndarray, ...],
    workers: int | None,
    report: Callable[[float], None] = lambda share: None,
) -> MapResult:
    """Find what motions do over one or two parameters.

    Parameters
    ----------
    request : MapRequest
        FMU, its parameters that vary, and what the regions are.
    grid : tuple of numpy.ndarray
        Increasing values (n,) of each parameter.
    workers : int or None
        Number of worker processes; None for this process.
    report : callable
        Receives the progress from 0 to 1.

    Raises
    ------
    SceneError
        If a name or a value is not valid.
    HarnessError
        If the FMU is not suitable, all runs fail, or a worker dies.
    """
    spec, names = request.spec, request.names
    check_built(spec.fmu, SceneError)
    fmu, lines = native_equivalent(spec.fmu), grid_lines(grid)
    if not request.measure and exposes_solver_steps(read_description(fmu, spec.lenient)):
        fmu = native_with_derivatives(fmu)
    run = request._replace(spec=replace(spec, fmu=fmu))
    with open_workers(workers, len(lines)) as pool:
        futures: dict[Future[Line], int] = {}
        results = dict[int, Line]()
        while len(results) < len(lines):
            check_interrupt()
            while len(futures) < 2 * pool.size and len(results) + len(futures) < len(lines):
                number = len(results) + len(futures)
                futures[pool.submit(search_line, run, lines[number])] = number
            for future in pool.wait_for_any(futures):
                try:
                    results[futures.pop(future)] = future.result()
                except pool.death_errors:
                    raise HarnessError(f"{spec.fmu.name}: a worker process died") from None
                report(len(results) / len(lines))
    labelled_lines = [results[number] for number in range(len(lines))]
    # those along the first parameter have all points
    first_lines = labelled_lines[: len(grid[-1]) if len(grid) > 1 else 1]
    labels = tuple(label for line in first_lines for label in line.labels)
    edges = tuple(edge for line in labelled_lines for edge in line.edges)
    parameters = declared_parameters(fmu)
    settings = {name: spec.values.get(name, start) for name, (start, _) in parameters.items() if name not in names}
    units = {name: parameters[name][1] for name in names}
    options = {name: value for name in MapRequest._fields[2:] if (value := getattr(request, name))}
    n_runs = sum(line.n_runs for line in labelled_lines)
    failures = tuple(failure for line in labelled_lines for failure in line.failures)
    if {*labels} == {FAILED}:
        raise HarnessError(f"all runs of the map failed, such as {failures[0]}")
    n_gaps = sum(line.n_gaps for line in labelled_lines)
    return MapResult(spec, units, grid, labels, edges, n_gaps, n_runs, failures, settings, options)
