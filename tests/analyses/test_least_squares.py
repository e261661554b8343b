"""Steps of the least-squares fit that are accepted and refused."""

import numpy as np
import pytest
from decays import TERMS, decay_record, identify

from harness.analyses.decay.decay_problem import FitError, least_squares

T0, AMPLITUDE, REST, _, OMEGA, ZETA, R, B = range(8)  # the order of the unknowns
T = np.linspace(0.0, 1.0, 21)
START = np.zeros(8)
START[AMPLITUDE] = START[OMEGA] = 1.0
LINE = 3.0 + 0.1 * np.cos(40 * T)  # no constant fits it exactly


def constant(p):
    """Residuals of a constant, and their Jacobian."""
    return p[REST] - LINE, np.ones((len(T), 1))


def fit(residual):
    """Return the fitted constant and the number of evaluations."""
    evaluations = []
    p = least_squares(lambda p: (evaluations.append(p[REST]), residual(p))[1], START, np.array([REST]))[0]
    return p[REST], len(evaluations)


def test_a_linear_problem_is_solved_to_rounding_in_few_steps():
    """From zero, so that the trust region has to grow first."""
    value, count = fit(constant)
    assert value == pytest.approx(LINE.mean(), rel=1e-12)
    assert count <= 6


@pytest.mark.parametrize("invalid_part", ["residual", "jacobian"])
def test_a_step_to_values_that_are_not_finite_is_refused(invalid_part):
    """Beyond 2, where the least squares are."""

    def residual(p):
        r, jacobian = constant(p)
        if p[REST] > 2:
            (r if invalid_part == "residual" else jacobian)[-1] = np.nan
        return r, jacobian

    value, _ = fit(residual)
    assert 0 < value <= 2


def test_a_step_without_any_finite_value_is_refused_for_several_unknowns():
    """The eigenvalues of a matrix of NaN do not converge."""
    unknowns = np.array([REST, ZETA, R, B])
    columns = np.stack([np.ones_like(T), T, T**2, T**3], axis=1)
    start = START.copy()
    start[[ZETA, R, B]] = 0.1

    def residual(p):
        scale = np.nan if p[REST] > 2 else 1.0
        return scale * (columns @ p[unknowns] - LINE - 0.3 * T), scale * columns

    p, _ = least_squares(residual, start, unknowns)
    assert 0 < p[REST] <= 2


def test_a_step_that_increases_the_squares_is_refused():
    """A Jacobian that is too small makes each undamped step 2.2 times too long, so that the squares grow by half."""
    value, _ = fit(lambda p: (p[REST] - LINE, np.full((len(T), 1), 0.45)))
    assert value == pytest.approx(LINE.mean(), abs=0.1)


@pytest.mark.parametrize(
    ("unknown", "best", "low", "high"),
    [
        (OMEGA, 100.0, 1.0, 10.0),
        (OMEGA, -3.0, 0.1, 1.0),
        (T0, 50.0, 0.0, 6.3),
        (T0, -50.0, -6.3, 0.0),
        (ZETA, 3.0, 0.1, 0.9),
        (R, 5.0, 0.1, 1.0),
    ],
)
def test_no_step_loses_the_cycles_of_the_record(unknown, best, low, high):
    """Another frequency, another cycle, and losses without an oscillation are refused, though they fit better."""
    start = START.copy()
    start[[ZETA, R]] = 0.1
    p, _ = least_squares(lambda p: (p[unknown] - (LINE - 3.0 + best), np.ones((len(T), 1))), start, np.array([unknown]))
    assert low < p[unknown] < high


@pytest.mark.parametrize(("unknown", "best", "limit"), [(OMEGA, 100.0, 10.0), (T0, -50.0, 6.3)])
def test_a_step_that_loses_the_cycles_of_the_record_is_not_evaluated(unknown, best, limit):
    """Its evaluation could cost a million half cycles."""
    evaluated_values = []

    def residual(p):
        evaluated_values.append(p[unknown])
        return p[unknown] - (LINE - 3.0 + best), np.ones((len(T), 1))

    least_squares(residual, START, np.array([unknown]))
    assert limit / 2 < np.abs(evaluated_values).max() <= limit


def test_fits_one_after_another_do_not_leave_the_frequency_of_the_record():
    """Each alone may change the frequency by a factor of ten; a million half cycles would be evaluated for minutes."""
    fit = identify(decay_record(0.01, turn=0.0), drag=False)
    problem, p = fit.problem, fit.best.p.copy()
    turns = np.ptp(problem.t) / problem.half_period
    for factor in (1.0, 3.0, 100.0, 1e5):
        p[OMEGA] = factor * np.pi / problem.half_period
        e, _ = problem.residuals(p, TERMS)
        amplitudes, _ = problem.half_cycles(p, max_count=1000)
        assert np.isfinite(e).all() == (factor < 10)
        if factor < 10:
            assert len(amplitudes) < 10 * turns
        else:
            with pytest.raises(FitError, match="does not have the turning points"):
                problem.fit(p, TERMS)


def test_a_loss_that_few_steps_from_zero_have_not_reached_is_not_absent():
    p, _ = least_squares(lambda p: (p[ZETA] - (LINE - 2.5), np.ones((len(T), 1))), START, np.array([ZETA]), max_steps=2)
    assert 0.0 < p[ZETA] < 0.01


def test_a_loss_that_would_be_negative_is_exactly_zero():
    """The line falls, so that no combination of rising powers fits it better than a constant."""
    unknowns = np.array([REST, ZETA, R, B])
    columns = np.stack([np.ones_like(T), T, T**2, T**3], axis=1)
    line = 0.3 - T + 0.5 * T**2

    def residual(p):
        return columns @ p[unknowns] - line, columns

    start = START.copy()
    start[[ZETA, R, B]] = 0.1
    p, squares = least_squares(residual, start, unknowns)
    assert p[[ZETA, R, B]].tolist() == [0.0, 0.0, 0.0]
    assert p[REST] == pytest.approx(line.mean(), abs=1e-9)
    assert squares == pytest.approx(np.sum((line - line.mean()) ** 2), rel=1e-9)


def test_a_start_without_a_motion_is_refused():
    with pytest.raises(FitError, match="does not have the turning points"):
        fit(lambda p: (np.full(len(T), np.nan), np.ones((len(T), 1))))
