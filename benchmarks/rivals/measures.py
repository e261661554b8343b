"""Measures of a run: error, creep, and events."""

from dataclasses import dataclass
from math import inf, nan

import numpy as np

from harness.simulation.solution import Events, Solution

from .child import RivalReply
from .reference_motions import FINE
from .scenes import Scene, slip_changes

ROUNDING = 1e-12  # m/s or rad/s: a smaller slip of a reference is zero


@dataclass(frozen=True)
class Measures:
    """Measures of a run.

    Attributes
    ----------
    error : float
        Largest error at the compared points, in the unit of the scene.
    creep : float
        Median slip where the body should stick, in m/s or rad/s.
    missed, spurious : int
        Number of reference events that the run lacks, and of events of the run that the reference lacks.
    event_error : float
        Largest error in s of the times of the matched events; NaN if there are none.
    steps : int
        Number of internal steps.
    seconds : float
        Processor time in s.
    """

    error: float
    creep: float
    missed: int
    spurious: int
    event_error: float
    steps: int
    seconds: float


def measure(scene: Scene, reference: Solution, reply: RivalReply) -> Measures:
    """Compare a run with the reference of its scene."""
    states, true_states = np.array(reply.states), reference.states[::FINE]
    error = np.abs(states - true_states)[:, scene.compared_columns].max()
    is_stuck = np.abs(true_states[:, 1] - true_states[:, 2]) < ROUNDING
    slip = np.abs(states[:, 1] - states[:, 2])[is_stuck]
    expected = (reference.events or []) if reply.has_modes else slip_changes(reference, scene.level)
    n_missed, n_spurious, event_error = match_events([(t, kind) for t, kind in reply.changes], expected, scene.stop)
    return Measures(float(error), float(np.median(slip)), n_missed, n_spurious, event_error, reply.steps, reply.seconds)


def match_events(changes: Events, expected: Events, stop: float) -> tuple[int, int, float]:
    """Match events of the same kind by nearest times, at most half of the shortest expected interval apart.

    Returns
    -------
    n_missed, n_spurious : int
        Number of missed events, and of spurious events.
    largest_difference : float
        Largest difference in s of the times of matched events; NaN if there are none.
    """
    n_missed, n_spurious, differences = 0, 0, [] if expected and changes else [nan]
    for kind in {kind for _, kind in (*changes, *expected)}:
        unmatched_times = [t for t, other in changes if other == kind]
        reference_times = [t for t, other in expected if other == kind]
        window = 0.5 * min(np.diff(reference_times).min(initial=inf), stop)
        for t in reference_times:
            nearest = min(unmatched_times, key=lambda other: abs(other - t), default=inf)
            if abs(nearest - t) <= window:
                unmatched_times.remove(nearest)
                differences.append(abs(nearest - t))
            else:
                n_missed += 1
        n_spurious += len(unmatched_times)
    return n_missed, n_spurious, max(differences, default=nan)
