"""Stick-slip of a sled behind its driver: when it slips, how often, how fast.

Where the friction law knows modes, a slip lasts from the event that ends a stick to the one that begins the next.
Otherwise it begins where the sled becomes as fast as the driver, which is where the spring is at its longest:
    d/dt (x_driver - x) = v_driver - v.
There too m da/dt = k (v_driver - v) is zero, so that the peak acceleration lies in the slip, apart from any chatter.
"""

import numpy as np

from ..errors import HarnessError
from ..results.quantity import AnalysisResult, Quantity
from ..running.trajectory import Trajectory
from . import sample_density


def analyse(run: Trajectory) -> AnalysisResult:
    """The slips of a sled, their `slip_time` where modes show it, and the peak acceleration where that is recorded;
    HarnessError with fewer than two, or too few samples in one."""
    driver = run.get_parameter("v_driver", "the analysis 'slip'")
    v = run.column_of_role("velocity")
    if not driver:
        raise HarnessError("the analysis 'slip' needs a driver that moves, and v_driver is 0 m/s: set it in [values]")
    ahead = v * np.sign(driver) - abs(driver)  # of the driver
    if run.events is not None and len(run.events.t) > 1:
        starts, durations = slips_from_modes(run.events.t, run.events.mode)
        ends = starts[: len(durations)] + durations
    else:
        starts, durations = upward_crossings(run.time, ahead), np.array([])
        ends = upward_crossings(run.time, -ahead)
        ends = ends[np.searchsorted(ends, starts[:1]).sum() :]  # a slip that was under way is no slip that started
    if len(starts) < 2:
        raise HarnessError(f"the analysis 'slip' needs two slips, and the run has {len(starts)}: take a later stop")
    sample_density.require_dense_sampling(run.time, starts[: len(ends)], ends, "slip")
    fast = ahead >= 0
    found = [
        Quantity("slips", len(starts), "", "slips"),
        Quantity("first_slip", float(starts[0]), "s", "first slip"),
        Quantity("period", float(np.mean(np.diff(starts))), "s", "slip period"),
    ]
    if len(durations):
        found.append(Quantity("slip_time", float(np.mean(durations)), "s", "duration of a slip"))
    found.append(Quantity("peak_speed", peak_value(run.time, np.abs(v), fast), "m/s", "peak speed"))
    if "acceleration" in run.spec.motion_outputs:
        peak = peak_value(run.time, np.abs(run.column_of_role("acceleration")), include_neighbours(fast))
        found.append(Quantity("peak_acceleration", peak, "m/s2", "peak acceleration"))
    return AnalysisResult(tuple(found))


def slips_from_modes(t: np.ndarray, mode: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts and durations in s of the slips that modes (n,) from times t (n,) show; one cut short has no duration."""
    stuck = np.flatnonzero(mode == 0)
    starts = t[stuck[stuck < len(t) - 1] + 1]
    ends = t[stuck[stuck > 0]]
    ends = ends[ends > starts[0]] if len(starts) else ends
    return starts, ends - starts[: len(ends)]


def upward_crossings(t: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Times (m,) where y (n,) rises through zero, on straight lines between its samples."""
    i = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    return t[i] - y[i] * (t[i + 1] - t[i]) / (y[i + 1] - y[i])


def include_neighbours(among: np.ndarray) -> np.ndarray:
    """The samples named, and the neighbours of each."""
    wide = among.copy()
    wide[:-1] |= among[1:]
    wide[1:] |= among[:-1]
    return wide


def peak_value(t: np.ndarray, y: np.ndarray, among: np.ndarray) -> float:
    """The largest y (n,) of the samples named, or the top of the parabola through it and its neighbours among them."""
    i = int(np.argmax(np.where(among, y, -np.inf)))
    if not (0 < i < len(y) - 1 and among[i - 1] and among[i + 1]):
        return float(y[i])
    left, right = t[i] - t[i - 1], t[i + 1] - t[i]
    down, up = (y[i] - y[i - 1]) / left, (y[i + 1] - y[i]) / right
    bend = (up - down) / (left + right)
    slope = (down * right + up * left) / (left + right)
    return float(y[i] - slope * slope / (4 * bend)) if bend < 0 else float(y[i])
