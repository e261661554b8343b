"""The FMUs of this project, in Python, through FMI 2.0 co-simulation."""

import numpy as np

from harness.scenes.fmu_files import check_built, find_fmu
from harness.scenes.run_spec import RunSpec
from harness.simulation.runner import run_own_fmu as run_fmu

from ..scenes import Scene, Setting, Solution

MODELS = {"rest": "coulomb", "held": "stickslip", "sled": "stickslip"}  # the other scenes have the names of models
OUTPUTS = {"pendulum": ("theta", "omega"), "clutch": ("omega_1", "omega_2")}


def simulate(scene: Scene, setting: Setting) -> Solution:
    """Simulate a scene; `setting` holds values of the FMU."""
    fmu = find_fmu(MODELS.get(scene.name, scene.name))
    check_built(fmu)
    values = dict(setting)
    if scene.name == "held":
        values |= {"k": 0.0, "v_driver": 0.0, "mu_s": 0.6, "F_ext": scene.load(0.0, 0.0)}
    outputs = OUTPUTS.get(scene.name, ("x", "v"))
    run = run_fmu(RunSpec(fmu, (*outputs, "mode"), values, stop=scene.stop, grid=scene.interval, follow=True))
    first, second, mode = (run.columns[name] for name in (*outputs, "mode"))
    rest = np.full(len(first), scene.start[0 if scene.has_second_inertia else 2])
    columns = (rest, first, second) if scene.has_second_inertia else (first, second, rest)
    changes = np.flatnonzero(np.diff(mode)) + 1
    modes = [(float(run.time[i]), int(mode[i])) for i in changes]
    assert run.statistics
    return Solution(run.time, np.column_stack(columns), modes, steps=run.statistics.steps)
