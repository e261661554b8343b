"""Sweeps from Python: `sweep`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import (
    FINITE,
    FLAG,
    INTERFACE,
    NAMES,
    NATURAL,
    PATH,
    POSITIVE,
    PROGRESS,
    RUNS,
    SETTINGS,
    TEXT,
    WORKERS,
    Progress,
    Rule,
    check_arguments,
    mapping,
)
from ..errors import SceneError, import_optional
from .options import apply_options, reporter, with_progress_bar

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..studies.sweep.result import SweepResult


GRID = mapping(Rule("numbers", lambda values: values), "numbers")  # the axes check their values


@check_arguments(
    source=PATH,
    grid=GRID,
    values=SETTINGS,
    samples=RUNS,
    seed=NATURAL,
    measures=NAMES,
    stop=FINITE,
    rtol=POSITIVE,
    interface=INTERFACE,
    timeout=POSITIVE,
    lenient=FLAG,
    workers=WORKERS,
    scheduler=TEXT,
    folder=PATH,
    progress=PROGRESS,
)
@with_progress_bar
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
    lenient: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    folder: "str | Path | None" = None,
    progress: Progress | bool | None = None,
) -> "SweepResult":
    """Run a model or an FMU at many points of its parameters.

    Parameters
    ----------
    source : str or path
        The name of a model or the path of an FMU.
    grid : mapping
        Values of each varied parameter, numbers or labels of an enumeration, as in ``{"friction": ["hybrid",
        "threshold"]}``; every combination is run. With `samples`, the lower and the upper bound of
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
    stop, rtol, interface, timeout, lenient
        As in `simulate`.
    workers : int, optional
        Number of worker processes; by default all runs are done in this process.
    scheduler : str, optional
        Address of a Dask cluster, as ``"tcp://host:8786"``.
    folder : path, optional
        Folder for the files of the sweep; an interrupted sweep is resumed from it.
    progress : callable or False, optional
        Receives the progress from 0 to 1. By default a terminal or a notebook shows a bar after two seconds; False
        switches it off.

    Returns
    -------
    SweepResult
        Its `data` is an xarray.Dataset: a dimension for each varied parameter (``run`` for samples), a variable for
        each measure, and ``error``, the error message of a failed run, otherwise empty.

    Raises
    ------
    HarnessError
        If xarray is not installed, or no run can be done.
    """
    from contextlib import nullcontext

    from ..process.temporary_directory import temporary_directory
    from ..scenes.fmu_files import find_fmu
    from ..scenes.run_spec import RunSpec
    from ..studies.sweep.labels import list_labels, read_labels, replace_labels
    from ..studies.sweep.runner import SweepSpec
    from ..studies.sweep.sampling import SweepPoints, axis_from_numbers
    from ..studies.sweep.study import run_sweep

    import_optional("xarray", "a sweep", "sweep")
    if not grid:
        raise SceneError("grid is empty: name at least one parameter and its values, as in {'mu_d': [0.3, 0.6]}")
    if workers is not None and scheduler is not None:
        raise SceneError("workers has no effect with scheduler, whose cluster has its own workers: leave one out")
    run = RunSpec(find_fmu(str(source)), values=dict(values or {}), follow=False)
    run = apply_options(run, stop=stop, rtol=rtol, interface=interface, timeout=timeout, lenient=lenient)
    if twice := set(grid) & set(run.values):
        raise SceneError(f"{min(twice)} is varied by grid and has a value for all runs: remove one")
    labels = read_labels(run) if any(map(list_labels, grid.values())) else {}
    columns = {name: replace_labels(name, column, labels) for name, column in grid.items()}
    axes = tuple(axis_from_numbers(name, column, samples is not None) for name, column in columns.items())
    points = SweepPoints(axes, samples, seed)
    spec = SweepSpec(run, points.names, tuple(measures))
    with temporary_directory("sweep-") if folder is None else nullcontext(Path(folder)) as directory:
        resume = "they are lost, because `folder` is not set" if folder is None else "repeat the call to resume"
        result = run_sweep(spec, points, None, directory, scheduler, workers, reporter(progress), resume)
        result.data  # noqa: B018 - loads it before a temporary folder is removed
    if folder is None:
        result.folder = None
    return result
