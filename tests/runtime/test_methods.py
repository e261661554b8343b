"""The integration methods of the runtime, one step at a time: every claim is checked for every method that makes it."""

from math import cos, exp, fabs, isnan, log2, nan, sin, sqrt

import numpy as np
import pytest
import scipy.integrate
from internal_steps import prepared_run
from models import MODELS, ROOT, combinations, model_class, runtime

from fmus.runtime import method_registry

# order of the method, order of its interpolant, and a step size at which halving shows them
METHODS = {
    "ode23": (3, 3, 0.05),
    "ode45": (5, 4, 0.1),
    "dop853": (8, 7, 0.25),
    "rodas": (4, 3, 0.05),
    "radau9": (9, 5, 0.8),
}
TWO_STATES = "pacejka"  # for which the methods are lowered here
PEERS = {"ode23": "RK23", "ode45": "RK45", "dop853": "DOP853"}

ITERATIVE = ("radau9",)  # with a varying number of evaluations

every_method = pytest.mark.parametrize("name", METHODS)


class Motion:
    """A model with a known solution: x = sin(w t), forced, with nonlinear spring and damper."""

    w = 1.3

    def at(self, t):
        return sin(self.w * t), self.w * cos(self.w * t)

    def rates(self, t, x, v):
        at, speed = self.at(t)
        return sin(at) - self.w**2 * at + 0.3 * speed**3 - sin(x) - 0.3 * v**3

    def jacobian(self, t, x, v):
        at, speed = self.at(t)
        return (cos(at) - self.w**2 - 0.9 * speed * self.w**2 * at) * speed, -cos(x), -0.9 * v**2


class Linear:
    """x'' = rate t^power + spring x + damper v, with a record of the evaluations of its right-hand side."""

    def __init__(self, rate=0.0, power=1, spring=0.0, damper=0.0):
        self.rate, self.power, self.spring, self.damper = rate, power, spring, damper
        self.calls = []

    def rates(self, t, x, v):
        self.calls.append((t, x, v))
        return self.rate * t**self.power + self.spring * x + self.damper * v

    def jacobian(self, t, x, v):
        return self.rate * self.power * t ** (self.power - 1) if self.power else 0.0, self.spring, self.damper


class Solver:
    """A method with its coefficients, for a single step."""

    def __init__(self, name):
        self.numbers = runtime(TWO_STATES, name)
        self.order, self.inner, self.h = METHODS[name]
        self.method = getattr(self.numbers, name.capitalize())()
        self.inside = None

    def step(self, model, t, x, v, h):
        """Take a step; return the new x, v and acceleration, and the error estimates. The interpolant is ready."""
        a = model.rates(t, x, v)
        step = runtime(TWO_STATES, "internal_step").InternalStep(model_class(TWO_STATES))
        step.tolerance = 1e-12  # of the iteration of implicit methods, with a scale of 1
        step.active_method.error_scale_floor_x = step.active_method.error_scale_floor_v = 1.0
        x1, v1, _, a1, e_x, e_v = self.method.propose(model, step, t, x, v, v, a, h)
        self.evaluations = step.active_method.stages
        step.t0, step.y0_x, step.y0_v, step.f0_x, step.f0_v, step.h_full = t, x, v, v, a, h
        step.y1_x, step.y1_v, step.f1_x, step.f1_v = x1, v1, v1, a1
        self.method.build_interpolant(model, step)
        self.inside = step.interpolant
        return x1, v1, a1, e_x, e_v


@pytest.fixture
def solver(name, monkeypatch):
    result = Solver(name)
    if name in ITERATIVE:  # steps are longer than the step control would take, and the tolerance is tight
        monkeypatch.setattr(result.numbers, "MAX_ITERATIONS", 60)
    return result


def falls_with(power, error, h):
    """Return whether error(h) falls with that power of h when h is halved, allowing for the next term."""
    return power - 0.5 < log2(error(h) / error(0.5 * h)) < power + 1.0


def distance(values, other_values):
    return max(fabs(p - q) for p, q in zip(values, other_values, strict=True))


def test_every_method_of_the_runtime_is_tested_here():
    files = (ROOT / "fmus" / "runtime").glob("*.py")
    assert {file.stem for file in files if "\nSTAGES" in file.read_text()} == set(METHODS)


def test_a_duplicate_method_number_is_refused(monkeypatch):
    monkeypatch.setattr(method_registry.methods[1][1], "NUMBER", method_registry.methods[0][1].NUMBER)
    with pytest.raises(ValueError, match=r"^ode23\.py: method number 2 is in use; the next free one is 7$"):
        method_registry.find_methods()


@every_method
def test_the_error_of_a_run_falls_with_the_order_of_the_method(solver):
    motion = Motion()

    def error(h):
        t, (x, v), worst = 0.2, motion.at(0.2), 0.0
        for _ in range(round(4.0 / h)):
            x, v, *_ = solver.step(motion, t, x, v, h)
            t += h
            worst = max(worst, distance((x, v), motion.at(t)))
        return worst

    assert falls_with(solver.order, error, solver.h)


