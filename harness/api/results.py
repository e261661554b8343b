"""Stored results for Python: `load_result`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import PATH, check_arguments
from ..errors import SceneError, first_line, import_optional

if TYPE_CHECKING:
    import xarray

    from ..results.result import Result
    from ..running.trajectory import Trajectory


@check_arguments(folder=PATH)
def load_result(folder: "str | Path") -> "Result | xarray.Dataset | dict[str, Any]":
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
    import json

    from ..results.loading import load

    path = Path(folder)
    if (path / "sweep.nc").is_file():
        library = import_optional("xarray", "to read a sweep", "sweep")
        try:
            with library.open_dataset(path / "sweep.nc") as data:
                loaded: xarray.Dataset = data.load()
        except (OSError, ValueError) as error:
            raise SceneError(f"{path / 'sweep.nc'} cannot be read: {first_line(error)}") from None
        return loaded
    if (path / "decay.json").is_file() or (path / "compare.json").is_file():
        return load(path)
    for name in ("fit.json",):
        if (path / name).is_file():
            try:
                numbers: dict[str, Any] = json.loads((path / name).read_text(encoding="utf-8"))
            except (OSError, ValueError) as error:
                raise SceneError(f"{path / name} cannot be read: {first_line(error)}") from None
            return numbers
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
