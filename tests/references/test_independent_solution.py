"""The independent solution solves its equations and reproduces the values that physics predicts."""

import itertools
from math import degrees

import independent_pendulum
import independent_solution
import pytest
from independent_solution import ClosedFormMotion, LinearSegment, System
from mpmath import mp, mpf, pi, sign, sqrt

REGIMES = {"free": (0, 0), "damped, no spring": (0, 3), "undamped": (144, 0), "critical": (144, 24)}
REGIMES |= {
    f"zeta {z}": (144, mpf(24) * z) for z in (mpf("0.08"), 1 - mpf("1e-12"), 1 + mpf("1e-12"), mpf(7), mpf(1000))
}


@pytest.mark.parametrize(("k", "c"), REGIMES.values(), ids=REGIMES)
def test_a_segment_solves_its_equation(k, c):
    system = System(m=2.0, k=k, c=c, speed=0.1)
    piece, h = LinearSegment(system, net=3.0, v=-2.0), mpf(10) ** -25
    assert piece.at(mpf(0)) == (0, -2)
    for s in (mpf("0.01"), mpf("0.3"), mpf(4)):
        (y0, v0), (y1, v1), (y2, v2) = (piece.at(s + d) for d in (-h, 0, h))
        assert abs((y2 - y0) / (2 * h) - v1) < mpf(10) ** -30
        assert abs(2 * (v2 - v0) / (2 * h) + c * v1 + k * y1 - 3 - k * mpf(0.1) * s) < mpf(10) ** -30


def test_the_speed_is_monotonic_between_flats_and_zero_at_turning_points():
    for c in (0.0, 2.0, 24.0, 60.0):
        piece = LinearSegment(System(m=1.0, k=144.0, c=c, speed=0.3), net=-40.0, v=0.2)
        turn = piece.turning_point(1, mpf(3), catches=True)
        assert abs(piece.at(turn)[1]) < mpf(10) ** -60
        assert all(piece.at(turn * i / 50)[1] > 0 for i in range(50))


def test_the_sled_breaks_away_slips_and_repeats_as_stated():
    motion = ClosedFormMotion([(0.0, independent_solution.stickslip())], 0.0, 0.0, 16.0)
    times = [t for t, _ in motion.events]
    assert [mode for _, mode in motion.events] == [1, 0] * 4
    assert mp.nstr(times[0], 11) == "4.371657754"
    assert abs(times[0] - mpf(0.9) * mpf(12.5) * mpf(9.81) / (mpf(742.5) * mpf(0.034))) < mpf(10) ** -70
    for start, end, next_start in zip(times[0:6:2], times[1:6:2], times[2::2], strict=True):
        assert mp.nstr(end - start, 12) == "0.430665996656"
        assert mp.nstr(next_start - start, 13) == "3.34510449933"
    omega = sqrt(mpf(742.5) / mpf(12.5))
    fastest = motion.at(times[0] + (times[1] - times[0]) / 2)[1]
    assert mp.nstr(fastest, 5) == "0.41736"
    assert mp.nstr((fastest - mpf(0.034)) * omega, 5) == "2.9546"


def test_the_coulomb_mass_rests_after_16_half_cycles_each_losing_2_f_over_k():
    motion = ClosedFormMotion([(0.0, independent_solution.coulomb())], 0.1, 0.0, 5.0)
    assert len(motion.events) == 16
    assert motion.events[-1][1] == 0
    assert mp.nstr(motion.events[-1][0], 6) == "4.00017"
    assert abs(motion.events[-1][0] - 16 * pi / sqrt(mpf(157.9))) < mpf(10) ** -60
    turns = [mpf(0.1)] + [motion.at(t)[0] for t, _ in motion.events]
    loss = 2 * mpf(0.5) / mpf(157.9)  # the last half cycle ends on the side where it began
    assert all(abs(abs(a) + sign(a) * b - loss) < mpf(10) ** -60 for a, b in itertools.pairwise(turns))


def test_a_changed_parameter_restarts_the_motion_from_its_state():
    heavy = ClosedFormMotion(
        [(0.0, independent_solution.stickslip()), (4.6, independent_solution.stickslip(m=30.0))], 0.0, 0.0, 5.0
    )
    light = ClosedFormMotion([(0.0, independent_solution.stickslip())], 0.0, 0.0, 5.0)
    assert heavy.at(4.6) == pytest.approx(light.at(4.6), abs=1e-60)
    assert heavy.events[1][0] < light.events[1][0]  # more friction stops it earlier


def test_the_pendulum_swings_and_rests_as_its_equations_state():
    for reaction in (False, True):
        pendulum = independent_pendulum.Pendulum(reaction)
        swing = independent_pendulum.PendulumMotion([(0.0, pendulum)], independent_pendulum.THETA0, 0.0, 5.0)
        rest = swing.at(5.0)[0]
        assert swing.events[-1][1] == 0
        assert abs(pendulum.load(rest)) <= pendulum.mu * pendulum.r * pendulum.m * pendulum.g
        fifth = degrees(swing.at(swing.events[9][0])[0])
        assert fifth == pytest.approx(2.337, abs=0.12)  # from another program, with coarse steps
    # the lost energy is the torque times the angle; 5 turning points give it in closed form
    swing = independent_pendulum.PendulumMotion(
        [(0.0, independent_pendulum.Pendulum())], independent_pendulum.THETA0, 0.0, 5.0
    )
    weight = independent_pendulum.Pendulum()
    turns = [independent_pendulum.THETA0] + [swing.at(t)[0] for t, _ in swing.events]
    for a, b in itertools.pairwise(turns):
        lost_energy = weight.m * weight.g * weight.a * (mp.cos(b) - mp.cos(a))
        assert lost_energy == pytest.approx(weight.mu * weight.r * weight.m * weight.g * abs(a - b), abs=1e-13)