@every_method
def test_the_error_inside_a_step_falls_with_the_order_of_the_interpolant(solver):
    motion = Motion()

    def error(h):
        worst = 0.0
        for t in (0.2, 1.4, 3.1):
            solver.step(motion, t, *motion.at(t), h)
            fractions = [0.1 * i for i in range(1, 10)]
            worst = max(worst, *(distance(solver.inside.evaluate(s * h), motion.at(t + s * h)) for s in fractions))
        return worst

    assert falls_with(solver.inner + 1, error, solver.h)


@every_method
def test_the_estimated_error_falls_as_the_step_control_assumes(solver):
    motion = Motion()

    def error(h):
        _, _, _, e_x, e_v = solver.step(motion, 0.7, *motion.at(0.7), h)
        return h * max(fabs(e_x), fabs(e_v))

    assert falls_with(1.0 / solver.numbers.POWER, error, solver.h)


@every_method
def test_the_interpolant_matches_both_ends(solver):
    x, v, *_ = solver.step(Motion(), 0.2, 0.4, -1.7, solver.h)
    assert solver.inside.evaluate(0.0) == (0.4, -1.7)
    assert solver.inside.evaluate(solver.h) == pytest.approx((x, v), abs=1e-14)


@pytest.mark.parametrize("name", [name for name in METHODS if name not in ITERATIVE])
def test_the_evaluation_count_matches_the_declaration_and_the_last_stage_is_reused(solver):
    model = Linear(1.0, 2, -3.0, -0.5)
    x, v, a, _, _ = solver.step(model, 0.0, 0.3, 0.2, 0.1)
    assert len(model.calls) == 1 + solver.numbers.STAGES + solver.numbers.EXTRA
    assert model.calls[solver.numbers.STAGES] == (0.1, x, v)
    assert a == Linear(1.0, 2, -3.0, -0.5).rates(0.1, x, v)


@every_method
def test_row_sums_place_every_stage_on_a_motion_of_constant_speed(solver):
    model = Linear()
    solver.step(model, 0.0, 0.0, 1.0, 1.0)
    assert len({t for t, _, _ in model.calls}) > 2
    for t, x, v in model.calls:
        assert (x, v) == pytest.approx((t, 1.0), abs=1e-14)


@every_method
def test_a_polynomial_of_the_degree_of_the_method_is_exact(solver):
    """x = t^(n + 2)/((n + 1)(n + 2)), from the acceleration t^n."""

    def truth(n, s):
        return s ** (n + 2) / ((n + 1) * (n + 2)), s ** (n + 1) / (n + 1)

    for n in range(solver.order - 1):
        x, v, *_ = solver.step(Linear(1.0, n), 0.0, 0.0, 0.0, 1.0)
        assert (x, v) == pytest.approx(truth(n, 1.0), abs=1e-13)
        if n < solver.inner - 1:
            assert solver.inside.evaluate(0.4) == pytest.approx(truth(n, 0.4), abs=1e-13)


@every_method
def test_one_step_of_a_damped_oscillator_agrees_with_exp(solver):
    """x'' = -4 x - 0.6 v from (1, -0.3): x = exp(-0.3 t) cos(w t), w^2 = 3.91."""
    w = sqrt(3.91)

    def error(h):
        x, v, *_ = solver.step(Linear(spring=-4.0, damper=-0.6), 0.0, 1.0, -0.3, h)
        fall = exp(-0.3 * h)
        return distance((x, v), (fall * cos(w * h), -fall * (0.3 * cos(w * h) + w * sin(w * h))))

    assert falls_with(solver.order + 1, error, solver.h)


