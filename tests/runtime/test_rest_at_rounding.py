"""Bodies that rest in coupled contacts, whose loads vary: speeds and rates are rounding errors."""

from dataclasses import replace

import pytest
from build_cache import build_user_model
from models import DOP853, RADAU9
from variants import slow_after

from benchmarks.campaigns.independent_contacts import solve
from benchmarks.campaigns.random_models import random_structure, random_values, to_system, write_model

CASES = [(21, RADAU9, 1e-6), (33, DOP853, 1e-11), (21, RADAU9, 1e-11), (33, RADAU9, 1e-11), (34, RADAU9, 1e-6)]


@pytest.mark.parametrize(("values", "method", "rtol"), slow_after(1, CASES))
def test_rest_takes_few_steps_and_ends_on_time(worker, tmp_path, values, method, rtol):
    structure = random_structure(13)
    numbers, _ = random_values(structure, values)
    reference = solve(replace(to_system(structure, numbers), stop=0.5))
    (file := tmp_path / "resting.py").write_text(write_model(structure))
    path = build_user_model(file, "--method=dop853", "--method=radau9") / "resting.fmu"
    fmu = worker.instantiate(path).begin({**numbers, "solver.method": method, "solver.rtol": rtol}, stop=4.0)
    fmu.step(0.0, 0.5)
    count, last, steps = fmu.get("events.count", "events.t_last", "solver.steps")
    assert count == len(reference.events) > 0
    assert abs(last - reference.events[-1][0]) < 100.0 * rtol
    assert steps < 1000
    fmu.free()
