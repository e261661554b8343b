"""Measures of any sampled motion from Python: `measure`."""

from typing import TYPE_CHECKING

from ..arguments import TEXT, check_arguments
from ..errors import SceneError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike

    from ..analyses.motion import MotionMeasures


@check_arguments(unit=TEXT)
def measure(t: "ArrayLike", x: "ArrayLike", v: "ArrayLike | None" = None, *, unit: str = "m") -> "MotionMeasures":
    """Measure peaks, decrements, rests, slips and steps of a motion, such as the arrays of your own solver.

    Parameters
    ----------
    t : array_like
        Times (n,) in s, which do not fall.
    x : array_like
        Positions (n,).
    v : array_like, optional
        Velocities (n,); by default the differences of the positions, which cannot show whether a body rests exactly.
    unit : str
        Unit of the positions.

    Returns
    -------
    MotionMeasures
        The turning points, the rests, and a table of numbers; `print` shows it.

    Raises
    ------
    SceneError
        If an array is not a row of finite numbers of the same length, or nothing moves.

    Examples
    --------
    >>> from math import pi
    >>> import numpy as np
    >>> t = np.linspace(0.1, 2.1, 201)
    >>> measure(t, np.cos(2.0 * pi * t), -2.0 * pi * np.sin(2.0 * pi * t))["turning_points"]
    4
    """
    import numpy as np

    from ..analyses.motion import measure_motion

    times, positions = read_row("t", t), read_row("x", x)
    velocities = None if v is None else read_row("v", v)
    for name, row in (("x", positions), ("v", velocities)):
        if row is not None and len(row) != len(times):
            raise SceneError(f"{name} has {len(row)} values and t has {len(times)}: give arrays of the same length")
    if (np.diff(times) < 0).any():
        raise SceneError("t falls: sort the samples by time")
    last = np.append(np.diff(times) > 0, True)  # of several samples of one time
    times, positions = times[last], positions[last]
    if len(times) < 3:
        raise SceneError(f"t has {len(times)} different times: give at least 3 samples")
    velocities = np.gradient(positions, times) if velocities is None else velocities[last]
    if not velocities.any():
        raise SceneError("nothing moves: all velocities are 0")
    return measure_motion(times, positions, velocities, unit)


def read_row(name: str, values: "ArrayLike") -> "np.ndarray":
    """Return a row of finite numbers; raise SceneError if the values are none."""
    import numpy as np

    try:
        row = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{name} must be a row of finite numbers") from None
    if row.ndim != 1 or not np.isfinite(row).all():
        raise SceneError(f"{name} must be a row of finite numbers")
    return row
