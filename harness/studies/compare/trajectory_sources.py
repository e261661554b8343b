"""The two trajectories of a comparison, from result folders, files, or runs of FMUs and scenes."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from os.path import abspath
from pathlib import Path

import numpy as np

from ...errors import HarnessError, SceneError
from ...scenes.run_spec import RunOptions, RunSpec
from ...simulation.external.step_refinement import communication_step, declared_step
from ...simulation.fmu_archive import read_description, resolve_stop, resolve_time_span
from ...simulation.resolve import FMU_SUFFIXES, resolve
from ...simulation.runner import DEFAULT_COMMUNICATION_STEPS, run
from ...simulation.session import ProgressCallback
from ...simulation.signals import Signals
from ...simulation.trajectory_files import read_signals

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
    adjusted = iter(
        adjust(
            [
                resolve(str(source), options, scenes_first=True)
                for item, source in zip(recordings, sources, strict=True)
                if not item
            ]
        )
    )
    runs = [None if item else next(adjusted) for item in recordings]
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
    one, two = (path.parts for path in (paths if has_same_stem else stems))
    n_parts = next((k for k, ends in enumerate(zip(one[::-1], two[::-1], strict=False), 1) if ends[0] != ends[1]), 1)
    return ["/".join(parts[-n_parts:]) for parts in (one, two)]


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


def common_span(one: Signals, two: Signals) -> tuple[float, float]:
    """Return the common time span in s; HarnessError if there is none."""
    begin, end = max(one.time[0], two.time[0]), min(one.time[-1], two.time[-1])
    if not end > begin:
        raise HarnessError(f"{one.name} and {two.name} have no time in common")
    return float(begin), float(end)
