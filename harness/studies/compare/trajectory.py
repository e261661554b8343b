"""A trajectory, wherever it comes from: a result folder, a CSV file, or a run of any FMU."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...analyses.decay.columns import numeric, split
from ...analyses.decay.units import TIMES
from ...errors import HarnessError, SceneError, shown
from ...running.any_fmu import POINTS, run
from ...running.specification import Specification, of_scene
from ...running.trajectory import Trajectory, of_run
from ...scenes.fmus import check_built
from ...scenes.scene import load as load_scene

LATEST = 1e100  # s, either way


def read(path: Path) -> Trajectory:
    """The trajectory in a CSV file or a result folder; SceneError in one sentence if there is none."""
    file = path / "trajectory.csv" if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        raise SceneError(f"{path} is no result folder: it has no trajectory.csv")
    heads, table = numeric(file)
    names, units = zip(*map(split, heads), strict=True)
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    if twice:
        raise SceneError(f"{file.name}: two columns are named {shown(twice[0])}")
    if units[0] not in (None, *TIMES):
        raise SceneError(f"{file.name}: the first column must be the time, and its unit is '{units[0]}'")
    time = table[:, 0] * TIMES[units[0] or "s"]
    if not ((np.abs(time) < LATEST).all() and (np.diff(time) >= 0).all()):
        raise SceneError(f"{file.name}: the time in its first column must rise, within {LATEST:g} s")
    columns = {name: table[:, i] for i, name in enumerate(names) if i}
    events = path / "events.csv" if path.is_dir() else None
    known = numeric(events)[1] if events and events.is_file() else None
    if known is not None and (known.shape[1] != 2 or not np.isfinite(known).all()):
        raise SceneError(f"{events} holds no times and modes")
    told = dict(zip(names, (unit or "" for unit in units), strict=True))
    return Trajectory(path.stem, time, columns, told, known, file=file)


def both(
    sources: tuple[str, str], how: Specification, report: Callable[[float], None]
) -> tuple[Trajectory, Trajectory]:
    """The trajectories of two folders, CSV files, FMUs' paths or shipped scenes' names.  Where one is recorded and the
    other can be run, it is run to the same times; `how` says the rest."""
    found = [recorded(source) for source in sources]
    grid = next((spacing(each.time) for each in found if each), None)
    one, two = (
        each or ran(source, replace(how, grid=grid), report) for each, source in zip(found, sources, strict=True)
    )
    return one, two


def recorded(source: str) -> Trajectory | None:
    """The trajectory of a folder or a CSV file; None for what has to be run."""
    path = Path(source)
    if path.exists() and path.suffix not in (".fmu", ".toml"):
        return read(path)
    if path.suffix in (".csv", ".txt"):
        raise SceneError(f"there is no {path}")
    return None


def ran(source: str, how: Specification, report: Callable[[float], None]) -> Trajectory:
    """The trajectory of an FMU's path or a shipped scene's name, run anew."""
    path = Path(source)
    if path.suffix == ".fmu":
        return of_run(run(replace(how, fmu=path, even=POINTS), report))
    scene = load_scene(source)
    check_built(scene.file)
    wanted = of_scene(scene)
    found = of_run(run(replace(wanted, grid=how.grid or wanted.grid, even=POINTS), report))
    return replace(found, name=scene.name)


def spacing(time: np.ndarray) -> float | None:
    """The communication step in s of which the times (n,) are multiples, but for some that lie between, as of events;
    None if there is none."""
    h = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    places = (time - time[0]) / h if h > 0 else np.full(len(time), np.nan)
    even = np.abs(places - np.rint(places)) < 1e-6 * np.maximum(places, 1)
    return h if even.mean() > 0.5 else None


def common(one: Trajectory, two: Trajectory) -> tuple[float, float]:
    """The stretch of time in s that both cover; HarnessError if there is none."""
    begin, end = max(one.time[0], two.time[0]), min(one.time[-1], two.time[-1])
    if not end > begin:
        raise HarnessError(f"{one.name} and {two.name} have no time in common")
    return float(begin), float(end)
