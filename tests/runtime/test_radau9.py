"""The method radau9: its coefficients, its iteration, and its accuracy on stiff friction."""

from math import fabs, isnan

import numpy as np
import pytest
from internal_steps import components, prepared_run
from models import DOP853, RADAU9, RODAS, ROOT, model_class, runtime
from scipy.integrate import solve_ivp
from variants import slow_after

STAGES = range(1, 6)
LUGRE = ROOT / "fmus" / "more" / "lugre.py"


def table(letter):
    """Return a matrix of coefficients of the method; missing ones are zero."""
    numbers = vars(runtime("pacejka", "radau9"))
    return np.array([[numbers.get(f"{letter}{i}{j}", 0.0) for j in STAGES] for i in STAGES])


def row(letter):
    numbers = vars(runtime("pacejka", "radau9"))
    return np.array([numbers.get(f"{letter}{i}", 1.0) for i in STAGES])


@pytest.fixture(scope="module")
def numbers():
    return runtime("pacejka", "radau9")


def test_the_stages_are_collocation_points_of_radau():
    """Each row of A integrates polynomials of degree 4 up to its node, and the last one those of degree 8."""
    A, c = table("A"), row("C")
    for degree in range(5):
        assert A @ c**degree == pytest.approx(c ** (degree + 1) / (degree + 1), abs=1e-15)
    for degree in range(9):
        assert A[4] @ c**degree == pytest.approx(1.0 / (degree + 1), abs=1e-15)


def test_the_transformation_diagonalizes_the_inverse_of_the_matrix(numbers):
    A, T, S = table("A"), table("T"), table("S")
    T[4] = 1.0, 1.0, 0.0, 1.0, 0.0
    assert np.abs(S @ T - np.eye(5)).max() < 1e-13
    blocks = np.zeros((5, 5))
    blocks[0, 0] = 1.0 / numbers.GAMMA
    for first, re, im in (1, numbers.ALPHA1, numbers.BETA1), (3, numbers.ALPHA2, numbers.BETA2):
        blocks[first : first + 2, first : first + 2] = [[re, -im], [im, re]]
    assert T @ blocks @ S @ A == pytest.approx(np.eye(5), abs=1e-13)


def test_the_polynomial_of_the_interpolant_passes_through_the_stages():
    H, c = table("H"), row("C")
    H[0] = 0.0, 0.0, 0.0, 0.0, 1.0
    r = 1.0 - c
    basis = np.array([c, c * r, c * r * c, c * r * c * r, c * r * c * r * c]).T
    assert basis @ H == pytest.approx(np.eye(5), abs=1e-13)


def test_the_error_estimate_and_the_end_slope_are_those_of_collocation():
    """With slopes k, z = h A k: the estimate is k0 + Q k, zero up to degree 4, and the slope at the end is k5."""
    A, Q, c = table("A"), row("Q"), row("C")
    assert row("E") @ A == pytest.approx(Q, abs=1e-14)
    assert [Q @ c**degree for degree in range(5)] == pytest.approx([-1.0, 0.0, 0.0, 0.0, 0.0], abs=1e-14)
    assert fabs(Q @ c**5) > 1e-3
    assert row("L") @ A == pytest.approx([0.0, 0.0, 0.0, 0.0, 1.0], abs=1e-14)


# ---- one step


class DampedOscillator:
    """x'' = spring x + damper v, with a count of its evaluations."""

    has_dry_friction = has_conditions = False

    def __init__(self, spring=0.0, damper=0.0):
        self.spring, self.damper, self.evaluations = spring, damper, 0

    def rates(self, t, x, v):
        self.evaluations += 1
        return self.spring * x + self.damper * v

    def jacobian(self, t, x, v):
        return 0.0, self.spring, self.damper


def propose(model, x, v, h, tolerance=1e-10):
    """Return new states and rates, error estimates, and the evaluations that the method reports."""
    step = begin_step(model, tolerance)
    a = model.rates(0.0, x, v)
    model.evaluations = 0
    method = runtime("pacejka", "radau9").Radau9()
    return method.propose(model, step, 0.0, x, v, v, a, h), step.active_method.stages


def begin_step(model, tolerance):
    """Return the step of a solver of a model, with an error scale of 1."""
    step = runtime("pacejka", "internal_step").InternalStep(model)
    step.tolerance = tolerance
    step.active_method.error_scale_floor_x = step.active_method.error_scale_floor_v = 1.0
    return step


def test_radau9_reports_all_evaluations():
    model = DampedOscillator(spring=-4.0, damper=-0.6)
    _, evaluations = propose(model, 1.0, -0.3, 0.1)
    assert evaluations == model.evaluations > 0


def test_a_linear_system_takes_two_iterations():
    model = DampedOscillator(spring=-4.0, damper=-600.0)
    _, evaluations = propose(model, 1.0, -0.3, 0.1, tolerance=1e-6)
    assert evaluations in (10, 11)  # one more where the error is estimated again


@pytest.mark.parametrize("rate", [1.0, 30.0, 1e3])
def test_a_first_error_estimate_above_the_tolerance_is_filtered(rate):
    """For v' = -rate v, it is divided by 1 + GAMMA rate h once more."""
    *_, error = propose(DampedOscillator(damper=-rate), 0.0, 1.0, 1.0, tolerance=1.0)[0]
    *_, filtered_error = propose(DampedOscillator(damper=-rate), 0.0, 1.0, 1.0, tolerance=1e-9)[0]
    assert filtered_error == pytest.approx(error / (1.0 + runtime("pacejka", "radau9").GAMMA * rate), rel=1e-6)


