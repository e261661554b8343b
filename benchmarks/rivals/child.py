"""Runs of rivals, in a worker process."""

from dataclasses import dataclass, field
from importlib import import_module
from time import process_time

import numpy as np

from harness.errors import HarnessError, first_line

from .scenes import SCENES, Events, NotOfferedError, Setting, sample, slip_changes

REPEATS = 3  # of short runs
SHORT = 1.0  # s


@dataclass(frozen=True)
class RivalCase:
    """The module of an engine, the name of the scene that it solves, and its setting."""

    module: str
    scene: str
    setting: Setting


@dataclass(frozen=True)
class RivalReply:
    """Reply of a rival.

    Attributes
    ----------
    gap : str
        Reason why there is no result; empty if there is one.
    states : list of list of float
        States (n, 3) at the times of the scene.
    has_modes : bool
        Whether the changes are those of modes, or those of a slip that passes the level of the scene.
    changes : list of (float, int)
        Times in s, and the mode or the slip (1 begins, 0 ends) from then on.
    steps : int
        Number of internal steps.
    seconds : float
        Processor time in s of the fastest run, including that to build the model.
    """

    gap: str = ""
    states: list[list[float]] = field(default_factory=list)
    has_modes: bool = False
    changes: Events = field(default_factory=list)
    steps: int = 0
    seconds: float = 0.0


def run_case(case: RivalCase) -> RivalReply:
    """Run a rival; an exception becomes a gap."""
    scene = SCENES[case.scene]
    try:
        simulate = import_module(f"{__package__}.engines.{case.module}").simulate
        times: list[float] = []
        while len(times) < (REPEATS if not times or times[0] < SHORT else 1):
            start = process_time()
            motion = simulate(scene, dict(case.setting))
            times.append(process_time() - start)
    except ImportError as error:
        return RivalReply(f"it cannot be imported: {first_line(error)}")
    except (NotOfferedError, HarnessError) as error:
        return RivalReply(first_line(error))
    except Exception as error:  # of an engine, which may raise anything
        return RivalReply(f"{type(error).__name__}: {first_line(error)}")
    states = sample(motion, scene.times)
    if not np.isfinite(states).all():
        return RivalReply("the result is not finite")
    has_modes = motion.events is not None
    changes = slip_changes(motion, scene.level) if motion.events is None else motion.events
    return RivalReply("", states.tolist(), has_modes, changes, int(motion.steps), min(times))
