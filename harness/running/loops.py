"""A run through fmpy in equal communication steps, all outputs recorded, in two loops.

`usual` is fmpy's own, simulate_fmu, which everybody gets; `direct` is the harness's, which calls the library with
nothing between.  A communication step is what the steps of a run add to it: the difference between a run in 1600 steps
and one in a single step, shared among them.  The solver's own steps do not depend on it; they are in whole runs.
"""

from pathlib import Path

import fmpy

from .clock import best
from .fmu import described, instance, simulate
from .specification import Specification

POINTS = 1600
REPEAT = 10


def usual(file: Path, steps: int) -> float:
    """Run time in s of fmpy's loop, the shortest of several runs of one instance."""
    with instance(Specification(file)) as (description, fmu, _):
        stop = float(description.defaultExperiment.stopTime)

        def run() -> None:
            fmu.reset()
            fmpy.simulate_fmu(
                fmu.unzipDirectory,
                model_description=description,
                fmu_instance=fmu,
                stop_time=stop,
                output_interval=stop / steps,
            )

        return best(run, REPEAT)


def direct(file: Path, steps: int) -> float:
    """Run time in s of the harness's loop, from initialisation on, the shortest of several runs of one instance."""
    description = described(Specification(file))
    stop = float(description.defaultExperiment.stopTime)
    outputs = tuple(v.name for v in description.modelVariables if v.causality == "output")
    cost = simulate(Specification(file, outputs, stop=stop, grid=stop / steps, follow=False, repeat=REPEAT)).cost
    assert cost  # ours tell it
    return cost.seconds


def shared(many: float, one: float) -> float:
    """The time of a communication step, from that of a run in 1600 and of a run in one."""
    return (many - one) / (POINTS - 1)
