"""The public Python API: functions that take plain arguments and return results.

Each function imports what it needs when it is called, so that importing `harness` stays fast.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import HarnessError, SceneError, format_value, optional, unknown_name_message, unknown_source_message

if TYPE_CHECKING:
    import pandas
    import xarray
    from numpy.typing import ArrayLike

    from .analyses.decay.identification import DecayIdentification
    from .analyses.fit.parameter_fit import ParameterFit
    from .records.record import Record
    from .records.table_files import Table
    from .running.run_spec import RunSpec
    from .running.trajectory import Trajectory
    from .studies.compare.difference import Comparison

Progress = Callable[[float], None]  # takes the finished share, from 0 to 1

INTERFACES = {"CoSimulation": False, "ModelExchange": True}
QUIET: Progress = lambda share: None  # noqa: E731 - as short as what it does


def simulate(
    source: "str | Path",
    values: Mapping[str, float | str] | None = None,
    *,
    stop: float | None = None,
    interval: float | None = None,
    outputs: Sequence[str] | None = None,
    method: str | int | None = None,
    rtol: float | None = None,
    interface: str | None = None,
    inputs: "Mapping[str, ArrayLike] | pandas.DataFrame | None" = None,
    timeout: float | None = None,
    progress: Progress | None = None,
) -> "Trajectory":
    """Run a model, a scene, an FMU or a stored result once.

    Parameters
    ----------
    source : str or path
        The name of a model (``"stickslip"``), the path of an FMU, the name or path of a scene (``"my_scene.toml"``),
        or the folder of a stored result, whose run is repeated.
    values : mapping, optional
        Parameters and start values by name, in the units of the FMU; enumerations by label or number.
    stop : float, optional
        Stop time in s; by default that of the source.
    interval : float, optional
        Time between two recorded points in s. By default 4096 intervals and every step and event of the solver are
        recorded.
    outputs : sequence of str, optional
        Variables to record; by default all outputs of a model or FMU, and those that a scene names.
    method : str or int, optional
        Integration method of an FMU of this project, as ``"exact"`` or ``"dop853"``.
    rtol : float, optional
        Relative tolerance: of the solver in an FMU of this project. Any other FMU is run with ever shorter
        communication steps until two results agree to this tolerance.
    interface : {"CoSimulation", "ModelExchange"}, optional
        Interface to use where the FMU offers both; co-simulation by default.
    inputs : mapping or DataFrame, optional
        Input signals: the column ``time`` in s and a column for each input. Values between two rows are interpolated;
        a time that occurs twice is a jump. In co-simulation an input is constant within a communication step, at its
        value in the middle of the step.
    timeout : float, optional
        Seconds allowed for one call of an FMU that is not of this project; 60 by default.
    progress : callable, optional
        Called with the finished share of the run.

    Returns
    -------
    Trajectory
        Time, columns by name, units, events, statistics and the parameters in force.

    Raises
    ------
    SceneError
        If the source or an argument is not valid.
    HarnessError
        If the run fails; the message is that of the FMU.

    Examples
    --------
    >>> sled = simulate("stickslip", {"mu_s": 0.8}, stop=8.0)  # doctest: +SKIP
    >>> sled["x"][-1]  # doctest: +SKIP
    """
    from .running import runner

    spec = run_spec(source)
    if values:
        spec = replace(spec, values={**spec.values, **values})
    if inputs is not None:
        spec = replace(spec, inputs={str(name): column for name, column in table_of(inputs).items()})
    spec = with_options(spec, stop, interval, outputs, method, rtol, interface, timeout)
    if interval is not None and spec.inputs:
        spec = replace(spec, grid=fine_step(spec, interval))
    done = runner.run(spec, progress or QUIET)
    if done.failure:
        raise HarnessError(done.failure)
    return done if interval is None else at_interval(done, interval)


def compare(
    a: "str | Path | Trajectory",
    b: "str | Path | Trajectory",
    *,
    stop: float | None = None,
    rtol: float | None = None,
    interface: str | None = None,
    timeout: float | None = None,
    progress: Progress | None = None,
) -> "Comparison":
    """Compare two trajectories variable by variable and event by event.

    Parameters
    ----------
    a, b : Trajectory, str or path
        Trajectories, result folders, files (fmpy, OpenModelica, Dymola, any table with the time in its first column),
        FMUs or scenes. What has to be run is run to the times of the other one.
    stop, rtol, interface, timeout
        Options for FMUs that have to be run, as in `simulate`.
    progress : callable, optional
        Called with the finished share.

    Returns
    -------
    Comparison
        The largest and root-mean-square difference of each variable, and the matched events.

    Raises
    ------
    HarnessError
        If the two have no variable or no time in common.
    """
    from .running.run_spec import RunSpec
    from .running.signals import signals_from_trajectory
    from .running.trajectory import Trajectory
    from .studies.compare.difference import compare as difference
    from .studies.compare.trajectory_sources import display_names, load_both

    how = with_options(RunSpec(Path()), stop, None, None, None, None, interface, timeout)
    if rtol is not None:
        how = replace(how, tolerance=rtol)
    first, second = load_both(
        tuple(signals_from_trajectory(each) if isinstance(each, Trajectory) else str(each) for each in (a, b)),
        how,
        progress or QUIET,
    )
    paths = [each for each in (a, b) if not isinstance(each, Trajectory)]
    if len(paths) == 2:
        one, two = display_names((str(a), str(b)))
        first, second = replace(first, name=one), replace(second, name=two)
    elif first.name == second.name:
        first, second = replace(first, name=f"{first.name} (a)"), replace(second, name=f"{second.name} (b)")
    return difference(first, second)


def identify_decay(
    record: "str | Path | pandas.DataFrame | Trajectory | ArrayLike",
    x: "ArrayLike | None" = None,
    *,
    unit: str | None = None,
    quantity: str | None = None,
    time: str | None = None,
    column: str | None = None,
    k: float | None = None,
    m: float | None = None,
    pendulum: bool = False,
    drag: bool = True,
    drift: bool = False,
    begin: float | None = None,
    end: float | None = None,
    rate: float | None = None,
    progress: Progress | None = None,
) -> "DecayIdentification":
    """Identify viscous damping, dry friction and quadratic drag from a free decay.

    Parameters
    ----------
    record : str, path, DataFrame, Trajectory or array_like
        A file with columns, a table, a trajectory, or the times (n,) in s of the samples `x`.
    x : array_like, optional
        The samples (n,), if `record` holds their times.
    unit : str, optional
        Unit of the samples, as ``"mm"``, ``"deg/s"`` or ``"g"``; required for arrays, otherwise that of the heading.
    quantity : {"position", "velocity", "acceleration"}, optional
        What was measured, if neither its unit nor its name says so.
    time, column : str, optional
        Headings of the time and of the samples, if the table has several.
    k, m : float, optional
        Stiffness in N/m or mass in kg (N.m/rad or kg.m2 for a rotation), one of them: gives forces in N.
    pendulum : bool
        The restoring torque is k sin(theta).
    drag : bool
        Also try laws with quadratic drag.
    drift : bool
        Let the rest position drift at a constant rate.
    begin, end : float, optional
        The part of the record to use, in s.
    rate : float, optional
        Sampling rate in Hz, which replaces the times of a file or table.
    progress : callable, optional
        Called with the finished share of the fit.

    Returns
    -------
    DecayIdentification
        Estimates with 95 % intervals (`estimates`), the fitted laws and remarks.

    Raises
    ------
    SceneError
        If the record cannot be read.
    HarnessError
        If the record is not the free decay of one oscillator.

    References
    ----------
    J. W. Liang, B. F. Feeny, Nonlinear Dynamics 16 (1998) 337-347.
    """
    from math import inf

    from .analyses.decay.estimates import KnownParameters
    from .analyses.decay.identification import fit_decay
    from .records.columns import ColumnOptions, read_record

    if k is not None and m is not None:
        raise SceneError("k and m are both given: leave one out, because the frequency determines it")
    if rate is not None and not 0 < rate < inf:
        raise SceneError(f"rate is {rate!r}: it must be a positive number of samples per second")
    columns = ColumnOptions(
        time=time,
        position=column,
        quantity=quantity,
        unit=unit,
        rate=rate,
        begin=-inf if begin is None else begin,
        end=inf if end is None else end,
    )
    if isinstance(record, str | Path):
        source = str(record)
        loaded = read_record(source, columns, Path(source).stem)
    else:
        loaded = record_from(record, x, columns)
    return fit_decay(loaded, KnownParameters(k, m, pendulum), drag, drift, progress or QUIET)


def fit(
    source: "str | Path",
    records: Any,
    free: "Sequence[str] | Mapping[str, tuple[float, float] | None]",
    *,
    observe: "Sequence[str] | Mapping[str, str]",
    inputs: "Sequence[str] | Mapping[str, str]" = (),
    fixed: Mapping[str, float | str] | None = None,
    sigma: Mapping[str, float] | None = None,
    start: "Mapping[str, float] | ParameterFit | None" = None,
    each: Sequence[str] = (),
    robust: bool = False,
    time: str | None = None,
    rate: float | None = None,
    begin: float | None = None,
    end: float | None = None,
    timeout: float = 10.0,
    progress: Progress | None = None,
) -> "ParameterFit":
    """Fit parameters of an FMU to measured records.

    The first sample of a record is the start of the run: the start values of the FMU apply there, and can be free.

    Parameters
    ----------
    source : str or path
        The name of a model or the path of an FMU for co-simulation, FMI 2.0 or 3.0.
    records : path, DataFrame, Trajectory or sequence of these
        Measured records. Units in headings, as in ``x [mm]``, are converted to those of the FMU; a DataFrame may have
        them in ``attrs["units"]``.
    free : sequence or mapping
        Parameters to fit, with the range to search, or None for a factor of 4 about the start value of the FMU.
        ``offset(x)`` and ``gain(x)`` are unknowns of the sensor of the output ``x``.
    observe, inputs : sequence or mapping
        Measured outputs and driven inputs of the FMU, with the headings of their columns.
    fixed : mapping, optional
        Values of other parameters.
    sigma : mapping, optional
        Known standard deviations of the noise by output, in the units of the FMU; by default the scatter of
        neighbouring samples.
    start : mapping or ParameterFit, optional
        Values to start from, in addition to those of the search.
    each : sequence of str
        Parameters with a value of their own for each record.
    robust : bool
        Whether residuals beyond three times the noise count linearly.
    time, rate, begin, end
        Time column, sampling rate in Hz that replaces it, and the time range in s.
    timeout : float
        Seconds of processor time that one run may take.
    progress : callable, optional
        Called with the finished share.

    Returns
    -------
    ParameterFit
        Values with 95 % intervals by profile likelihood, combinations of parameters that the records do not determine,
        residuals and remarks.

    Raises
    ------
    SceneError
        If an argument or a record is not valid.
    HarnessError
        If the FMU cannot be run, or the records show no motion.

    Examples
    --------
    >>> found = fit("stickslip", "pull.csv", ["mu_s", "mu_d", "k"], observe={"x": "laser"})  # doctest: +SKIP
    >>> found["mu_s"].low, found["mu_s"].value, found["mu_s"].high  # doctest: +SKIP
    """
    from math import inf

    from .analyses.fit.parameter_fit import ParameterFit
    from .records.columns import ColumnOptions
    from .records.signal_table import parse_signals
    from .scenes.fmu_files import check_built, find_fmu
    from .studies.fit import study
    from .studies.fit.request import FitRequest, resolve_request

    fmu = find_fmu(str(source))
    check_built(fmu, SceneError)
    names = [free] if isinstance(free, str) else free
    values = start.values if isinstance(start, ParameterFit) else start or {}
    request = FitRequest(
        fmu=fmu,
        free=dict(names) if isinstance(names, Mapping) else dict.fromkeys(names),
        observe=headings_of(observe),
        inputs=headings_of(inputs),
        fixed=fixed or {},
        sigma=sigma or {},
        start=values,
        each=tuple(each),
        robust=robust,
        timeout=timeout,
        columns=ColumnOptions(
            time=time, rate=rate, begin=-inf if begin is None else begin, end=inf if end is None else end
        ),
    )
    resolved = resolve_request(request)
    tables = [
        study.read_file(resolved, str(each))
        if isinstance(each, str | Path)
        else parse_signals(signal_table_of(each), resolved.sources, request.columns, "the record")
        for each in (records if isinstance(records, list | tuple) else [records])
    ]
    return study.fit_tables(resolved, tables, progress or QUIET)


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
        The values of each varied parameter; every combination is run. With `samples`, the lower and the upper bound of
        each.
    values : mapping, optional
        Parameters that all runs share.
    samples : int, optional
        Number of points of a Latin hypercube, in place of a grid.
    seed : int
        Seed of the Latin hypercube.
    measures : sequence of str
        What to measure, as ``"final"``, ``"period"`` or ``"steps"``; the final values by default.
    stop, rtol, interface, timeout
        As in `simulate`; `rtol` is for FMUs that are not of this project.
    workers : int, optional
        Number of worker processes; by default all runs are done in this process. With workers, a script needs the
        usual ``if __name__ == "__main__":``.
    scheduler : str, optional
        Address of a Dask cluster, as ``"tcp://host:8786"``.
    folder : path, optional
        Keep the files of the sweep in this folder; an interrupted sweep continues from there.
    progress : callable, optional
        Called with the finished share.

    Returns
    -------
    xarray.Dataset
        A dimension for each varied parameter (``run`` for samples), a variable for each measure, and ``error``, the
        reason why a run failed, which is empty if it did not.

    Raises
    ------
    HarnessError
        If xarray is not installed or no run can be done.
    """
    from contextlib import nullcontext

    import numpy as np

    from .process.temporary_directory import temporary_directory
    from .studies.sweep import result_files

    library = optional("xarray", "a sweep", "sweep")
    if not grid:
        raise SceneError("grid is empty: name at least one parameter and its values, as in {'mu_d': [0.3, 0.6]}")
    options: dict[str, Any] = {"stop": stop, "tolerance": rtol, "exchange": exchange_of(interface), "timeout": timeout}
    axes = []
    for name, column in grid.items():
        try:
            numbers = [repr(each) for each in np.ravel(np.asarray(column, dtype=float)).tolist()]
        except (TypeError, ValueError):
            raise SceneError(f"grid: {name} = {format_value(column)} must be numbers") from None
        if not numbers:
            raise SceneError(f"grid: {name} has no values: give at least one")
        if samples is not None and len(numbers) != 2:
            raise SceneError(f"{name} has {len(numbers)} values: with samples give its lower and its upper bound")
        single = f"{numbers[0]}:{numbers[0]}:1" if len(numbers) == 1 else ",".join(numbers)
        axes.append(f"{name}={single if samples is None else ':'.join(numbers)}")
    request = result_files.SweepRequest(
        model=str(source),
        vary=tuple(axes),
        values=tuple(f"{name}={value}" for name, value in (values or {}).items()),
        random=samples,
        seed=seed,
        measures=tuple(measures),
        name=None,
        options={name: value for name, value in options.items() if value is not None},
    )
    with temporary_directory("sweep-") if folder is None else nullcontext(Path(folder)) as directory:
        result = result_files.run_sweep(request, directory, scheduler, workers, progress or QUIET)
        with library.open_dataset(result.folder / "sweep.nc") as data:
            loaded: xarray.Dataset = data.load()
    return loaded


