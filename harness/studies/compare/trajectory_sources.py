"""The trajectories that are compared, wherever they come from: a result folder, a file, or a run of any FMU."""

from collections.abc import Sequence
from dataclasses import replace
from os.path import abspath
from pathlib import Path

import numpy as np

from ...errors import HarnessError, SceneError
from ...running.description import read_description, resolve_stop
from ...running.fmi2 import ProgressCallback
from ...running.run_spec import RunSpec, spec_from_scene
from ...running.runner import DEFAULT_COMMUNICATION_STEPS, run
from ...running.signals import Signals, signals_from_trajectory
from ...scenes.fmu_files import check_built, find_fmu
from ...scenes.scene import load_scene
from .trajectory_files import read_trajectory

FILES = (".csv", ".txt", ".mat", ".xlsx", ".ods", ".npz")
SUFFIXES = (".fmu", ".py", ".toml")  # of what is run


def load_both(sources: Sequence[str | Signals], how: RunSpec, report: ProgressCallback) -> tuple[Signals, Signals]:
    """The trajectories of two folders, files, FMUs' paths or scenes.  What can be run is run to the same times, those
    of the other one if that is recorded or is a scene with a grid, and to the same stop; `how` says the rest."""
    found = [source if isinstance(source, Signals) else read_recorded(source) for source in sources]
    runs = [None if each else run_spec_for(str(source), how) for each, source in zip(found, sources, strict=True)]
    grids = [grid_spacing(each.time) for each in found if each] + [each.grid for each in runs if each]
    grid = next(filter(None, grids), None)
    ends = [resolve_stop(each, read_description(each.fmu, each.lenient)) for each in runs if each]
    stops = {*ends, *(float(each.time[-1]) for each in found if each)}
    stop = how.stop if None in stops or len(stops) == 1 else min(filter(None, stops))
    sides = []
    for each, asked in zip(found, runs, strict=True):
        if asked:
            asked = replace(
                asked, grid=grid, equal_steps=DEFAULT_COMMUNICATION_STEPS, stop=stop if how.stop is None else how.stop
            )
            each = signals_from_trajectory(run(asked, report))
        assert each
        sides.append(each)
    return sides[0], sides[1]


def display_names(sources: tuple[str, str]) -> list[str]:
    """What two sources are called; where they are called alike, with the folders or endings in which they differ."""
    paths = [Path(abspath(each)) if Path(each).exists() else Path("scene", each) for each in sources]
    plain = [each if each.is_dir() or each.parts[0] == "scene" else each.with_suffix("") for each in paths]
    alike = plain[0] == plain[1] and paths[0] != paths[1]
    one, two = (each.parts for each in (paths if alike else plain))
    apart = next((k for k, ends in enumerate(zip(one[::-1], two[::-1], strict=False), 1) if ends[0] != ends[1]), 1)
    return ["/".join(parts[-apart:]) for parts in (one, two)]


def run_spec_for(source: str, how: RunSpec) -> RunSpec:
    """What runs an FMU by its path or by that of its model, or a scene."""
    if Path(source).suffix in (".fmu", ".py"):
        return replace(how, fmu=find_fmu(source))
    scene = load_scene(source)
    check_built(scene.file)
    return spec_from_scene(scene)


def read_recorded(source: str) -> Signals | None:
    """The trajectory of a folder or a file; None for what has to be run."""
    path = Path(source)
    if path.exists() and path.suffix not in SUFFIXES:
        return read_trajectory(path)
    if path.suffix in FILES:
        raise SceneError(f"there is no {path}: name a file or folder of results that is here, an FMU, or a scene")
    return None


def grid_spacing(time: np.ndarray) -> float | None:
    """The communication step in s of which the times (n,) are multiples, but for some that lie between, as of events;
    None if there is none."""
    h = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    places = (time - time[0]) / h if h > 0 else np.full(len(time), np.nan)
    even = np.abs(places - np.rint(places)) < 1e-6 * np.maximum(places, 1)
    return h if even.mean() > 0.5 else None


def common_span(one: Signals, two: Signals) -> tuple[float, float]:
    """The stretch of time in s that both cover; HarnessError if there is none."""
    begin, end = max(one.time[0], two.time[0]), min(one.time[-1], two.time[-1])
    if not end > begin:
        raise HarnessError(f"{one.name} and {two.name} have no time in common")
    return float(begin), float(end)
