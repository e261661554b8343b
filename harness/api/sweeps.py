"""Sweeps from Python: `sweep`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    WORKERS,
    Progress,
    Rule,
    check_arguments,
    mapping,
    text,
)
from ..errors import SceneError, by_interface, import_optional
from .options import apply_options, reporter, with_progress_bar

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..studies.sweep.result import SweepResult


def folder_name(value: Any) -> str:
    """Return the name of a folder, which is no path and does not begin with a dot."""
    if (name := text(value)).startswith(".") or Path(name).name != name:
        raise ValueError
    return name


NAME = Rule("a single folder name that does not start with a dot", folder_name)
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
    folder=PATH,
    name=NAME,
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
    folder: "str | Path | None" = None,
    name: str | None = None,
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
        Number of worker processes; by default all runs are done in this process, and by the command in one process for
        each processor.
    folder : path, optional
        Folder for results, as the option ``--out``; the files are in ``sweep/NAME`` below it, and an interrupted sweep
        is resumed. By default no file is written.
    name : str, optional
        Name of the folder of this sweep; by default that of the model, the varied parameters and a key.
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
    from ..studies.sweep.study import run_sweep

    import_optional("xarray", "a sweep", "sweep")
    if not grid:
        raise SceneError("grid is empty: name at least one parameter and its values, as in {'mu_d': [0.3, 0.6]}")
    if name is not None and folder is None:
        raise SceneError("name has no effect without folder: give the folder for results as well")
    run = RunSpec(find_fmu(str(source)), values=dict(values or {}), follow=False)
    run = apply_options(run, stop=stop, rtol=rtol, interface=interface, timeout=timeout, lenient=lenient)
    with temporary_directory("sweep-") if folder is None else nullcontext(Path(folder)) as directory:
        resume = by_interface("repeat the command to resume", "repeat the call to resume")
        if folder is None:
            resume = "they are lost, because `folder` is not set"
        result = run_sweep(run, grid, samples, seed, measures, name, directory, workers, reporter(progress), resume)
        result.data  # noqa: B018 - loads it before a temporary folder is removed
    if folder is None:
        result.folder = None
    return result