def load_result(folder: "str | Path") -> "Trajectory | xarray.Dataset | dict[str, Any]":
    """Read a stored result.

    Parameters
    ----------
    folder : path
        A result folder, as a command or `Trajectory.save` writes it.

    Returns
    -------
    Trajectory, xarray.Dataset or dict
        The trajectory of a run, the dataset of a sweep, or the numbers of a decay, a fit or a comparison.

    Raises
    ------
    SceneError
        If the folder holds no result.
    """
    import json

    path = Path(folder)
    if (path / "sweep.nc").is_file():
        library = optional("xarray", "to read a sweep", "sweep")
        with library.open_dataset(path / "sweep.nc") as data:
            loaded: xarray.Dataset = data.load()
        return loaded
    for name in ("decay.json", "fit.json", "compare.json"):
        if (path / name).is_file():
            numbers: dict[str, Any] = json.loads((path / name).read_text(encoding="utf-8"))
            return numbers
    if not (path / "trajectory.csv").is_file():
        raise SceneError(f"{folder} holds no result: name a folder with trajectory.csv, sweep.nc or decay.json")
    return stored_run(path)


# ---- what the functions above share


def run_spec(source: "str | Path") -> "RunSpec":
    """Return the run that a source describes."""
    from .running.run_spec import DEFAULT_EQUAL_STEPS, RunSpec, spec_from_scene
    from .scenes.fmu_files import check_built, find_fmu, list_models
    from .scenes.scene import load_scene

    path, name = Path(source), str(source)
    if path.suffix in (".fmu", ".py") or (name in list_models() and not path.is_dir()):
        fmu = find_fmu(name)
        check_built(fmu)
        return RunSpec(fmu, equal_steps=DEFAULT_EQUAL_STEPS)
    if path.is_dir():
        return stored_spec(path)
    try:
        scene = load_scene(source)
    except SceneError as error:
        if path.suffix == ".toml":
            raise
        from .scenes.scene import shipped_scenes

        names = sorted(list_models() | {file.stem for file in shipped_scenes()})
        other = ", or the path of an FMU, a scene or a result"
        raise SceneError(unknown_source_message("model or scene", name, names, other)) from error
    check_built(scene.file)
    return spec_from_scene(scene)


