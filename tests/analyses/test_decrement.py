"""The decay analysis on signals with known parameters."""

from math import cos, exp, pi, sin, sqrt

import numpy as np
import pytest

from harness import HarnessError
from harness.analyses.decay.decrement import (
    check_sampling,
    damping_ratio,
    find_extrema_from_velocity,
    friction_from_envelope,
    select_cycles,
)


def damped_oscillation(zeta, n=4001):
    """Return samples t, x, v of exp(-zeta t) cos(...), from rest at 1, over six cycles of undamped period 2 pi."""
    t = np.linspace(0.0, 12 * pi, n)
    w = sqrt(1 - zeta * zeta)
    x = np.exp(-zeta * t) * (np.cos(w * t) + zeta / w * np.sin(w * t))
    return t, x, -np.exp(-zeta * t) * np.sin(w * t) / w


def friction_oscillation(loss, n=4001):
    """Return samples of an oscillation of period 2 pi that starts at 1 and loses `loss` per half cycle until it
    rests."""
    rows = []
    for t in np.linspace(0.0, 12 * pi, n):
        half = int(t / pi)
        side, size = (-1) ** half, 1 - loss * half - loss / 2
        if 1 - loss * half <= loss / 2:
            rows.append((t, rows[-1][1], 0.0))
        else:
            rows.append((t, side * (size * cos(t - half * pi) + loss / 2), -side * size * sin(t - half * pi)))
    return np.array(rows).T


@pytest.mark.parametrize("zeta", [1e-4, 0.0796, 0.3])
@pytest.mark.parametrize("cycles", [0.5, 2, 2.5, 5])
def test_the_damping_ratio_of_an_exact_signal_is_recovered(zeta, cycles):
    times, positions = find_extrema_from_velocity(*damped_oscillation(zeta))
    _, positions, cycles_used = select_cycles(times, positions, 0, cycles)
    assert cycles_used == cycles
    assert damping_ratio(abs(positions[0]), abs(positions[-1]), cycles_used) == pytest.approx(zeta, abs=1e-6)


@pytest.mark.parametrize("n", [100, 200, 400])
def test_interpolated_turning_points_converge_with_order_four(n):
    """Halving the sampling interval divides the error by sixteen; it is bounded by the error of a cubic, h^4/384
    x''''."""
    t, x, v = damped_oscillation(0.0, n)
    h = t[1]
    _, positions = find_extrema_from_velocity(t, x, v)
    assert np.abs(np.abs(positions) - 1).max() <= 1.01 * h**4 / 384


def test_turning_points_alternate_and_are_half_a_cycle_apart():
    times, positions = find_extrema_from_velocity(*damped_oscillation(0.1))
    assert np.diff(times) == pytest.approx(pi / sqrt(1 - 0.01), abs=1e-7)
    assert positions == pytest.approx([(-1) ** i * exp(-0.1 * times[i]) for i in range(len(times))], abs=1e-7)


@pytest.mark.parametrize("cycles", [0.5, 1, 1.5, 3])
def test_the_friction_of_an_exact_signal_is_recovered(cycles):
    """With k = 2 the loss of 0.1 per half cycle, 2 f/k, means f = 0.1."""
    times, positions = find_extrema_from_velocity(*friction_oscillation(0.1))
    _, positions, used_cycles = select_cycles(times, positions, 1, cycles)
    assert friction_from_envelope(abs(positions[0]), abs(positions[-1]), used_cycles, 2.0) == pytest.approx(
        0.1, abs=1e-4
    )


def test_turning_points_end_at_rest():
    times, positions = find_extrema_from_velocity(*friction_oscillation(0.3))
    assert np.abs(positions) == pytest.approx([1.0, 0.7, 0.4, 0.1], abs=1e-4)
    assert times == pytest.approx([0.0, pi, 2 * pi, 3 * pi], abs=1e-2)


def test_a_rest_between_two_motions_in_one_direction_is_not_a_turning_point():
    t = np.arange(7.0)
    x = np.array([0.0, 0.0, 0.5, 1.0, 1.0, 1.5, 2.0])
    v = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0])
    assert len(find_extrema_from_velocity(t, x, v)[0]) == 0


@pytest.mark.parametrize(
    ("first", "cycles", "sentence"),
    [(0, 7, "needs 15 turning points"), (6, None, "needs 14 turning points"), (5, 1.5, "needs 14 turning points")],
)
def test_too_few_turning_points_are_refused(first, cycles, sentence):
    times, positions = find_extrema_from_velocity(*damped_oscillation(0.05))
    with pytest.raises(HarnessError, match=sentence):
        select_cycles(times[:13], positions[:13], first, cycles)


def test_the_published_peaks_give_the_published_values():
    assert damping_ratio(0.06031, 0.01323, 3) == pytest.approx(0.0802, abs=5e-5)
    assert friction_from_envelope(0.08703, 0.04837, 3, 157.9) == pytest.approx(0.509, abs=5e-4)


@pytest.mark.parametrize(("x_0", "x_n"), [(1.0, 1.0), (1.0, 1.1), (1.0, 0.0), (0.0, 0.0)])
def test_a_signal_without_decay_is_refused(x_0, x_n):
    with pytest.raises(HarnessError, match="do not decay"):
        damping_ratio(x_0, x_n, 1)
    with pytest.raises(HarnessError, match="do not decay"):
        friction_from_envelope(x_0, x_n, 1, 1.0)


def test_a_half_cycle_needs_eight_samples_with_those_at_its_ends():
    time = np.arange(16.0)
    check_sampling(time, time[[0, 7]], time[[7, 14]], "half cycle")
    with pytest.raises(HarnessError, match="the one from t = 7 s to 13 s has 7"):
        check_sampling(time, time[[0, 7]], time[[7, 13]], "half cycle")
