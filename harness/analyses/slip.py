"""Stick-slip of a sled pulled by a driver: slip times, slip period, peak speed and peak acceleration.

If the friction law has modes, a slip lasts from the event that ends a stick to the event that begins the next one.
Otherwise a slip begins when the sled becomes as fast as the driver, which is where the spring is longest:
    d/dt (x_driver - x) = v_driver - v.
At that point m da/dt = k (v_driver - v) is zero too, so the peak acceleration lies in the slip (chatter excepted).
"""

import numpy as np

from ..errors import HarnessError
from ..results.quantity import AnalysisResult, Quantity
from ..simulation.signals import check_sampling, column_of_role
from ..simulation.trajectory import Trajectory, get_parameter


def analyse(run: Trajectory) -> AnalysisResult:
    """Measure the slips of a sled.

    `slip_time` is measured only if the law has modes, the peak acceleration only if the acceleration is recorded.

    Raises
    ------
    HarnessError
        If the driver does not move, the run has fewer than two slips, or a slip has too few samples.
    """
    driver = get_parameter(run, "v_driver", "the analysis 'slip'")
    v = column_of_role(run, "velocity")
    if not driver:
        raise HarnessError("the analysis 'slip' needs a moving driver, and v_driver is 0 m/s: set it in [values]")
    relative_speed = v * np.sign(driver) - abs(driver)  # speed of the sled relative to the driver
    if run.events is not None and len(run.events.t) > 1:
        starts, durations = slips_from_modes(run.events.t, run.events.mode)
        first = "first slip"
        ends = starts[: len(durations)] + durations
    else:
        starts, durations = upward_crossings(run.time, relative_speed), np.array([])
        first = "first time as fast as the driver"
        ends = upward_crossings(run.time, -relative_speed)
        ends = ends[np.searchsorted(ends, starts[:1]).sum() :]  # ignore a slip that began before the run
    if len(starts) < 2:
        raise HarnessError(f"the analysis 'slip' needs two slips, and the run has {len(starts)}: set a later stop")
    check_sampling(run.time, starts[: len(ends)], ends, "slip")
    is_slipping = relative_speed >= 0
    quantities = [
        Quantity("slips", len(starts), "", "slips"),
        Quantity("first_slip", float(starts[0]), "s", first),
        Quantity("period", float(np.mean(np.diff(starts))), "s", "slip period"),
    ]
    if len(durations):
        quantities.append(Quantity("slip_time", float(np.mean(durations)), "s", "duration of a slip"))
    quantities.append(Quantity("peak_speed", peak_value(run.time, np.abs(v), is_slipping), "m/s", "peak speed"))
    if "acceleration" in run.motion_outputs:
        peak = peak_value(run.time, np.abs(column_of_role(run, "acceleration")), include_neighbours(is_slipping))
        quantities.append(Quantity("peak_acceleration", peak, "m/s2", "peak acceleration"))
    return AnalysisResult(tuple(quantities))


def slips_from_modes(t: np.ndarray, mode: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return start times and durations (s) of the slips, from the modes (n,) that hold from the times t (n,) on.

    A slip that the end of the run cuts short has no duration.
    """
    stick_phases = np.flatnonzero(mode == 0)
    starts = t[stick_phases[stick_phases < len(t) - 1] + 1]
    ends = t[stick_phases[stick_phases > 0]]
    ends = ends[ends > starts[0]] if len(starts) else ends
    return starts, ends - starts[: len(ends)]


def upward_crossings(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the times (m,) at which y (n,) rises through zero, by linear interpolation between samples."""
    i = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    return t[i] - y[i] * (t[i + 1] - t[i]) / (y[i + 1] - y[i])


def include_neighbours(mask: np.ndarray) -> np.ndarray:
    """Extend a mask of samples (n,) by the neighbours of each selected sample."""
    wide = mask.copy()
    wide[:-1] |= mask[1:]
    wide[1:] |= mask[:-1]
    return wide


def peak_value(t: np.ndarray, y: np.ndarray, mask: np.ndarray) -> float:
    """Return the largest y (n,) of the selected samples.

    The peak is the vertex of the parabola through the largest sample and its neighbours if these are selected too.
    """
    i = int(np.argmax(np.where(mask, y, -np.inf)))
    if not (0 < i < len(y) - 1 and mask[i - 1] and mask[i + 1]):
        return float(y[i])
    left, right = t[i] - t[i - 1], t[i + 1] - t[i]
    down, up = (y[i] - y[i - 1]) / left, (y[i + 1] - y[i]) / right
    curvature = (up - down) / (left + right)
    slope = (down * right + up * left) / (left + right)
    return float(y[i] - slope * slope / (4 * curvature)) if curvature < 0 else float(y[i])