def stored_spec(folder: Path) -> "RunSpec":
    """Return the run that made a stored result; HarnessError if its files have changed since."""
    from .results.provenance import load_verified_provenance
    from .running.run_spec import spec_from_provenance, spec_from_scene
    from .scenes.scene import scene_from_provenance

    scene = load_verified_provenance(folder)["scene"] or {}
    if "title" in scene:
        return spec_from_scene(scene_from_provenance(scene))
    try:
        return spec_from_provenance(scene)
    except SceneError as error:
        raise SceneError(f"{folder} does not hold the result of one run ({error}): name another folder") from None


def exchange_of(interface: str | None) -> bool | None:
    """Whether an interface is model exchange; None if none is named."""
    if interface is None:
        return None
    if interface not in INTERFACES:
        raise SceneError(unknown_name_message("interface", interface, INTERFACES))
    return INTERFACES[interface]


def with_options(
    spec: "RunSpec",
    stop: float | None,
    interval: float | None,
    outputs: Sequence[str] | None,
    method: str | int | None,
    rtol: float | None,
    interface: str | None,
    timeout: float | None,
) -> "RunSpec":
    """Return a run with the options that are not None."""
    from .running.description import read_description
    from .running.runner import exposes_solver_steps
    from .scenes.schema import is_number

    values = dict(spec.values)
    if method is not None:
        values["solver.method"] = method
    tolerance = spec.tolerance
    if rtol is not None and spec.fmu.name and exposes_solver_steps(read_description(spec.fmu, spec.lenient)):
        values["solver.rtol"] = rtol
    elif rtol is not None:
        tolerance = rtol
    for name, number in (("interval", interval), ("timeout", timeout), ("rtol", rtol)):
        if number is not None and not (is_number(number) and number > 0):
            raise SceneError(f"{name} = {format_value(number)} must be a finite number above 0")
    if stop is not None and not is_number(stop):
        raise SceneError(f"stop = {format_value(stop)} must be a finite number of seconds")
    if isinstance(outputs, str):
        outputs = (outputs,)
    exchange = exchange_of(interface)
    return replace(
        spec,
        values=values,
        tolerance=tolerance,
        stop=spec.stop if stop is None else float(stop),
        grid=spec.grid if interval is None else float(interval),
        follow=True if interval is not None else spec.follow,
        outputs=spec.outputs if outputs is None else tuple(outputs),
        exchange=spec.exchange if exchange is None else exchange,
        timeout=spec.timeout if timeout is None else float(timeout),
    )


