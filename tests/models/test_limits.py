"""Default limits of a run: the largest step, and the largest values."""

from math import isnan

import pytest
from models import BODIES, EXACT, FEW_CASES, declarations_of, label, outputs, push, scalar_class
from worker_client import FmiError

REACTION = 2  # of a pendulum whose squared load overflows much earlier: many steps, then another message
FORCES = ("k", "c", "f", "g", "mu")


def force_free_values(name):
    """Return values without any force: every method would cover the motion in one step."""
    return dict.fromkeys(set(FORCES) & declarations_of(name).keys(), 0.0)


SMOOTH = [case for case in FEW_CASES if case[1]["solver.method"] != EXACT and case[0] in BODIES]
DRIVEN_CASES = [case for case in FEW_CASES if case[1].get("pin_load") != REACTION and case[0] in BODIES]


@pytest.mark.parametrize("has_stop_time", [True, False], ids=["stop known", "stop unknown"])
@pytest.mark.parametrize("case", SMOOTH, ids=label)
def test_the_largest_step_is_a_tenth_of_the_run(launch, case, has_stop_time):
    """Of the default run if the stop time is unknown; the last step may be a tenth longer, to end there."""
    name, values, _ = case
    v0 = f"{outputs(name)[1]}0"
    for start, run in ((0.0, 3.0), (-50.0, 200.0), (7.3, 0.01)):
        tenth = 0.1 * (run if has_stop_time else scalar_class(name).stop_time)
        stop = start + 20.0 * tenth if not has_stop_time else start + run
        fmu = launch(
            name, {**values, **force_free_values(name), v0: 1.0}, start=start, stop=stop if has_stop_time else None
        )
        _, rows = fmu.follow(start, stop, ["solver.h"])
        sizes = [h for (h,) in rows[1:]]
        assert max(sizes[:-1]) == pytest.approx(tenth, rel=1e-12)
        assert sizes[-1] <= 1.1 * tenth * (1.0 + 1e-12)


@pytest.mark.parametrize("has_stop_time", [True, False], ids=["stop known", "stop unknown"])
@pytest.mark.parametrize("case", DRIVEN_CASES, ids=label)
def test_a_diverging_run_is_refused_with_and_without_a_stop_time(launch, case, has_stop_time):
    name, values, _ = case
    force, _ = push(name)
    fmu = launch(name, {**values, **force_free_values(name), force: 1e99}, stop=40.0 if has_stop_time else None)
    with pytest.raises(FmiError):
        fmu.step(0.0, 20.0)
    assert all(isnan(value) for value in fmu.get(*outputs(name)[:2]))
    assert "the solution diverges" in fmu.messages()[-1][2]
    fmu.worker.read_stderr()