@every_method
def test_nan_is_refused_and_rest_has_no_error(solver):
    assert all(isnan(e) for e in solver.step(Linear(nan, 1), 0.0, 1.0, 1.0, 0.1)[3:])
    assert solver.step(Linear(), 0.0, 0.0, 0.0, 0.1) == (0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", PEERS)
def test_a_step_its_interpolant_and_its_error_estimate_agree_with_scipy(solver, name):
    motion = Motion()
    x, v, _, e_x, e_v = solver.step(motion, 0.3, 0.5, 0.7, 0.4)
    peer = getattr(scipy.integrate, PEERS[name])(
        lambda t, y: (y[1], motion.rates(t, y[0], y[1])), 0.3, [0.5, 0.7], 1e3, first_step=0.4, rtol=1e3
    )
    peer.step()
    assert (x, v) == pytest.approx(tuple(peer.y), abs=1e-14)
    if name == "dop853":
        fifth, third = peer.K.T @ peer.E5, peer.K.T @ peer.E3
        error = fifth**2 / np.sqrt(fifth**2 + 0.01 * third**2)
    else:
        error = peer.K.T @ peer.E
    assert np.abs((e_x, e_v)) == pytest.approx(np.abs(error), rel=1e-7, abs=0.0)
    for t in (0.04, 0.2, 0.32):
        assert solver.inside.evaluate(t) == pytest.approx(tuple(peer.dense_output()(0.3 + t)), abs=1e-13)


# ---- additional properties of stiff methods


stiff_method = pytest.mark.parametrize("name", ["rodas", "radau9"])


@stiff_method
def test_a_stiff_method_is_l_stable(solver):
    """One step of v' = -damper v from 1, of any length, ends near 0."""
    for damper in 10.0 ** np.arange(2, 15):
        _, v, *_ = solver.step(Linear(damper=-damper), 0.0, 0.0, 1.0, 1.0)
        assert fabs(v) < 10.0 / damper


@stiff_method
def test_a_stiff_method_never_amplifies_an_undamped_oscillator(solver):
    for w in np.geomspace(1e-2, 1e6, 60):
        x, v, *_ = solver.step(Linear(spring=-w * w), 0.0, 1.0, 0.0, 1.0)
        assert x * x + (v / w) ** 2 <= 1.0 + 1e-12


@pytest.mark.parametrize(("name", "error"), [("rodas", 3e-7), ("radau9", 1e-11)])
def test_a_stiff_method_is_accurate_on_a_slow_motion_however_stiff(solver, error):
    """v' = -damper (v - cos t) - sin t, v(0) = 1: v = cos t (A. Prothero, A. Robinson, Math. Comp. 28 (1974))."""

    class Slow(Linear):
        def rates(self, t, x, v):
            return self.damper * (v - cos(t)) - sin(t)

        def jacobian(self, t, x, v):
            return self.damper * sin(t) - cos(t), 0.0, self.damper

    for damper in (1e1, 1e3, 1e6, 1e9):
        assert solver.step(Slow(damper=-damper), 0.0, 0.0, 1.0, 0.1)[1] == pytest.approx(cos(0.1), abs=error)


def test_rodas_is_stiffly_accurate():
    """The last stage is the new point minus the estimated error."""
    model, h = Linear(0.4, 2, -3.0, -50.0), 0.1
    x, v, _, e_x, e_v = Solver("rodas").step(model, 0.0, 0.3, 0.2, h)
    assert model.calls[-2] == pytest.approx((h, x - h * e_x, v - h * e_v), abs=1e-13)


def test_rodas_meets_the_conditions_of_order_four_with_an_error_estimate_of_order_three():
    """In the notation of E. Hairer and G. Wanner, IV.7: alpha and beta from the coefficients of the transformed
    form."""
    numbers = Solver("rodas").numbers

    def row(letter, i):
        return [getattr(numbers, f"{letter}{i}{j}", 0.0) for j in range(1, 7)]

    A, G = (np.array([row(letter, i) for i in range(1, 7)]) for letter in "AG")
    A[5] = A[4] + np.eye(6)[4]
    gamma = np.linalg.inv(np.eye(6) / numbers.GAMMA - G)
    alpha = A @ gamma
    beta = alpha + gamma
    c, b = alpha.sum(1), beta.sum(1)
    assert c == pytest.approx([0.0, numbers.C2, numbers.C3, numbers.C4, 1.0, 1.0], abs=1e-14)
    assert gamma.sum(1) == pytest.approx([numbers.D1, numbers.D2, numbers.D3, numbers.D4, 0.0, 0.0], abs=1e-14)
    three = [(1 + 0 * c, 1), (b, 2), (c**2, 3), (beta @ b, 6)]
    four = [(c**3, 4), (c * (alpha @ b), 8), (beta @ c**2, 12), (beta @ beta @ b, 24)]
    weights, embedded_weights = beta[5], alpha[5]
    assert [weights @ tree for tree, _ in three + four] == pytest.approx([1.0 / n for _, n in three + four], abs=1e-14)
    assert [embedded_weights @ tree for tree, _ in three] == pytest.approx([1.0 / n for _, n in three], abs=1e-14)
    assert all(fabs(embedded_weights @ tree - 1.0 / n) > 1e-3 for tree, n in four)


def test_rodas_refuses_a_step_with_a_singular_system():
    assert isnan(Solver("rodas").step(Linear(damper=4.0), 0.0, 0.0, 1.0, 1.0)[4])


@pytest.mark.parametrize("name", MODELS)
def test_every_jacobian_is_the_slope_of_its_acceleration(name):
    d = 1e-6
    for values in combinations(name):
        model = model_class(name)()
        prepared_run(model, values)
        for t, x, v, mode in ((0.3, 0.02, 0.004, 1), (1.1, -0.7, -0.4, -1), (2.0, 2.9, 1.3, 0)):
            modes = [mode] if model.contacts else []
            slopes = [
                (model.rates(t + p, x + q, v + r, *modes) - model.rates(t - p, x - q, v - r, *modes)) / (2 * d)
                for p, q, r in ((d, 0.0, 0.0), (0.0, d, 0.0), (0.0, 0.0, d))
            ]
            assert model.jacobian(t, x, v, *modes) == pytest.approx(slopes, rel=1e-5, abs=1e-5)