def test_a_step_elsewhere_is_that_of_a_new_run():
    """As after an event: neither the polynomial nor the error of the steps before count."""
    model = DampedOscillator(spring=-4.0, damper=-0.6)
    step, used_method, new = begin_step(model, 1e-10), *(runtime("pacejka", "radau9").Radau9() for _ in range(2))
    control = step.active_method

    def propose_elsewhere(method):
        result = method.propose(model, step, 0.7, 0.5, 0.7, 0.7, model.rates(0.7, 0.5, 0.7), 0.2)
        return *result, control.stages, control.safety, control.grow, control.shrink_after_rejection

    x, v, _, a, *_ = used_method.propose(model, step, 0.0, 1.0, -0.3, -0.3, model.rates(0.0, 1.0, -0.3), 0.1)
    step.n_accepted = 1
    used_method.propose(model, step, 0.1, x, v, v, a, 0.1)
    assert used_method.h_last == 0.1
    assert propose_elsewhere(used_method) == propose_elsewhere(new)


class Growing(DampedOscillator):
    """Its rates exceed what a step can follow."""

    def rates(self, t, x, v):
        self.evaluations += 1
        return v * v * v + 1e3

    def jacobian(self, t, x, v):
        return 0.0, 0.0, 0.0


def test_a_divergent_iteration_is_refused_after_few_evaluations():
    model = Growing()
    (*_, e_x, e_v), _ = propose(model, 0.0, 1.0, 1.0)
    assert isnan(e_x)
    assert isnan(e_v)
    assert model.evaluations <= 35


# ---- runs of stiff friction


def integrate(name, values, stop, points=400):
    """Return the states of a lowered model at equal times."""
    model = model_class(name)()
    run = prepared_run(model, values)
    solver = run.solver
    start = model.initial_state(0.0)
    solver.start(model, 0.0, *(start if isinstance(start, tuple) else (start,)), stop, model.tolerance)
    rows = []
    for i in range(1, points + 1):
        assert solver.advance(model, stop * i / points) == 0
        rows.append(components(solver, "y", model.states))
    solver.report(run.events)
    return np.array(rows), solver


def relative_error(rows, truth):
    return float((np.abs(rows - truth) / np.abs(truth).max(0)).max())


@pytest.fixture(scope="module")
def truth():
    """Return the motion of the sled for a width of the friction curve, by scipy's Radau (order 5) at 1e-11."""
    solutions = {}

    def solve(x_m):
        if x_m not in solutions:
            model = model_class("pacejka")()
            model.x_m = x_m
            assert model.prepare() == 0
            model.initial_state(0.0)
            solutions[x_m] = solve_ivp(
                lambda t, y: (y[1], model.rates(t, *y)),
                (0.0, 6.0),
                (0.0, 0.0),
                "Radau",
                np.linspace(0.0, 6.0, 401)[1:],
                rtol=1e-11,
                atol=(1e-14, 1e-11 * x_m),
                jac=lambda t, y: ((0.0, 1.0), model.jacobian(t, *y)[1:]),
            ).y.T
        return solutions[x_m]

    return solve


@pytest.mark.parametrize("x_m", slow_after(1, [1e-2, 1e-4]))
@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-6, 1e-8])
def test_the_error_is_below_the_tolerance_at_every_width_of_the_friction_curve(truth, x_m, rtol):
    rows, _ = integrate("pacejka", {"x_m": x_m, "solver.method": RADAU9, "solver.rtol": rtol}, 6.0)
    assert relative_error(rows, truth(x_m)) < max(3.0 * rtol, 1e-9)


@pytest.mark.parametrize("x_m", [1e-4, 1e-5])
def test_no_step_passes_a_stop_because_a_steep_jacobian_hides_the_error(x_m):
    """The predicted fourth stage may lie where friction is steep, although the step begins where it is not."""
    reference, _ = integrate("pacejka", {"x_m": x_m, "solver.method": RADAU9, "solver.rtol": 1e-9}, 16.0)
    for rtol in 10.0 ** -np.arange(1.5, 5.1, 0.25):
        rows, _ = integrate("pacejka", {"x_m": x_m, "solver.method": RADAU9, "solver.rtol": rtol}, 16.0)
        assert relative_error(rows, reference) < 10.0 * rtol, rtol


@pytest.mark.parametrize("rtol", [1e-6, *(pytest.param(rtol, marks=pytest.mark.slow) for rtol in (1e-3, 1e-9))])
def test_radau9_takes_fewer_steps_than_rodas_for_a_smaller_error(truth, rtol):
    (rows, steps), (other_rows, other_steps) = (
        (rows, solver.steps + solver.rejected)
        for rows, solver in (
            integrate("pacejka", {"x_m": 1e-3, "solver.method": method, "solver.rtol": rtol}, 6.0)
            for method in (RADAU9, RODAS)
        )
    )
    assert steps < other_steps
    assert relative_error(rows, truth(1e-3)) < relative_error(other_rows, truth(1e-3))


# ---- friction with a kink


@pytest.mark.campaign
def test_a_kink_of_the_rates_costs_less_than_ten_tolerances():
    """LuGre, three stops and restarts; the reference is an explicit method of order 8.

    The absolute tolerance resolves the bristles, which deflect by 1e-5 m.
    """
    reference, _ = integrate(LUGRE, {"solver.method": DOP853, "solver.rtol": 1e-11}, 22.0)
    for rtol in 10.0 ** -np.arange(2, 10, 1.0):
        values = {"solver.method": RADAU9, "solver.rtol": rtol, "solver.atol": 1e-5 * rtol}
        rows, _ = integrate(LUGRE, values, 22.0)
        assert relative_error(rows[:, :2], reference[:, :2]) < 10.0 * rtol, rtol
