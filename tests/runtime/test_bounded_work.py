"""Loops of the numerics end early where going on cannot help."""

from itertools import pairwise
from math import nan

from internal_steps import compute_step, prepared_run
from models import LARGER_MODELS, model_class, runtime

from fmus.compiler.lowering import lowered_model, sibling_module


def test_a_first_step_that_fails_is_shortened_no_more_than_max_tries():
    model = model_class("smd")()
    run = prepared_run(model, {"solver.method": 2})
    solver = run.solver
    solver.start(model, 1.0, 0.1, 0.0, 5.0, 1e-6)
    model.k = nan
    assert compute_step(model, run) == runtime("smd", "codes").DIVERGED
    assert 0 < solver.step.n_rejected <= runtime("smd", "method_step").MAX_TRIES


def test_pivots_that_do_not_end_change_one_contact_at_a_time(monkeypatch):
    """A contact after the other, the first that violates its conditions, cannot cycle as joint pivots can."""
    (path,) = (path for path in LARGER_MODELS if path.stem == "stacked")
    stack_class, modes = lowered_model(path), []

    def violations(model, t, x1, v1, x2, v2, mode1, mode2, status1, status2, h_max, tie_tolerance):
        modes.append((mode1, mode2))
        return 1.0, 1.0, 1 - mode1, 1 - mode2

    model, contact_lcp = stack_class(), sibling_module(stack_class, "runtime.contact_lcp")
    monkeypatch.setattr(contact_lcp, "violations", violations)
    model.prepare()
    contact_lcp.solve_modes(model, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 1, 1, 0.1, 1e-9)
    joint = contact_lcp.MAX_JOINT_ITERATIONS
    changes = [(a != c) + (b != d) for (a, b), (c, d) in pairwise(modes)]
    assert changes[:joint] == [2] * joint
    assert changes[joint : contact_lcp.MAX_ITERATIONS - 1] == [1] * (contact_lcp.MAX_ITERATIONS - 1 - joint)
