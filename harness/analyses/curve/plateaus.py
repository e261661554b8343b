"""Points of friction over velocity from a record over time: plateaus of constant velocity, or a sweep of the velocity.

The record is divided into blocks of neighbouring samples. A plateau is a run of blocks with nearly the same velocity;
its point is the mean of velocity and force. The inertial force of its remaining drift is subtracted. After a reversal
the force passes through the backlash, which is left out. So is the start of a plateau while the force settles.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...errors import SceneError
from ...records.extraction import Samples
from ...records.friction_curve import FORCE, POSITION, VELOCITY
from ..estimation.estimate import robust_std
from .identification import MIN_POINTS
from .points import CurvePoints

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
SWEEP_BLOCKS, SWEEP_POINTS = 4000, 300
SLOW_START = 0.05  # of the largest speed: the motion starts from rest, as after a reversal
MAX_CODES, SAME_CODE = 0.1, 0.05  # codes of a velocity over samples, and relative distance of equal ones
MAX_OFFSET = 0.3  # of the largest speed, that standstill may read
MIN_RESTS, MIN_REST_BLOCKS = 3, 3  # visits of a standstill, and blocks of each
REST_FORCES = 0.2  # of the range of the forces, between visits of a standstill


@dataclass(frozen=True)
class Blocks:
    """Means of neighbouring samples: times, velocities, forces and accelerations (n,), and the noise of a velocity.

    `rest` is the largest speed that the record shows at rest.
    """

    t: np.ndarray
    v: np.ndarray
    force: np.ndarray
    a: np.ndarray
    noise: float
    rest: float = 0.0

    @property
    def slowest(self) -> float:
        """Return the speed below which the body may be at rest."""
        return max(STANDSTILL * float(np.abs(self.v).max()), NOISE_BAND * self.noise, self.rest)


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
    blocks = build_blocks(record, MAX_BLOCKS)
    offset, rest, half_step, notes = find_standstill(record, blocks, units[0])
    blocks = replace(blocks, v=blocks.v - offset, rest=rest)
    travel = find_travel(blocks)
    is_usable = travel > backlash
    if is_usable.sum() < MIN_POINTS:
        raise SceneError(f"{record.name} has too little motion: the speed is below {blocks.slowest:.3g}")
    plateaus = find_plateaus(blocks, is_usable)
    length = sum(len(plateau) for plateau in plateaus)
    if len(plateaus) >= MIN_POINTS and length >= MIN_SHARE * is_usable.sum():
        points = average_plateaus(blocks, plateaus, mass or 0.0, record.name, units)
        share = length / len(blocks.t)
        note = f"{len(plateaus)} plateaus of constant velocity are used, which take {share:.0%} of the record."
    else:
        blocks = build_blocks(record, SWEEP_BLOCKS)
        points = average_sweep(
            replace(blocks, v=blocks.v - offset, rest=rest), backlash, mass or 0.0, record.name, units
        )
        note = "The record has no plateaus of constant velocity: neighbouring samples are averaged" + (
            "." if mass else ", and inertia is not removed, because the mass is not given."
        )
    return replace(points, notes=(*record.notes, *notes, note), half_step=half_step)


def build_blocks(record: Samples, max_blocks: int) -> Blocks:
    """Divide a record over time into at most `max_blocks` blocks."""
    n, is_position = len(record.t), POSITION in record.columns
    width = max(-(-n // max_blocks), BLOCK_SAMPLES if is_position else 1)
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


def find_standstill(record: Samples, blocks: Blocks, unit: str) -> tuple[float, float, float, list[str]]:
    """Return the velocity that standstill reads, the largest speed at standstill, half a step of the code, and a note.

    Half a step is 0 if the code has a zero, and there is no note if standstill reads zero.

    Standstill is a low velocity that recurs whatever the force; the force of a sliding body recurs with its velocity.
    """
    codes = np.unique(record.columns.get(VELOCITY, np.zeros(0)))
    if 2 < len(codes) < MAX_CODES * len(record.t):
        step, smallest = float(np.diff(codes).min()), float(np.abs(codes).min())
        if abs(smallest - step / 2) < SAME_CODE * step:
            note = (
                f"The velocity has steps of {step:.3g} {unit} and no code for zero: standstill reads plus or minus "
                f"{smallest:.3g} {unit}, and samples with this speed are left out. Each other speed may be off by "
                "as much, which widens the intervals."
            )
            return 0.0, smallest * (1 + SAME_CODE), smallest, [note]
    v, force, fastest = blocks.v, blocks.force, float(np.abs(blocks.v).max())
    width = max(STANDSTILL * fastest, NOISE_BAND * blocks.noise)
    is_level = np.append(np.abs(np.diff(v)) <= width, False) & (np.abs(v) < MAX_OFFSET * fastest)
    visits = [run for run in np.split(np.arange(len(v)), np.flatnonzero(np.diff(is_level)) + 1) if is_level[run[0]]]
    visits = [run for run in visits if len(run) >= MIN_REST_BLOCKS]
    best: tuple[int, np.ndarray] = 0, np.zeros(0, int)
    for at in {round(float(np.median(v[run])) / width) for run in visits}:
        runs = [run for run in visits if abs(float(np.median(v[run])) - at * width) <= 1.5 * width]
        forces = [float(np.median(force[run])) for run in runs]
        if len(runs) >= MIN_RESTS and np.ptp(forces) > REST_FORCES * np.ptp(force):
            best = max(best, (sum(map(len, runs)), np.concatenate(runs)), key=lambda candidate: candidate[0])
    members = best[1]
    offset = float(np.median(v[members])) if len(members) else 0.0
    if abs(offset) <= width / NOISE_BAND:
        return 0.0, 0.0, 0.0, []
    note = f"Standstill reads {offset:.3g} {unit} whatever the force: this offset is subtracted from the velocity."
    return offset, width, 0.0, [note]


def find_travel(blocks: Blocks) -> np.ndarray:
    """Return the distance (n,) of each block from the last reversal: infinite before the first, 0 if at rest."""
    sign = np.sign(blocks.v) * (np.abs(blocks.v) > blocks.slowest)
    reverses = np.append(
        np.sign(blocks.v[1:]) != np.sign(blocks.v[:-1]), False
    )  # in this block, or before the next one
    moves = (sign != 0) & ~reverses & ~np.append(False, reverses[:-1])
    steps = np.diff(blocks.t, prepend=blocks.t[0]) * blocks.v
    starts_at_rest = abs(blocks.v[0]) < SLOW_START * np.abs(blocks.v).max()
    direction, distance, travel = 0.0, 0.0 if starts_at_rest else np.inf, np.zeros(len(blocks.v))
    for i in np.flatnonzero(sign):
        if sign[i] == -direction:
            distance = 0.0
        direction = float(sign[i])
        distance += abs(steps[i])
        travel[i] = distance if moves[i] else 0.0
    return travel


def find_plateaus(blocks: Blocks, is_usable: np.ndarray) -> list[np.ndarray]:
    """Return the indices of the blocks of each plateau."""
    plateaus, v, i = [], blocks.v, 0
    while i < len(v):
        if not is_usable[i]:
            i += 1
            continue
        members, mean, n_skipped, j = [i], v[i], 0, i + 1
        while j < len(v) and is_usable[j] and n_skipped <= MAX_SKIPPED:
            if abs(v[j] - mean) <= max(BAND * abs(mean), NOISE_BAND * blocks.noise):
                members.append(j)
                mean += (v[j] - mean) / len(members)
                n_skipped = 0
            else:
                n_skipped += 1
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
    settled_blocks = np.flatnonzero(np.abs(force[: len(force) // 2] - median) <= band)
    return plateau[settled_blocks[0] if len(settled_blocks) else len(force) // 2 :]


def average_plateaus(
    blocks: Blocks, plateaus: list[np.ndarray], mass: float, name: str, units: tuple[str, str]
) -> CurvePoints:
    """Return velocity and force of each plateau, with its times as a label."""
    t = [blocks.t[plateau] for plateau in plateaus]
    v = [blocks.v[plateau] for plateau in plateaus]
    a = [np.polyfit(s - s.mean(), w, 1)[0] if len(s) > 2 else 0.0 for s, w in zip(t, v, strict=True)]
    force = np.array([blocks.force[plateau].mean() for plateau in plateaus]) - mass * np.array(a)
    labels = tuple(f"{s[0]:.4g} to {s[-1]:.4g} s" for s in t)
    elapsed = np.array([s.mean() for s in t]) - blocks.t.mean()
    return CurvePoints(name, np.array([w.mean() for w in v]), force, *units, labels, elapsed=elapsed)


def average_sweep(blocks: Blocks, backlash: float, mass: float, name: str, units: tuple[str, str]) -> CurvePoints:
    """Return the means of neighbouring blocks of a sweep, with their times as a label."""
    travel = find_travel(blocks)
    is_usable = travel > backlash
    size = max(-(-int(is_usable.sum()) // SWEEP_POINTS), 1)
    ends = np.flatnonzero(np.diff(is_usable) | (np.diff(np.sign(blocks.v)) != 0)) + 1
    runs = [run for run in np.split(np.arange(len(blocks.t)), ends) if is_usable[run[0]]]
    parts = [part for run in runs for part in np.array_split(run, -(-len(run) // size))]
    friction = blocks.force - mass * blocks.a
    values = (blocks.t - blocks.t.mean(), blocks.v, friction, blocks.a, np.gradient(friction, blocks.t), travel)
    elapsed, v, force, a, slope, travel = (np.array([value[part].mean() for part in parts]) for value in values)
    step = float(np.median(np.diff(blocks.t)))
    span = np.minimum(np.abs(a) * step * [len(part) / 2 for part in parts], np.abs(v))
    labels = tuple(f"{blocks.t[part[0]]:.4g} to {blocks.t[part[-1]]:.4g} s" for part in parts)
    return CurvePoints(name, v, force, *units, labels, (), elapsed, span, a, slope, travel)
