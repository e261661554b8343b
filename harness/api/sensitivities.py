"""Derivatives of a motion by parameters, from Python: `sensitivity`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import (
    FINITE,
    INCREASING_ROW,
    PATH,
    POSITIVE,
    PROGRESS,
    SETTINGS,
    SOME_NAMES,
    Progress,
    check_arguments,
)
from .options import reporter, with_progress_bar
from .runs import read_input_columns

if TYPE_CHECKING:
    import pandas
    import xarray
    from numpy.typing import ArrayLike

    from ..studies.sensitivity.result import SensitivityResult


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
