"""A trajectory, wherever it comes from: a result folder, a CSV file, or a run of any FMU."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...analyses.decay.columns import numeric, split
from ...analyses.decay.units import TIMES
from ...errors import HarnessError, SceneError, shown
from ...running.any_fmu import own, run
from ...running.fmu import simulate
from ...running.trajectory import Trajectory, of_run
from ...scenes.scene import check_built
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
    last = np.append(np.diff(time) > 0, True)  # where a time stands twice, what holds after the event
    columns = {name: table[last, i] for i, name in enumerate(names) if i}
    events = path / "events.csv" if path.is_dir() else None
    known = numeric(events)[1] if events and events.is_file() else None
    if known is not None and (known.shape[1] != 2 or not np.isfinite(known).all()):
        raise SceneError(f"{events} holds no times and modes")
    return Trajectory(path.stem, time[last], columns, dict(zip(names, (u or "" for u in units), strict=True)), known)


def load(source: str, stop: float | None, tolerance: float, report: Callable[[float], None]) -> Trajectory:
    """The trajectory of a folder, a CSV file, an FMU's path or a shipped scene's name."""
    path = Path(source)
    if path.suffix == ".fmu":
        scene = own(path, stop)
        return of_run(simulate(scene, report)) if scene else run(path, stop, tolerance, {}, report)
    if path.exists() and path.suffix != ".toml":
        return read(path)
    if path.suffix in (".csv", ".txt"):
        raise SceneError(f"there is no {path}")
    scene = load_scene(source)
    check_built(scene.fmu)
    return of_run(simulate(scene, report))


def common(one: Trajectory, two: Trajectory) -> tuple[float, float]:
    """The stretch of time in s that both cover; HarnessError if there is none."""
    begin, end = max(one.time[0], two.time[0]), min(one.time[-1], two.time[-1])
    if not end > begin:
        raise HarnessError(f"{one.name} and {two.name} have no time in common")
    return float(begin), float(end)
