"""Runs from Python: `simulate`, `compare` and `sensitivity`; `describe` and `load_result`, which run nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import (
    FINITE,
    FLAG,
    INCREASING_ROW,
    INTERFACE,
    METHOD,
    PATH,
    POSITIVE,
    PROGRESS,
    SETTINGS,
    SOME_NAMES,
    SUBTRACT_FIRST,
    Progress,
    check_arguments,
    has_time_stamps,
    to_array,
)
from ..errors import SceneError, format_value
from .options import apply_options, reporter, with_progress_bar
from .tables import SIDE, convert_to_signals, is_xarray, list_variables

if TYPE_CHECKING:
    import numpy as np
    import pandas
    import xarray
    from numpy.typing import ArrayLike

    from ..results.result import Result
    from ..scenes.run_spec import RunSpec
    from ..simulation.fmu_variables import FmuDescription
    from ..simulation.trajectory import Trajectory
    from ..studies.compare.result import ComparisonResult
    from ..studies.run.result import RunResult
    from ..studies.sensitivity.result import SensitivityResult


@check_arguments(
    source=PATH,
    values=SETTINGS,
    start=FINITE,
    stop=FINITE,
    interval=POSITIVE,
    times=INCREASING_ROW,
    outputs=SOME_NAMES,
    method=METHOD,
    rtol=POSITIVE,
    interface=INTERFACE,
    timeout=POSITIVE,
    lenient=FLAG,
    progress=PROGRESS,
)
@with_progress_bar
def simulate(
    source: "str | Path",
    values: Mapping[str, float | str] | None = None,
    *,
    start: float | None = None,
    stop: float | None = None,
    interval: float | None = None,
    times: "ArrayLike | None" = None,
    outputs: Sequence[str] | None = None,
    method: str | int | None = None,
    rtol: float | None = None,
    interface: str | None = None,
    inputs: "Mapping[str, ArrayLike] | pandas.DataFrame | xarray.Dataset | None" = None,
    timeout: float | None = None,
    lenient: bool = False,
    progress: Progress | bool | None = None,
) -> "RunResult":
    """Run a model, a scene or an FMU once.

    Parameters
    ----------
    source : str or path
        The name of a model (``"stickslip"``), the path of an FMU, or the name or path of a scene (``"my_scene.toml"``).
        A name that a model and a scene share means the model here, and the scene for the command `run`.
    values : mapping, optional
        Parameters and start values by name, in the units of the FMU; enumerations by label or number.
    start, stop : float, optional
        Start and stop time in s; by default those of the source.
    interval : float, optional
        Time between two recorded points in s. By default 4096 intervals and every step and event of the solver are
        recorded.
    times : array_like, optional
        Increasing times (n,) in s to record instead, as those of a measurement; the run stops at the last one unless
        `stop` is given.
    outputs : sequence of str, optional
        Variables to record; by default all outputs of a model or FMU, and those that a scene names.
    method : str or int, optional
        Integration method of an FMU of this project, as ``"exact"`` or ``"dop853"``.
    rtol : float, optional
        Relative tolerance of the solver of an FMU of this project; the method ``exact`` meets every tolerance.
        Other FMUs are run with shorter and shorter communication steps until two results agree to this tolerance.
    interface : {"CoSimulation", "ModelExchange"}, optional
        Interface to use if the FMU offers both; co-simulation by default.
    inputs : mapping, DataFrame or Dataset, optional
        Input signals: the column ``time`` in s and a column for each input. Values between two rows are interpolated;
        a time that occurs twice is a jump, as in `fit`. FMUs that interpolate inputs, as the native ones for FMI 2.0,
        follow them within a communication step. In co-simulation of others an input has its value at the middle of the
        step, which shifts an event by up to half a step, at most 1/8192 of the run with `interval`; an input whose rate
        the model declares starts with its value and is continued by the rate, which needs a column as well.
    timeout : float, optional
        Seconds allowed for one call of an FMU that is not of this project, or for 1/4096 of the run of an FMU of this
        project; 60 by default.
    lenient : bool
        Whether to run an FMU that violates the FMI standard.
    progress : callable or False, optional
        Receives the progress from 0 to 1. By default a terminal or a notebook shows a bar after two seconds; False
        switches it off.

    Returns
    -------
    RunResult
        Time, columns by name, units, events, statistics and effective parameters; for a scene, the `quantities` of its
        analyses as well.

    Raises
    ------
    SceneError
        If the source or an argument is not valid.
    HarnessError
        If the run fails; the text is the message of the FMU. If it ends early, `run` of the error holds it up to then.

    Examples
    --------
    >>> sled = simulate("stickslip", {"mu_s": 0.8}, stop=8.0)  # doctest: +SKIP
    >>> sled["x"][-1]  # doctest: +SKIP
    """
    from ..simulation.resolve import find_source, specify_run
    from ..studies.run.study import run_once

    item = find_source(source)
    spec, scene = specify_run(item), None if isinstance(item, Path) else item
    if values:
        spec = replace(spec, values={**spec.values, **values})
    if inputs is not None:
        spec = replace(spec, inputs={str(name): column for name, column in read_input_columns(inputs).items()})
    if start is not None:
        spec = replace(spec, start=start)
    if times is not None:
        spec = replace(spec, times=tuple(times.tolist()))  # type: ignore[union-attr] # a row by its rule
    spec = apply_options(spec, stop, interval, outputs, method, rtol, interface, timeout, lenient)
    if interval is not None and spec.inputs:
        spec = replace(spec, grid=choose_fine_step(spec, interval))
    return run_once(spec, scene, reporter(progress))


@check_arguments(
    a=SIDE, b=SIDE, stop=FINITE, rtol=POSITIVE, interface=INTERFACE, timeout=POSITIVE, lenient=FLAG, progress=PROGRESS
)
@with_progress_bar
def compare(
    a: "str | Path | Trajectory | pandas.DataFrame | pandas.Series | Mapping[str, ArrayLike]",
    b: "str | Path | Trajectory | pandas.DataFrame | pandas.Series | Mapping[str, ArrayLike]",
    *,
    stop: float | None = None,
    rtol: float | None = None,
    interface: str | None = None,
    timeout: float | None = None,
    lenient: bool = False,
    progress: Progress | bool | None = None,
) -> "ComparisonResult":
    """Compare two trajectories variable by variable and event by event.

    Parameters
    ----------
    a, b : Trajectory, str, path, DataFrame, Series or mapping
        Trajectories, tables whose columns have the names of outputs, result folders, files (fmpy, OpenModelica, Dymola,
        any table with the time in its first column), FMUs or scenes. FMUs and scenes are run at the times of the other
        side.
    stop, rtol, interface, timeout, lenient
        Options for FMUs and scenes that have to be run, as in `simulate`; refused if both sides are recorded.
    progress : callable or False, optional
        Receives the progress from 0 to 1. By default a terminal or a notebook shows a bar after two seconds; False
        switches it off.

    Returns
    -------
    ComparisonResult
        The largest and root-mean-square difference of each variable, and the matched events.

    Raises
    ------
    HarnessError
        If the two sides have no variable or no time in common.
    """
    from ..scenes.run_spec import RunOptions
    from ..studies.compare.result import ComparisonResult
    from ..studies.compare.study import compare as difference
    from ..studies.compare.study import display_names, load_both

    options = {"stop": stop, "interface": interface, "timeout": timeout, "rtol": rtol, "lenient": lenient or None}
    first, second = load_both(
        tuple(str(side) if isinstance(side, str | Path) else convert_to_signals(side) for side in (a, b)),
        RunOptions(stop=stop),
        reporter(progress),
        partial(adjust_runs, {name: value for name, value in options.items() if value is not None}),
    )
    paths = [side for side in (a, b) if isinstance(side, str | Path)]
    if len(paths) == 2:
        first_label, second_label = display_names((str(a), str(b)))
        first, second = replace(first, label=first_label), replace(second, label=second_label)
    elif first.name == second.name:
        first, second = replace(first, label=f"{first.name} (a)"), replace(second, label=f"{second.name} (b)")
    return ComparisonResult(**vars(difference(first, second)))


def adjust_runs(options: dict[str, Any], runs: "list[RunSpec]") -> "list[RunSpec]":
    """Return the runs of a comparison with options; raise SceneError if there are none that could have them."""
    if options and not runs:
        raise SceneError(f"{next(iter(options))} has no effect, because both sides are recorded: leave it out")
    return [apply_options(spec, **options) for spec in runs]


def choose_fine_step(spec: "RunSpec", interval: float) -> float:
    """Return a communication step in s for inputs: an integer fraction of the interval, at most 1/4096 of the run."""
    from math import ceil

    from ..scenes.run_spec import DEFAULT_EQUAL_STEPS
    from ..simulation.fmu_archive import read_description, resolve_time_span

    start, stop = resolve_time_span(spec, read_description(spec.fmu, spec.lenient))
    return interval / ceil(interval * DEFAULT_EQUAL_STEPS / (stop - start))


def read_input_columns(inputs: Any) -> dict[str, tuple[float, ...]]:
    """Return the columns of a mapping, a DataFrame, whose index may be its time, or a Dataset with its coordinates."""
    if is_xarray(inputs):
        inputs = {name: variable.to_numpy() for name, variable in list_variables(inputs).items()}
    if not isinstance(inputs, Mapping) and not hasattr(inputs, "columns"):
        raise SceneError(
            "inputs must be a mapping, a DataFrame or a Dataset with the column 'time' and a column for each input, "
            f"not {format_value(inputs)}"
        )
    names = inputs.columns if hasattr(inputs, "columns") else inputs
    columns = {str(name): inputs[name] for name in names}
    if "time" not in columns and getattr(getattr(inputs, "index", None), "name", None) == "time":
        columns = {"time": inputs.index} | columns
    rows = {name: tuple(to_finite_row(f"inputs: {name}", column).tolist()) for name, column in columns.items()}
    if rows and not any(rows.values()):
        raise SceneError("inputs has no rows: give at least one time, and the values at it")
    return rows


def to_finite_row(name: str, numbers: "ArrayLike") -> "np.ndarray":
    """Return numbers as an array (n,) of floats; raise SceneError unless they are a row of finite numbers."""
    import numpy as np

    try:
        row = np.atleast_1d(to_array(numbers))
    except (OverflowError, TypeError, ValueError):
        raise SceneError(f"{name} must be a row of numbers, not {format_value(numbers)}") from None
    if has_time_stamps(row):
        raise SceneError(f"{name}: {SUBTRACT_FIRST}")
    if row.ndim != 1 or row.dtype.kind not in "fiub":
        raise SceneError(f"{name} must be a row of numbers, not {format_value(numbers)}")
    row = row.astype(float)
    if not np.isfinite(row).all():
        index = int(np.argmin(np.isfinite(row)))
        raise SceneError(f"{name} holds {row[index]} at index {index}: give finite numbers")
    return row


@check_arguments(
    source=PATH,
    parameters=SOME_NAMES,
    values=SETTINGS,
    start=FINITE,
    stop=FINITE,
    times=INCREASING_ROW,
    outputs=SOME_NAMES,
    rtol=POSITIVE,
    progress=PROGRESS,
)
@with_progress_bar
def sensitivity(
    source: "str | Path",
    parameters: Sequence[str],
    values: Mapping[str, float | str] | None = None,
    *,
    start: float | None = None,
    stop: float | None = None,
    times: "ArrayLike | None" = None,
    outputs: Sequence[str] | None = None,
    rtol: float | None = None,
    inputs: "Mapping[str, ArrayLike] | pandas.DataFrame | xarray.Dataset | None" = None,
    progress: Progress | bool | None = None,
) -> "SensitivityResult":
    """Run a model with the derivatives of its outputs by parameters, through stick, slip and other events.

    Between events the variational equations are integrated, with the directional derivatives of the FMU; at an event
    the derivatives jump, because the time of the event depends on the parameters.

    Parameters
    ----------
    source : str or path
        The name of a model, the path of an FMU, or the name or path of a scene. Of a Python FMU of this project the
        native FMU of the same model is run. Any other FMU needs model exchange with directional derivatives.
    parameters : sequence of str
        Parameters, start values such as ``x0``, or inputs. Of an input with a signal in `inputs`, the parameter is the
        factor of the signal.
    values : mapping, optional
        Parameters and start values by name, in the units of the FMU; enumerations by label or number.
    start, stop : float, optional
        Start and stop time in s; by default those of the source.
    times : array_like, optional
        Increasing times (n,) in s to record; by default 1001. The run stops at the last one unless `stop` is given.
    outputs : sequence of str, optional
        Real outputs and states to record; by default all Real outputs.
    rtol : float, optional
        Relative tolerance of the integration; 1e-11 by default.
    inputs : mapping, DataFrame or Dataset, optional
        Input signals as in `simulate`.
    progress : callable or False, optional
        Receives the progress from 0 to 1. By default a terminal or a notebook shows a bar after two seconds; False
        switches it off.

    Returns
    -------
    SensitivityResult
        ``s.t``, ``s["x"]``, ``s["x", "k"]`` for dx/dk, and the events with the derivatives of their times. ``remarks``
        names the times at which no derivative exists.

    Raises
    ------
    SceneError
        If the source or an argument is not valid.
    HarnessError
        If the FMU has no directional derivatives, or the run fails.

    Examples
    --------
    >>> s = sensitivity("stickslip", ["mu_s", "k"], stop=8.0)  # doctest: +SKIP
    >>> s["x", "k"][-1]  # doctest: +SKIP
    """
    from ..simulation.resolve import resolve
    from ..studies.sensitivity.study import compute_sensitivity

    spec = resolve(source)
    spec = replace(
        spec,
        values={**spec.values, **(values or {})},
        inputs=spec.inputs if inputs is None else read_input_columns(inputs),
        start=spec.start if start is None else start,
        stop=spec.stop if stop is None else stop,
        times=spec.times if times is None else times,  # type: ignore[arg-type] # an array by its rule
        outputs=() if outputs is None else tuple(outputs),
        tolerance=rtol,
    )
    return compute_sensitivity(spec, parameters, reporter(progress))


@check_arguments(source=PATH)
def describe(source: "str | Path") -> "FmuDescription":
    """List the variables of a model or an FMU: units, start values, ranges, friction laws, methods and defaults.

    Parameters
    ----------
    source : str or path
        The name of a model, or the path of any FMU, FMI 2.0 or 3.0. The FMU is read, not run.

    Returns
    -------
    FmuDescription
        Variables, laws, methods and defaults; printed as tables.

    Raises
    ------
    SceneError
        If there is no such model or file.
    HarnessError
        If the file is not an FMU.

    Examples
    --------
    >>> describe("stickslip").methods  # doctest: +SKIP
    ('exact', 'ode23', 'ode45', 'dop853', 'rodas')
    """
    from ..scenes.fmu_files import find_fmu
    from ..simulation.fmu_variables import describe_fmu

    return describe_fmu(find_fmu(str(source)))


@check_arguments(folder=PATH)
def load_result(folder: "str | Path") -> "Result":
    """Read a stored result.

    Parameters
    ----------
    folder : path
        A result folder, as a command or `save` writes it.

    Returns
    -------
    Result
        The same class as from the function of Python: a `Trajectory`, `DecayResult`, `FitResult`, `Comparison` or
        `SweepResult`; for other studies the class of their results.

    Raises
    ------
    SceneError
        If the folder holds no result, or it is damaged.
    """
    from ..results.loading import load

    return load(Path(folder))
