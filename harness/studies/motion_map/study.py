"""What motions end in at the points of a grid, and the edges between them along its lines, by bisection."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import NamedTuple

import numpy as np

from ...errors import HarnessError
from ...process.interrupt import check_interrupt
from ...process.temporary_directory import temporary_directory
from ...process.workers import open_workers
from ...scenes.run_spec import RunSpec
from ...simulation.edges import find_edges
from ...simulation.fmu_archive import PROCESS_RESOURCES
from ...simulation.native_equivalent import native_with_derivatives
from ...simulation.oscillator import Oscillator, open_oscillator
from ...simulation.poincare import CYCLE, ReturnMap
from .result import Edge, MapResult

STEADY, STICK_SLIP, BOTH, NEITHER = "steady sliding", "stick-slip", "steady sliding or stick-slip", "neither"

BUSY = Lock()  # messages of FMUs are captured by one thread at a time


class Line(NamedTuple):
    """Labels (n,) of the points of a line, the edges between them, and the number of runs."""

    labels: list[str]
    edges: list[Edge]
    n_runs: int


class LineSearch:
    """Labels the points of a line of the grid, and finds the edges between them."""

    def __init__(self, oscillator: Oscillator) -> None:
        self.oscillator, self.map = oscillator, ReturnMap(oscillator)

    def label(self, point: np.ndarray) -> str:
        """Return what motions end in.

        Of one body that slides steadily, this is exact: by the eigenvalues of steady sliding, and by whether a motion
        that has stuck sticks again. Of any other model it is what the motion from its start ends in.
        """
        self.oscillator.set_point(point.tolist())
        steady = self.oscillator.find_steady_sliding()
        if steady is not None and self.oscillator.is_one_body:
            sticks = self.map.sticks_again(steady)
            return {(1, 0): STEADY, (0, 1): STICK_SLIP, (1, 1): BOTH, (0, 0): NEITHER}[steady.growth < 0.0, sticks]
        end = self.map.run_long(self.oscillator.start)
        return f"{end.n_sticks} sticks in a period" if end.kind == CYCLE else end.kind

    def search(self, points: np.ndarray) -> Line:
        """Label the points (n, axes) of a line, of which one coordinate varies, and bisect between different ones."""
        before, edges = self.oscillator.n_runs, list[Edge]()
        labels = [self.label(point) for point in points]
        for (one, two), (a, b) in zip(pairwise(labels), pairwise(points), strict=True):
            for low, high, *names in find_edges(self.label, a, b, one, two):
                edges.append(Edge(tuple((0.5 * (low + high)).tolist()), *names))
        return Line(labels, edges, self.oscillator.n_runs - before)


def search_line(spec: RunSpec, fmu: bytes, names: tuple[str, ...], period: float | None, points: np.ndarray) -> Line:
    """Search a line in a worker, which may not have the file of the FMU."""
    with BUSY, open_oscillator(replace(spec, fmu=store_fmu(spec.fmu.name, fmu)), names, period) as oscillator:
        return LineSearch(oscillator).search(points)


@cache
def store_fmu(name: str, content: bytes) -> Path:
    """Store an FMU until the process ends, and return its path."""
    file = PROCESS_RESOURCES.enter_context(temporary_directory("map-")) / name
    file.write_bytes(content)
    return file


def grid_lines(axes: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the lines of a grid along each of its axes, with their points (n, axes)."""
    if len(axes) == 1:
        return [axes[0][:, None]]
    x, y = axes
    rows = [np.column_stack([x, np.full(len(x), value)]) for value in y]
    columns = [np.column_stack([np.full(len(y), value), y]) for value in x]
    return rows + columns


def compute_map(
    spec: RunSpec,
    axes: dict[str, np.ndarray],
    workers: int | None,
    scheduler: str | None = None,
    period: float | None = None,
    report: Callable[[float], None] = lambda share: None,
) -> MapResult:
    """Find what motions end in over one or two parameters.

    Parameters
    ----------
    spec : RunSpec
        FMU and values.
    axes : dict of numpy.ndarray
        Increasing values (n,) of each parameter.
    workers : int or None
        Number of worker processes; None for this process.
    scheduler : str or None
        Address of the scheduler of a Dask cluster, whose workers are used.
    period : float or None
        Period in s of the inputs, or of forces that depend on a clock.
    report : callable
        Receives the progress from 0 to 1.

    Raises
    ------
    SceneError
        If a name or a value is not valid.
    HarnessError
        If the FMU is not suitable, or a worker dies.
    """
    names, run = tuple(axes), replace(spec, fmu=native_with_derivatives(spec.fmu))
    lines, grid = grid_lines([*axes.values()]), tuple(axes.values())
    with open_oscillator(run, names, period) as oscillator:
        units = {name: oscillator.units[name] for name in names}
        settings = {name: oscillator.default(name) for name in oscillator.parameters if name not in names}
    content = run.fmu.read_bytes()
    with open_workers(scheduler, workers, len(lines)) as pool:
        futures: dict[Future[Line], int] = {}
        results = dict[int, Line]()
        while len(results) < len(lines):
            check_interrupt()
            while len(futures) < 2 * max(1, pool.size) and len(results) + len(futures) < len(lines):
                number = len(results) + len(futures)
                futures[pool.submit(search_line, run, content, names, period, lines[number])] = number
            for future in pool.wait_for_any(futures):
                try:
                    results[futures.pop(future)] = future.result()
                except pool.death_errors:
                    raise HarnessError(f"{spec.fmu.name}: a worker process died") from None
                report(len(results) / len(lines))
    ordered = [results[number] for number in range(len(lines))]
    first_lines = ordered[: len(grid[-1]) if len(grid) > 1 else 1]  # those along the first parameter have all points
    labels = tuple(label for line in first_lines for label in line.labels)
    edges = tuple(edge for line in ordered for edge in line.edges)
    return MapResult(spec, units, grid, labels, edges, sum(line.n_runs for line in ordered), settings)