def fine_step(spec: "RunSpec", interval: float) -> float:
    """Return a communication step in s for input signals: a whole part of the interval, at most 1/4096 of the run."""
    from math import ceil

    from .running.description import read_description, resolve_time_span
    from .running.run_spec import DEFAULT_EQUAL_STEPS

    start, stop = resolve_time_span(spec, read_description(spec.fmu, spec.lenient))
    return interval / ceil(interval * DEFAULT_EQUAL_STEPS / (stop - start))


def at_interval(run: "Trajectory", interval: float) -> "Trajectory":
    """Keep the points of a run at multiples of an interval in s, and its last one."""
    import numpy as np

    start = run.time[0]
    near = 1e-9 * interval
    keep = np.abs(start + np.rint((run.time - start) / interval) * interval - run.time) <= near
    keep[-1] = True
    return replace(run, time=run.time[keep], columns={name: column[keep] for name, column in run.columns.items()})


def table_of(inputs: Any) -> dict[str, list[float]]:
    """Return the columns of a mapping or a DataFrame; the index of a DataFrame may be its time."""
    import numpy as np

    if not isinstance(inputs, Mapping) and not hasattr(inputs, "columns"):
        raise SceneError("inputs must be a mapping or a DataFrame with the column 'time' and one for each input")
    names = inputs.columns if hasattr(inputs, "columns") else inputs
    columns = {str(name): np.atleast_1d(np.asarray(inputs[name])) for name in names}
    if "time" not in columns and getattr(getattr(inputs, "index", None), "name", None) == "time":
        columns = {"time": np.asarray(inputs.index)} | columns
    for name, column in columns.items():
        if column.ndim != 1 or column.dtype.kind not in "fiub":
            raise SceneError(f"inputs: {name} must be a row of numbers")
    return {name: column.astype(float).tolist() for name, column in columns.items()}


