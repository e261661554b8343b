"""Points of friction over velocity from a record over time: plateaus of constant velocity, or a sweep of the velocity.

The record is divided into blocks of neighbouring samples. A plateau is a run of blocks with nearly the same velocity;
its point is the mean of velocity and force. The inertial force of its remaining drift is subtracted. After a reversal
the force passes through the backlash, which is left out. So is the start of a plateau while the force settles.
"""

from dataclasses import dataclass

import numpy as np

from ...errors import SceneError
from ...records.extraction import Samples
from ...records.friction_curve import FORCE, POSITION, VELOCITY
from ..estimation.noise import robust_std
from .identification import MIN_POINTS, CurvePoints

MAX_BLOCKS = 1000
BLOCK_SAMPLES = 5  # of a position, at least, whose slope is the velocity
MIN_BLOCKS = 5  # of a plateau
BAND = 0.05  # relative distance from the mean velocity of a plateau
CORE = 0.01  # relative distance from the median velocity; at the ends of a plateau, blocks further away are left out
MAX_DRIFT = 0.03  # of the velocity in a plateau, relative
NOISE_BAND = 4.0  # standard deviations
MAX_SKIPPED = 2  # blocks outside of the band in succession
MIN_SHARE = 0.3  # of the moving time that plateaus take, otherwise the record is a sweep
STANDSTILL = 1e-3  # of the largest speed
SWEEP_POINTS = 80  # of each direction
MIN_SWEEP_BLOCKS = 3  # of a point


@dataclass(frozen=True)
class Blocks:
    """Means of neighbouring samples: times, velocities, forces and accelerations (n,), and the noise of a velocity."""

    t: np.ndarray
    v: np.ndarray
    force: np.ndarray
    a: np.ndarray
    noise: float

    @property
    def slowest(self) -> float:
        """Return the speed below which the body may be at rest."""
        return max(STANDSTILL * float(np.abs(self.v).max()), NOISE_BAND * self.noise)


def build_points(record: Samples, mass: float | None, backlash: float) -> CurvePoints:
    """Return the points of a record.

    Parameters
    ----------
    mass : float or None
        Mass in kg, or moment of inertia in kg.m2; None if inertia is negligible.
    backlash : float
        Distance in m or rad after a reversal that is left out.

    Raises
    ------
    SceneError
        If a record over time has too little motion.
    """
    units = record.units[VELOCITY], record.units[FORCE]
    if not len(record.t):
        labels = tuple(f"row {row}" for row in record.rows)
        return CurvePoints(record.name, record.columns[VELOCITY], record.columns[FORCE], *units, labels, record.notes)
    blocks = build_blocks(record)
    is_usable = find_usable_blocks(blocks, backlash)
    if is_usable.sum() < MIN_POINTS:
        raise SceneError(f"{record.name} has too little motion: the speed is below {blocks.slowest:.3g}")
    plateaus = find_plateaus(blocks, is_usable)
    length = sum(len(plateau) for plateau in plateaus)
    if len(plateaus) >= MIN_POINTS and length >= MIN_SHARE * is_usable.sum():
        rows = [average_plateau(blocks, plateau, mass or 0.0) for plateau in plateaus]
        share = length / len(blocks.t)
        note = f"{len(rows)} plateaus of constant velocity are used, which take {share:.0%} of the record."
    else:
        rows = average_sweep(blocks, is_usable, mass or 0.0)
        note = "The record has no plateaus of constant velocity: samples of nearly the same velocity are averaged" + (
            "." if mass else ", and inertia is not removed, because the mass is not given."
        )
    v, force, labels = zip(*rows, strict=True)
    return CurvePoints(record.name, np.array(v), np.array(force), *units, labels, (*record.notes, note))


