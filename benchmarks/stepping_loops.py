"""Run times of two co-simulation loops with equal communication steps that record all outputs.

`time_fmpy_loop` measures fmpy's simulate_fmu; `time_direct_loop` measures the loop of this harness, which calls the
library directly. The cost of a communication step is the difference between a run in 1600 steps and one in a single
step, per step. The internal steps of the solver are the same in both runs.
"""

from pathlib import Path

import fmpy

from harness.scenes.run_spec import RunSpec
from harness.simulation.runner import open_instance, read_own_description, run_own_fmu
from harness.simulation.timing import time_fastest_call

COMMUNICATION_STEPS = 1600
REPEATS = 10


def time_fmpy_loop(file: Path, steps: int) -> float:
    """Return the run time in s of fmpy's loop, the fastest of several runs of one instance."""
    with open_instance(RunSpec(file)) as instance:
        fmu, stop = instance.fmu, float(instance.description.defaultExperiment.stopTime)

        def run() -> None:
            fmu.reset()
            fmpy.simulate_fmu(
                fmu.unzipDirectory,
                model_description=instance.description,
                fmu_instance=fmu,
                stop_time=stop,
                output_interval=stop / steps,
            )

        return time_fastest_call(run, REPEATS)


def time_direct_loop(file: Path, steps: int) -> float:
    """Return the run time in s of the harness's loop, from initialization on, the fastest of several runs."""
    description = read_own_description(file)
    stop = float(description.defaultExperiment.stopTime)
    outputs = tuple(v.name for v in description.modelVariables if v.causality == "output")
    statistics = run_own_fmu(
        RunSpec(file, outputs, stop=stop, grid=stop / steps, follow=False, repeat=REPEATS)
    ).statistics
    assert statistics  # FMUs of this project provide them
    return statistics.seconds


def time_per_step(many_steps: float, one_step: float) -> float:
    """Return the time of one communication step, from the times of a run in 1600 steps and of a run in one."""
    return (many_steps - one_step) / (COMMUNICATION_STEPS - 1)
