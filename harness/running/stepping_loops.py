"""A run through fmpy in equal communication steps, all outputs recorded, in two loops.

`usual` is fmpy's own, simulate_fmu, which everybody gets; `direct` is the harness's, which calls the library with
nothing between.  A communication step is what the steps of a run add to it: the difference between a run in 1600 steps
and one in a single step, shared among them.  The solver's own steps do not depend on it; they are in whole runs.
"""

from pathlib import Path

import fmpy

from .fmi2 import open_instance, read_own_description, simulate
from .run_spec import RunSpec
from .timing import time_fastest_call

COMMUNICATION_STEPS = 1600
REPEATS = 10


def time_fmpy_loop(file: Path, steps: int) -> float:
    """Run time in s of fmpy's loop, the shortest of several runs of one instance."""
    with open_instance(RunSpec(file)) as (description, fmu, _):
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

        return time_fastest_call(run, REPEATS)


def time_direct_loop(file: Path, steps: int) -> float:
    """Run time in s of the harness's loop, from initialisation on, the shortest of several runs of one instance."""
    description = read_own_description(RunSpec(file))
    stop = float(description.defaultExperiment.stopTime)
    outputs = tuple(v.name for v in description.modelVariables if v.causality == "output")
    cost = simulate(RunSpec(file, outputs, stop=stop, grid=stop / steps, follow=False, repeat=REPEATS)).statistics
    assert cost  # ours tell it
    return cost.seconds


def time_per_step(many: float, one: float) -> float:
    """The time of a communication step, from that of a run in 1600 and of a run in one."""
    return (many - one) / (COMMUNICATION_STEPS - 1)
