"""Sweeps from Python: `sweep`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import SceneError, import_optional
from .options import QUIET, Progress, apply_options

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike


def sweep(
    source: "str | Path",
    grid: "Mapping[str, ArrayLike]",
    *,
    values: Mapping[str, float | str] | None = None,
    samples: int | None = None,
    seed: int = 1,
    measures: Sequence[str] = (),
    stop: float | None = None,
    rtol: float | None = None,
    interface: str | None = None,
    timeout: float | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    folder: "str | Path | None" = None,
    progress: Progress | None = None,
) -> "xarray.Dataset":
    """Run a model or an FMU at many points of its parameters.

    Parameters
    ----------
    source : str or path
        The name of a model or the path of an FMU.
    grid : mapping
        Values of each varied parameter; every combination is run. With `samples`, the lower and the upper bound of
        each parameter.
    values : mapping, optional
        Parameters that all runs share.
    samples : int, optional
        Number of points of a Latin hypercube, instead of a grid.
    seed : int
        Seed of the Latin hypercube.
    measures : sequence of str
        Measures, as ``"final"``, ``"period"`` or ``"steps"``; by default the final values, and events if the FMU
        counts them.
    stop, rtol, interface, timeout
        As in `simulate`; `rtol` is for FMUs that are not of this project.
    workers : int, optional
        Number of worker processes; by default all runs are done in this process. A script with workers must call
        `sweep` below ``if __name__ == "__main__":``.
    scheduler : str, optional
        Address of a Dask cluster, as ``"tcp://host:8786"``.
    folder : path, optional
        Folder for the files of the sweep; an interrupted sweep is resumed from it.
    progress : callable, optional
        Receives the progress from 0 to 1.

    Returns
    -------
    xarray.Dataset
        A dimension for each varied parameter (``run`` for samples), a variable for each measure, and ``error``, the
        error message of a failed run, otherwise empty.

    Raises
    ------
    HarnessError
        If xarray, dask or netCDF4 is not installed, or no run can be done.
    """
    from contextlib import nullcontext

    from ..process.temporary_directory import temporary_directory
    from ..scenes.fmu_files import find_fmu
    from ..scenes.run_spec import RunSpec
    from ..studies.sweep.result_files import run_sweep
    from ..studies.sweep.runner import SweepSpec
    from ..studies.sweep.sampling import SweepPoints, axis_from_numbers

    library, *_ = (import_optional(package, "a sweep", "sweep") for package in ("xarray", "dask", "netCDF4"))
    if not grid:
        raise SceneError("grid is empty: name at least one parameter and its values, as in {'mu_d': [0.3, 0.6]}")
    run = apply_options(RunSpec(find_fmu(str(source)), follow=False), stop=stop, interface=interface, timeout=timeout)
    run = replace(run, values=dict(values or {}), tolerance=run.tolerance if rtol is None else rtol)
    axes = tuple(axis_from_numbers(name, column, samples is not None) for name, column in grid.items())
    points = SweepPoints(axes, samples, seed)
    spec = SweepSpec(run, points.names, tuple(measures))
    with temporary_directory("sweep-") if folder is None else nullcontext(Path(folder)) as directory:
        result = run_sweep(spec, points, None, directory, scheduler, workers, progress or QUIET)
        with library.open_dataset(result.folder / "sweep.nc") as data:
            loaded: xarray.Dataset = data.load()
    return loaded
