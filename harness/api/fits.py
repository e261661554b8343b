"""Parameters of an FMU from measured records, from Python: `fit`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import (
    FINITE,
    FLAG,
    HEADINGS,
    NAMES,
    NUMBERS,
    PATH,
    PATHS,
    POSITIVE,
    POSITIVES,
    PROGRESS,
    RANGES,
    SETTINGS,
    TEXT,
    Progress,
    Rule,
    check_arguments,
)
from ..errors import SceneError
from .options import check_time_range, reporter, with_progress_bar
from .tables import RECORDS, SIGNAL, UNNAMED, to_record

if TYPE_CHECKING:
    from ..analyses.fit.parameter_fit import ParameterFit
    from ..records.record import Record
    from ..studies.fit.result import FitResult


def starts(value: Any) -> Any:
    """Return values to start from: a mapping to numbers, an earlier fit, or the folder of its result."""
    from ..analyses.fit.parameter_fit import ParameterFit

    if isinstance(value, ParameterFit):
        return value
    return NUMBERS.convert(value) if isinstance(value, Mapping) else PATH.convert(value)


STARTS = Rule("a mapping from names to numbers, an earlier fit or the folder of its result", starts)


@check_arguments(
    source=PATH,
    records=RECORDS,
    free=RANGES,
    observe=HEADINGS,
    inputs=HEADINGS,
    values=SETTINGS,
    sigma=POSITIVES,
    start=STARTS,
    each=NAMES,
    against=PATHS,
    validate=RECORDS,
    robust=FLAG,
    time=TEXT,
    rate=POSITIVE,
    begin=FINITE,
    end=FINITE,
    timeout=POSITIVE,
    progress=PROGRESS,
)
@with_progress_bar
def fit(
    source: "str | Path",
    records: Any,
    free: "Sequence[str] | Mapping[str, tuple[float, float] | None]",
    *,
    observe: "Sequence[str] | Mapping[str, str]" = (),
    inputs: "Sequence[str] | Mapping[str, str]" = (),
    values: Mapping[str, float | str] | None = None,
    sigma: Mapping[str, float] | None = None,
    start: "Mapping[str, float] | ParameterFit | str | Path | None" = None,
    each: Sequence[str] = (),
    against: "str | Path | Sequence[str | Path]" = (),
    validate: Any = (),
    robust: bool = False,
    time: str | None = None,
    rate: float | None = None,
    begin: float | None = None,
    end: float | None = None,
    timeout: float = 10.0,
    progress: Progress | bool | None = None,
) -> "FitResult":
    """Fit parameters of an FMU to measured records.

    The first sample of a record is the start of the run: the start values of the FMU apply there, and can be free.

    Parameters
    ----------
    source : str or path
        The name of a model or the path of an FMU for co-simulation, FMI 2.0 or 3.0.
    records : path, DataFrame, Series, Dataset, mapping, Trajectory, tuple, array or sequence of these
        Measured records: files, tables, Series over time, trajectories, times and values as in ``(t, x)``, or values
        with their `rate`. Values without a name are those of the observed output. Units in headings,
        as in ``x [mm]``, are converted to those of the FMU; a DataFrame or a Series may have them in
        ``attrs["units"]``.
    free : sequence or mapping
        Parameters to fit, with the range to search, or None for a factor of 4 about the start value of the FMU; for a
        value of a table, up to 4 times the largest one of the table.
        ``offset(x)``, ``gain(x)`` and ``delay(x)`` are unknowns of the sensor of the output ``x``: its signal is gain
        times output plus offset, after the delay.
    observe, inputs : sequence or mapping
        Measured outputs and driven inputs of the FMU, with the headings of their columns. By default a column
        that is named like an output is taken, of several the position, or else the only column whose unit fits one
        output, and all columns that are named like inputs; ``notes`` states the choice.
    values : mapping, optional
        Values of other parameters.
    sigma : mapping, optional
        Known standard deviations of the noise by output, in the units of the FMU. By default they are estimated from
        the scatter of neighbouring samples.
    start : mapping, ParameterFit or path, optional
        Values to start from, in addition to those of the search. An earlier fit, or the folder of its result, gives
        the values of the parameters that are free again.
    each : sequence of str
        Parameters with a value of their own for each record.
    against : str, path or sequence of these
        Other FMUs, which are fitted to the same records and compared by the Bayesian information criterion. Each FMU
        frees and fixes those of the given names that it has; ``notes`` lists the names that it lacks.
    validate : path, DataFrame, Trajectory or sequence of these
        Records that are predicted with the fitted values, but not fitted.
    robust : bool
        Whether residuals beyond three times the noise count linearly instead of by their squares.
    time, rate, begin, end
        Time column, sampling rate in Hz that replaces it, and the time range in s.
    timeout : float
        Seconds of processor time that one run may take.
    progress : callable or False, optional
        Receives the progress from 0 to 1. By default a terminal or a notebook shows a bar after two seconds; False
        switches it off.

    Returns
    -------
    FitResult
        Values with 95 % intervals by profile likelihood, combinations of parameters that the records determine although
        they do not determine each parameter, residuals and remarks; with `against`, the other fits and the comparison.

    Raises
    ------
    SceneError
        If an argument or a record is not valid.
    HarnessError
        If the FMU cannot be run, or the records show no motion.

    Examples
    --------
    >>> result = fit("stickslip", "pull.csv", ["mu_s", "mu_d", "k"], observe={"x": "laser"})  # doctest: +SKIP
    >>> result["mu_s"].low, result["mu_s"].value, result["mu_s"].high  # doctest: +SKIP
    """
    from ..analyses.fit.parameter_fit import ParameterFit
    from ..records.columns import ColumnOptions
    from ..scenes.fmu_files import check_built, find_fmu
    from ..scenes.run_spec import RunSpec
    from ..studies.fit import study
    from ..studies.fit.request import FitRequest, choose_columns, read_fitted_values, select_starts
    from ..studies.fit.study import make_tasks

    check_time_range(time, rate, begin, end)
    fmus = [find_fmu(str(law)) for law in (source, *against)]  # type: ignore[misc] # a list by its rule
    for fmu in fmus:
        check_built(fmu, SceneError)
    ranges = dict(free)  # type: ignore[arg-type] # a mapping by its rule
    if isinstance(start, ParameterFit | str | Path):
        earlier = start.values if isinstance(start, ParameterFit) else read_fitted_values(Path(start))
        start = select_starts(earlier, ranges, each)
    request = FitRequest(
        run=RunSpec(fmus[0], values=dict(values or {}), timeout=timeout),
        against=tuple(fmus[1:]),
        free=ranges,
        observe=dict(observe),  # type: ignore[arg-type]
        inputs=dict(inputs),  # type: ignore[arg-type]
        sigma=sigma or {},
        start=start or {},
        each=tuple(each),
        robust=robust,
    )

    options = ColumnOptions(time=time, rate=rate, begin=begin, end=end)
    heading = next(iter(request.observe.values()), SIGNAL) if len(request.observe) == 1 else SIGNAL

    def load(argument: Any, name: str) -> "list[Record]":
        loaded_records = [
            study.load_existing(str(source), options)
            if isinstance(source, str | Path)
            else to_record(source, options, heading)
            for source in argument
        ]
        names = [name] if len(argument) == 1 else [f"{name} {i + 1}" for i in range(len(argument))]
        return [
            replace(record, name=record_name) if record.name == UNNAMED else record
            for record, record_name in zip(loaded_records, names, strict=True)
        ]

    fitted_records, validation_records = load(records, UNNAMED), load(validate, "the validation record")
    if not fitted_records:
        raise SceneError("records is empty: give at least one record")
    request, choices = choose_columns(request, fitted_records + validation_records)
    return study.fit_laws(make_tasks(request, choices), fitted_records, validation_records, reporter(progress))
