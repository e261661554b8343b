"""Stored results for Python: `load_result`."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import PATH, check_arguments
from ..errors import SceneError

if TYPE_CHECKING:
    from ..results.result import Result
    from ..running.trajectory import Trajectory


@check_arguments(folder=PATH)
def load_result(folder: "str | Path") -> "Result | Trajectory":
    """Read a stored result.

    Parameters
    ----------
    folder : path
        A result folder, as a command or `save` writes it.

    Returns
    -------
    Result
        The same class as from the function of Python: a `Trajectory`, `DecayResult`, `FitResult`, `Comparison` or
        `SweepResult`; for other studies the class of their results. A result of an earlier version is a `StoredResult`,
        which has its numbers and sentences.

    Raises
    ------
    SceneError
        If the folder holds no result, or it is damaged.
    """
    from ..results.loading import load

    path = Path(folder)
    if any((path / name).is_file() for name in ("sweep.nc", "decay.json", "fit.json", "compare.json")):
        return load(path)
    if not (path / "trajectory.csv").is_file():
        raise SceneError(
            f"{folder} holds no result: name a folder with trajectory.csv, sweep.nc, decay.json, fit.json or "
            "compare.json"
        )
    return read_run(path)


def read_run(folder: Path) -> "Trajectory":
    """Read the run in a result folder."""
    import numpy as np

    from ..records.columns import read_numeric
    from ..results.provenance import load_provenance
    from ..running.trajectory import SolverSteps, Trajectory
    from ..scenes.run_spec import RunSpec
    from ..studies.compare.trajectory_files import read_trajectory

    signals, origin = read_trajectory(folder), load_provenance(folder)
    parameters = {name: parameter["value"] for name, parameter in origin.get("parameters", {}).items()}
    units = signals.units | {name: parameter["unit"] for name, parameter in origin.get("parameters", {}).items()}
    try:
        spec = RunSpec.from_json(origin.get("run") or {})
    except SceneError:  # of an earlier version, or of another tool
        spec = RunSpec(Path(f"{folder.name}.fmu"), outputs=tuple(signals.columns))
    steps = None
    if (folder / "steps.csv").is_file():
        ends, sizes, rejected = read_numeric(folder / "steps.csv")[1].T
        steps = SolverSteps(np.append(signals.time[0], ends), sizes, rejected.astype(int))
    names = {name: name for name in signals.columns}
    return Trajectory(spec, signals.time, signals.columns, units, names, parameters, steps, signals.events)
