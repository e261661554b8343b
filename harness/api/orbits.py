"""Periodic motions from Python: `orbit` and `map_motions`."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..arguments import (
    INCREASING_ROW,
    PATH,
    POSITIVE,
    PROGRESS,
    SETTINGS,
    TEXT,
    WORKERS,
    Progress,
    check_arguments,
    mapping,
)
from ..errors import SceneError, option_text
from .options import reporter, with_progress_bar
from .runs import read_input_columns

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike

    from ..scenes.run_spec import RunSpec
    from ..studies.motion_map.result import MapResult
    from ..studies.orbit.result import OrbitResult

OVER = mapping(INCREASING_ROW, "rows of increasing numbers")
DEFAULT_VALUES, DEFAULT_GRID = 61, 21  # values of a parameter of which only the ends are given: orbit, map


@check_arguments(source=PATH, values=SETTINGS, over=OVER, section=TEXT, period=POSITIVE, progress=PROGRESS)
@with_progress_bar
def orbit(
    source: "str | Path",
    values: Mapping[str, float | str] | None = None,
    *,
    over: "Mapping[str, ArrayLike] | None" = None,
    section: str | None = None,
    inputs: "Mapping[str, ArrayLike] | None" = None,
    period: float | None = None,
    progress: Progress | bool | None = None,
) -> "OrbitResult":
    """Find the steady sliding and the periodic motions of a model, stable and unstable ones, over a parameter.

    An orbit that sticks is exact after one cycle; any other is found by Newton's method, with the derivatives of the
    motion through all events. Around steady sliding of one body, all orbits that do not stick are sought. Between the
    values of a parameter, the points are located at which motions begin, end or change their stability.

    Parameters
    ----------
    source : str or path
        The name of a model, the path of an FMU, or the name or path of a scene. Of a Python FMU of this project the
        native FMU of the same model is run.
    values : mapping, optional
        Parameters and start values by name, in the units of the FMU; enumerations by label or number.
    over : mapping, optional
        A parameter and its increasing values (n,); its two ends for 61 values.
    section : str, optional
        What motions without a force return to: the mode of a contact, where it ends to stick, or an output or a state,
        where it rises through zero. By default the end of any stick.
    inputs : mapping, optional
        Input signals of one period, as in `simulate`: the column ``"time"`` in s, from 0, and one for each input.
    period : float, optional
        Period in s of the inputs, or of forces that depend on a clock, a state in s with a constant rate. That of a
        phase angle, a state in rad with a constant rate, is known.
    progress : callable or False, optional
        Receives the progress from 0 to 1. By default a terminal or a notebook shows a bar after two seconds; False
        switches it off.

    Returns
    -------
    OrbitResult
        ``r.motions`` with period, amplitude, stability and Floquet multipliers, and ``r.points``, the special points.

    Raises
    ------
    SceneError
        If the source or an argument is not valid.
    HarnessError
        If the FMU is not native, or cannot start from given states.

    Examples
    --------
    >>> r = orbit("belt", {"c": 0.1}, over={"v_belt": (0.05, 3.4)})  # doctest: +SKIP
    >>> [(point.value, point.kind) for point in r.points]  # doctest: +SKIP
    """
    from ..studies.orbit.study import compute_orbits

    axes = {} if over is None else expand_axes(over, DEFAULT_VALUES, 1)
    name, row = next(iter(axes.items()), ("", ()))
    spec = resolve_motion(source, values, inputs)
    return compute_orbits(spec, name, [*map(float, row)], period, section or "", reporter(progress))


@check_arguments(
    source=PATH,
    over=OVER,
    values=SETTINGS,
    section=TEXT,
    period=POSITIVE,
    measure=TEXT,
    levels=INCREASING_ROW,
    workers=WORKERS,
    progress=PROGRESS,
)
@with_progress_bar
def map_motions(
    source: "str | Path",
    over: "Mapping[str, ArrayLike]",
    values: Mapping[str, float | str] | None = None,
    *,
    section: str | None = None,
    inputs: "Mapping[str, ArrayLike] | None" = None,
    period: float | None = None,
    measure: str | None = None,
    levels: "ArrayLike | None" = None,
    workers: int | None = None,
    progress: Progress | bool | None = None,
) -> "MapResult":
    """Map what the motions of a model end in over one or two parameters, with exact edges between the regions.

    Of one body that slides steadily, the map says whether steady sliding is stable, and whether a motion that has stuck
    sticks again: where both hold, the start decides. Of any other model it says what motions end in that begin at its
    start, or where those at the points beside it end, with the number of sticks in a period. Edges are found by
    bisection along the lines of the grid.

    Parameters
    ----------
    source : str or path
        As in `orbit`. Any other FMU for co-simulation that saves its states needs a section or a measure.
    values, inputs, period, progress
        As in `orbit`.
    over : mapping
        One or two parameters and their increasing values (n,); two ends for 21 values.
    section : str, optional
        As in `orbit`. Of any other FMU an output: the map says how often it rises through zero in a period.
    measure : str, optional
        A measure of `sweep` whose values are the regions, as ``"slips"``, ``"events"`` or ``"largest_x"``.
    levels : array_like, optional
        Increasing values (n,) of the measure between the regions; by default it must be a whole number.
    workers : int, optional
        Number of worker processes; by default all runs are done in this process, and by the command in one process for
        each processor.

    Returns
    -------
    MapResult
        ``m.labels`` of the points of the grid, and ``m.edges``.

    Raises
    ------
    SceneError, HarnessError
        As in `orbit`.

    Examples
    --------
    >>> m = map_motions("belt", {"v_belt": (0.3, 8), "c": (0.03, 0.6)})  # doctest: +SKIP
    >>> [edge.point for edge in m.edges if edge.above == "steady sliding"]  # doctest: +SKIP
    """
    import numpy as np

    from ..studies.motion_map.study import MapRequest, compute_map

    axes = expand_axes(over, DEFAULT_GRID, 2)
    if measure is None and levels is not None:
        raise SceneError(f"{option_text('levels')} has no effect without {option_text('measure')}: name one")
    if measure is not None and (section is not None or period is not None):
        name = option_text("period" if section is None else "section")
        raise SceneError(f"{name} has no effect with {option_text('measure')}: remove it")
    bounds = () if levels is None else tuple(np.asarray(levels, dtype=float).tolist())
    request = MapRequest(
        resolve_motion(source, values, inputs), tuple(axes), period, section or "", measure or "", bounds
    )
    return compute_map(request, tuple(axes.values()), workers, reporter(progress))


def resolve_motion(
    source: "str | Path", values: Mapping[str, float | str] | None, inputs: "Mapping[str, ArrayLike] | None"
) -> "RunSpec":
    """Return the run of a source with values and inputs."""
    from ..simulation.resolve import resolve

    spec = resolve(source)
    columns = spec.inputs if inputs is None else read_input_columns(inputs)
    return replace(spec, values={**spec.values, **(values or {})}, inputs=columns)


def expand_axes(over: "Mapping[str, ArrayLike]", count: int, max_parameters: int) -> "dict[str, np.ndarray]":
    """Return the values of each of at most `max_parameters` parameters; `count` values between two ends."""
    import numpy as np

    if not 1 <= len(over) <= max_parameters:
        number = "one" if max_parameters == 1 else "one or two"
        raise SceneError(f"over has {len(over)} parameters: give {number}, as in {{'v_belt': (0.1, 3)}}")
    axes = {name: np.asarray(row, dtype=float) for name, row in over.items()}
    for name, row in axes.items():
        if len(row) == 1:
            raise SceneError(f"over has one value of {name}: give at least its two ends")
    return {name: np.linspace(row[0], row[1], count) if len(row) == 2 else row for name, row in axes.items()}