def record_from(source: Any, x: Any, columns: Any) -> "Record":
    """Return the record in a DataFrame, a trajectory or two arrays."""
    import numpy as np

    from .records.columns import parse_record
    from .records.table_files import Table
    from .results.files import column_heading
    from .running.trajectory import Trajectory

    name = "the record"
    if isinstance(source, Trajectory):
        heads = {"time": "t [s]"} | {each: column_heading(each, source.units[each]) for each in source.columns}
        table, name = {"time": source.time, **source.columns}, source.spec.model
        if columns.position is None and columns.quantity is None:
            if "position" not in source.spec.motion_outputs:
                raise SceneError(f"{name} records no position: add it to the outputs, or name a column")
            columns = replace(columns, position=source.spec.motion_outputs["position"])
    elif hasattr(source, "columns"):
        frame = source if source.index.name is None else source.reset_index()
        units = frame.attrs.get("units", {})
        table = {str(each): np.asarray(frame[each]) for each in frame.columns}
        heads = {each: column_heading(each, units.get(each, "")) for each in table}
    else:
        if x is None:
            raise SceneError("x is missing: identify_decay takes a file, a table, or times and samples, as in (t, x)")
        if columns.unit is None:
            raise SceneError("unit is missing: name the unit of the samples, as in unit='mm'")
        table, heads = {"t": np.asarray(source), "x": np.asarray(x)}, {"t": "t [s]", "x": "signal"}
        columns = replace(columns, position="signal")
    cells = []
    for each, column in table.items():
        if column.ndim != 1 or len(column) != len(next(iter(table.values()))):
            raise SceneError(f"{each} has the shape {column.shape}: times and samples must be equally long rows")
        cells.append(column.astype(float) if column.dtype.kind in "fiub" else [str(cell) for cell in column])
    return parse_record(Table(name, tuple(heads.values()), tuple(cells)), columns, name)