def build_blocks(record: Samples) -> Blocks:
    """Divide a record over time into blocks."""
    n, is_position = len(record.t), POSITION in record.columns
    width = max(-(-n // MAX_BLOCKS), BLOCK_SAMPLES if is_position else 1)
    count = n // width
    if count < MIN_BLOCKS:
        raise SceneError(f"{record.name} has {n} samples over time; at least {MIN_BLOCKS * width} are required")
    motion = record.columns[POSITION if is_position else VELOCITY]
    signals = (record.t, motion, record.columns[FORCE])
    t, x, force = (values[: count * width].reshape(count, width) for values in signals)
    times = t.mean(axis=1)
    if is_position:
        offset = t - times[:, None]
        v = (offset * x).sum(axis=1) / (offset**2).sum(axis=1)
    else:
        v = x.mean(axis=1)
    noise = robust_std(np.diff(v, 2)) / np.sqrt(6) if count > 2 else 0.0
    return Blocks(times, v, force.mean(axis=1), np.gradient(v, times), noise)


def find_usable_blocks(blocks: Blocks, backlash: float) -> np.ndarray:
    """Return the mask of the blocks in motion, further from the last reversal than the backlash."""
    sign = np.sign(blocks.v)
    reverses = np.append(sign[1:] != sign[:-1], False)  # in this block, or between it and the next one
    moves = (np.abs(blocks.v) > blocks.slowest) & ~reverses & ~np.append(False, reverses[:-1])
    steps = np.diff(blocks.t, prepend=blocks.t[0]) * blocks.v
    direction, travelled = 0.0, np.inf
    usable = moves.copy()
    for i in np.flatnonzero(moves):
        if sign[i] != direction:
            travelled = np.inf if direction == 0.0 else 0.0
            direction = float(sign[i])
        travelled += abs(steps[i])
        usable[i] = travelled > backlash
    return usable


def find_plateaus(blocks: Blocks, is_usable: np.ndarray) -> list[np.ndarray]:
    """Return the indices of the blocks of each plateau."""
    plateaus, v, i = [], blocks.v, 0
    while i < len(v):
        if not is_usable[i]:
            i += 1
            continue
        members, mean, skipped, j = [i], v[i], 0, i + 1
        while j < len(v) and is_usable[j] and skipped <= MAX_SKIPPED:
            if abs(v[j] - mean) <= max(BAND * abs(mean), NOISE_BAND * blocks.noise):
                members.append(j)
                mean += (v[j] - mean) / len(members)
                skipped = 0
            else:
                skipped += 1
            j += 1
        plateau = np.array(members)
        if len(plateau) >= MIN_BLOCKS and is_constant(blocks, plateau):
            plateaus.append(leave_out_settling(blocks, leave_out_ends(blocks, plateau)))
            i = members[-1] + 1
        else:
            i += 1
    return plateaus


def is_constant(blocks: Blocks, plateau: np.ndarray) -> bool:
    """Return whether the velocity does not drift in a plateau."""
    t, v = blocks.t[plateau], blocks.v[plateau]
    drift = abs(float(np.polyfit(t - t.mean(), v, 1)[0])) * float(np.ptp(t))
    uncertainty = NOISE_BAND * blocks.noise * np.sqrt(12 / len(plateau))
    return drift <= max(MAX_DRIFT * abs(float(v.mean())), float(uncertainty))


def leave_out_ends(blocks: Blocks, plateau: np.ndarray) -> np.ndarray:
    """Return a plateau without the ends of the ramps before and after it."""
    v = blocks.v[plateau]
    median = float(np.median(v))
    core = np.flatnonzero(np.abs(v - median) <= max(CORE * abs(median), NOISE_BAND * blocks.noise))
    first, last = core[0], core[-1]
    shorter = plateau[first + 1 : last]
    return shorter if len(shorter) >= MIN_BLOCKS else plateau[first : last + 1]


def leave_out_settling(blocks: Blocks, plateau: np.ndarray) -> np.ndarray:
    """Return a plateau without its first blocks, if their force differs from that of the second half."""
    force = blocks.force[plateau]
    later = force[len(force) // 2 :]
    median = float(np.median(later))
    band = NOISE_BAND * robust_std(later - median)
    settled = np.flatnonzero(np.abs(force[: len(force) // 2] - median) <= band)
    return plateau[settled[0] if len(settled) else len(force) // 2 :]


def average_plateau(blocks: Blocks, plateau: np.ndarray, mass: float) -> tuple[float, float, str]:
    """Return velocity and force of a plateau, and its times as a label."""
    t, v = blocks.t[plateau], blocks.v[plateau]
    a = float(np.polyfit(t - t.mean(), v, 1)[0]) if len(t) > 2 else 0.0
    return float(v.mean()), float(blocks.force[plateau].mean()) - mass * a, f"{t[0]:.4g} to {t[-1]:.4g} s"


def average_sweep(blocks: Blocks, is_usable: np.ndarray, mass: float) -> list[tuple[float, float, str]]:
    """Return velocity and force of blocks with nearly the same velocity, and their velocities as a label."""
    rows = []
    friction = blocks.force - mass * blocks.a
    for direction in (1.0, -1.0):
        index = np.flatnonzero(is_usable & (direction * blocks.v > 0))
        index = index[np.argsort(np.abs(blocks.v[index]))]
        parts = min(SWEEP_POINTS, len(index) // MIN_SWEEP_BLOCKS)
        for part in np.array_split(index, parts) if parts else ():
            v = blocks.v[part]
            rows.append((float(v.mean()), float(friction[part].mean()), f"{v[0]:.4g} to {v[-1]:.4g}"))
    return rows