def headings_of(signals: Any) -> dict[str, str]:
    """Return the heading of each signal; its name if there is none."""
    if isinstance(signals, Mapping):
        return {str(name): str(heading) for name, heading in signals.items()}
    return {str(name): str(name) for name in ([signals] if isinstance(signals, str) else signals)}


def signal_table_of(source: Any) -> "Table":
    """Return the table of a trajectory or a DataFrame."""
    import numpy as np

    from .records.table_files import Table
    from .results.files import column_heading
    from .running.trajectory import Trajectory

    if isinstance(source, Trajectory):
        columns, units = {"t": source.time, **source.columns}, {"t": "s", **source.units}
    elif hasattr(source, "columns"):
        frame = source if source.index.name is None else source.reset_index()
        columns, units = {str(name): np.asarray(frame[name]) for name in frame.columns}, frame.attrs.get("units", {})
    else:
        raise SceneError("records must be files, DataFrames or trajectories")
    heads = tuple(column_heading(name, units.get(name, "")) for name in columns)
    return Table("the record", heads, tuple(np.asarray(column, dtype=float) for column in columns.values()))


def stored_run(folder: Path) -> "Trajectory":
    """Read the run in a result folder."""
    import numpy as np

    from .records.columns import read_numeric
    from .results.provenance import load_provenance
    from .running.run_spec import RunSpec
    from .running.trajectory import SolverSteps, Trajectory
    from .scenes.schema import is_text
    from .studies.compare.trajectory_files import read_trajectory

    found, origin = read_trajectory(folder), load_provenance(folder)
    parameters = {name: each["value"] for name, each in origin.get("parameters", {}).items()}
    units = found.units | {name: each["unit"] for name, each in origin.get("parameters", {}).items()}
    scene = origin.get("scene") or {}
    fmu = Path(str(next(filter(is_text, (scene.get("fmu"), scene.get("file"))), f"{folder.name}.fmu")))
    steps = None
    if (folder / "steps.csv").is_file():
        ends, sizes, rejected = read_numeric(folder / "steps.csv")[1].T
        steps = SolverSteps(np.append(found.time[0], ends), sizes, rejected.astype(int))
    values = scene.get("values")
    spec = RunSpec(fmu, outputs=tuple(found.columns), values=values if isinstance(values, dict) else {})
    names = {name: name for name in found.columns}
    return Trajectory(spec, found.time, found.columns, units, names, parameters, steps, found.events)
