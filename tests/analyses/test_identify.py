"""Identification from decays whose answer is known: exact on clean signals, inside its intervals on noisy ones."""

import contextlib
import csv
import json
import os
import subprocess
import sys
from dataclasses import replace

import commands
import numpy as np
import pytest
from builds import ROOT
from decays import OMEGA, T, random_record, swung
from intervals import FAR
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from scipy.stats import norm
from scipy.stats import t as student_t

from harness.analyses.decay.bounded import bounded
from harness.analyses.decay.decrement import damping_ratio, friction
from harness.analyses.decay.figures import Known
from harness.analyses.decay.fit import identify
from harness.analyses.decay.intervals import student
from harness.analyses.decay.law import LAWS, TERMS, unknowns_of
from harness.analyses.decay.loss import losses_seen
from harness.analyses.decay.model import Model
from harness.errors import HarnessError
from harness.records.record import Record
from harness.studies.decay.figure import MOST, draw, extremes
from harness.studies.decay.job import numbers
from harness.studies.decay.table import sentences, table

QUANTITIES = ("position", "velocity", "acceleration")


def values(estimates):
    return {each.name: each.value for each in estimates}


def said(found):
    return " ".join(sentences(found))


# ---- the motion


@pytest.mark.parametrize(
    ("zeta", "r", "b", "sine", "a"),
    [
        (0.03, 0.004, 0.0, False, 0.1),
        (0.01, 0.02, 0.5, True, 1.0),
        (0.0, 0.02, 2.0, False, 1.0),
        (0.7, 0.0, 0.0, False, 1.0),
        (0.1, 0.0, 0.0, True, 2.9),
    ],
)
def test_the_motion_is_that_of_an_integrator_restarted_at_every_turning_point(zeta, r, b, sine, a):
    times = np.linspace(0.0, 30.0, 1000)
    expected, begin, place, s = np.full((3, 1000), np.nan), 0.0, a, -1.0
    while np.isnan(expected[0, -1]):

        def rates(_, u, s=s):
            restoring = np.sin(u[0]) if sine else u[0]
            return np.array([u[1], -restoring - 2 * zeta * u[1] - s * b * u[1] * u[1] - s * r])

        def still(_, u):
            return u[1]

        still.terminal, still.direction = True, -s
        piece = solve_ivp(
            rates, (begin, 30.001), [place, 0], "DOP853", events=still, dense_output=True, rtol=1e-13, atol=1e-15
        )
        inside = (times >= begin) & (times <= piece.t[-1])
        u = piece.sol(times[inside])
        expected[:, inside] = u[0], u[1], rates(0, u)[1]
        begin, place, s = piece.t[-1], piece.y[0, -1], -s
        if abs(np.sin(place) if sine else place) <= r:
            expected[:, times > begin] = [[place], [0], [0]]
    for order in range(3):
        model = Model(1.0, order, sine, 0.0, 1e-9 * a)
        found, _ = model(np.array([0, a, 0, 0, 2.0, zeta, r, b]), unknowns_of(TERMS, False), times / 2)
        assert found == pytest.approx(expected[order] * 2.0**order, abs=3e-9 * 5**order * a)


@pytest.mark.parametrize("sine", [False, True])
@pytest.mark.parametrize("order", range(3), ids=QUANTITIES)
def test_the_jacobian_is_that_of_differences(order, sine):
    """Between samples that lie in the same half swing; at a reversal an acceleration jumps."""
    model, p = Model(1.0, order, sine, 1.0, 1e-9), np.array([0.05, 1.0, 0.01, 0.02, 5.0, 0.01, 0.02, 0.05])
    unknowns, t = unknowns_of(TERMS, True), np.linspace(0.0, 4.0, 500)
    _, jacobian = model(p, unknowns, t)
    for column, place in zip(jacobian.T, unknowns, strict=True):
        up, down = (p + way * 1e-5 * (np.arange(8) == place) for way in (1, -1))
        slope = (model(up, unknowns, t)[0] - model(down, unknowns, t)[0]) / 2e-5
        assert np.mean(np.abs(slope - column) < 1e-5 * np.abs(column).max()) > 0.95


@pytest.mark.parametrize("sine", [False, True])
@pytest.mark.parametrize("b", [0.0026, 0.0051, 0.0116])
def test_the_motion_has_no_step_in_its_drag(b, sine):
    """A stretch that begins just before a turning point once lost half a cycle."""
    t, model = np.linspace(0, 60, 3000), Model(1.0, 0, sine, 0.0, 1e-9)
    near = [
        model(np.array([0, 1.0, 0, 0, 1.0, 0.01, 0.001, b + h]), unknowns_of(TERMS, False), t)[0] for h in (0, 1e-7)
    ]
    assert np.abs(near[1] - near[0]).max() < 1e-5


# ---- the answers


@pytest.mark.parametrize(  # every law of a mass and of a pendulum, of which the quantities take turns
    ("law", "sine", "order"),
    [(law, False, 0) for law in LAWS]
    + [(law, True, i % 3) for i, law in enumerate(LAWS)]
    + [(LAWS[0], False, order) for order in (1, 2)],
    ids=lambda each: "+".join(each) if isinstance(each, tuple) else None,
)
def test_a_clean_signal_gives_its_constants_back_to_nine_digits(law, sine, order):
    truth = {term: {"zeta": 0.01, "r": 0.003, "b": 0.4}[term] for term in law}
    t = np.linspace(0, 3, 200)
    found = identify(swung(**truth, sine=sine, order=order, turn=0.0, t=t), Known(pendulum=sine))
    assert set(found.best.terms) == set(law)
    assert values(found.estimates) == pytest.approx(
        dict.fromkeys(TERMS, 0.0) | truth | {"omega": OMEGA, "rest": 0.02}, rel=1e-9, abs=1e-12
    )
    assert found.remarks == ()


@pytest.mark.parametrize("turn", [-0.01, 0.0, 0.001, 0.12, 0.24])
def test_it_matters_not_where_the_record_begins_nor_how_it_is_sampled(turn):
    times = np.sort(np.random.default_rng(1).uniform(0.0, 3.0, 500))
    found = identify(swung(0.02, 0.003, turn=turn, t=times), Known())
    expected = {"zeta": 0.02, "r": 0.003, "b": 0.0, "omega": OMEGA, "rest": 0.02}
    assert values(found.estimates) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("origin", [2.0**4, 2.0**8, -(2.0**9), 2.0**10, 2.0**12])
def test_a_late_clock_and_a_far_origin_take_no_digits(origin):
    """As of seconds since 1970, binary fractions so that the times themselves are exact."""
    times = np.arange(1000) / 256
    x = swung(0.02, 0.003, t=times).x
    found = identify(Record("late", times + 2.0**30, x + origin), Known())
    expected = {"zeta": 0.02, "r": 0.003, "b": 0.0, "omega": OMEGA, "rest": origin + 0.02}
    assert values(found.estimates) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.fixture(
    scope="module",
    params=[(False, False, 0), (False, True, 0), (True, True, 0), (False, False, 1), (False, False, 2)],
    ids=["mass", "quantised", "pendulum", "velocity", "acceleration"],
)
def of_each_law(request):
    """A record of 200 samples or more for each law, of any amplitude, rate and noise: its truth, and what is found."""
    sine, quantised, order = request.param
    records = [random_record(100 + i, law, sine, quantised, 200, order) for i, law in enumerate(LAWS)]
    return [(truth, identify(record, Known(pendulum=sine))) for record, truth, _ in records]


def test_no_answer_is_far_off_without_a_remark(of_each_law):
    """tests/support/intervals.py has many more."""
    for truth, found in of_each_law:
        each = {one.name: one for one in found.estimates}
        off = {name: abs(each[name].value - value) / each[name].error for name, value in truth.items()}
        assert max(off.values()) < FAR or found.remarks


def test_the_truth_lies_in_the_intervals_as_often_as_they_say(of_each_law):
    """Of 35 intervals at 95 %, fewer than 28 would hold the truth once in a thousand times
    (tests/support/intervals.py counts a thousand records of every law)."""
    held = []
    for truth, found in of_each_law:
        each = {one.name: one for one in found.estimates}
        held += [each[name].low <= value <= each[name].high for name, value in truth.items()]
    assert np.sum(held) >= 28


def test_one_more_term_never_costs_more_than_ln_n(of_each_law):
    for _, found in of_each_law:
        bic = {frozenset(law.terms): law.bic for law in found.laws}
        for less in bic:
            assert all(
                bic[more] - bic[less] < len(more - less) * np.log(len(found.t)) + 1e-6 for more in bic if less < more
            )


@pytest.mark.parametrize("truth", [{"zeta": 0.02}, {"r": 0.003}, {"zeta": 0.02, "r": 0.003}])
def test_noise_does_not_hide_the_law(truth):
    found = identify(swung(**truth, noise=1e-3), Known())
    assert set(found.best.terms) == set(truth)
    assert found.best.words in found.sentence


def test_what_noise_hides_is_said_with_what_would_tell():
    found = identify(swung(0.004, noise=3e-3, t=np.linspace(0, 2, 300)), Known())
    assert "cannot be told from" in said(found)
    assert "less noise" in said(found)


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        (Known(k=157.9), {"f": 157.9 * 0.003, "c": 2 * 0.02 * 157.9 / OMEGA, "q": 0.4 * 157.9 / OMEGA**2}),
        (Known(m=2.0), {"f": 2 * OMEGA**2 * 0.003, "c": 2 * 0.02 * 2 * OMEGA, "q": 0.8}),
    ],
)
def test_stiffness_or_mass_give_force_damping_and_drag(known, expected):
    found = values(identify(swung(0.02, 0.003, 0.4), known).estimates)
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-9)


# ---- intervals


def test_the_interval_of_what_cannot_be_negative_holds_it_in_95_percent():
    """By the shares of a normal distribution, of each mean and of each thing measured."""
    step = 0.04
    z = np.arange(-4.0, 9.0, step)
    low, high = np.array([bounded(np.array([each]), np.eye(1)) for each in z]).T
    for mean in (0.0, 0.3, 1.0, 2.0, 3.0, 5.0):
        share = step * np.sum(norm.pdf(z - mean)[(low <= mean) & (mean <= high)])
        assert share == pytest.approx(0.95, abs=0.004), mean


@pytest.mark.parametrize(
    ("rho", "means"),
    [
        (-0.98, (0.0, 0.0)),
        (-0.98, (0.0, 5.0)),
        (-0.98, (2.0, 0.0)),
        (0.5, (0.0, 1.0)),
        (0.5, (0.3, 0.0)),
        (0.5, (2.0, 2.0)),
    ],
)
def test_the_interval_beside_what_cannot_be_negative_either_holds_it_in_95_percent(means, rho):
    """Of 200 draws; more only where both are zero, and there the interval is the shorter for it."""
    correlation = np.array([[1.0, rho], [rho, 1.0]])
    z = np.random.default_rng(1).multivariate_normal(means, correlation, 200)
    low, high = np.array([bounded(each, correlation) for each in z]).T
    assert 0.9 < np.mean((low <= means[0]) & (means[0] <= high)) < (1.0 if means == (0.0, 0.0) else 0.985)
    if means == (0.0, 0.0) and rho < 0:
        alone = np.array([bounded(each[:1], np.eye(1)) for each in z])
        assert np.mean(high) < 0.5 * np.mean(alone[:, 1])


@pytest.mark.parametrize("rho", [0.0, 0.5, -0.98])
def test_an_interval_hangs_on_no_last_digit_of_a_correlation(rho):
    """On which the signs of its axes may hang, and of equal ones the axes themselves."""
    correlation = np.array([[1.0, rho, 0.0], [rho, 1.0, 0.0], [0.0, 0.0, 1.0]])
    intervals = []
    for last in np.random.default_rng(1).uniform(-4e-16, 4e-16, (8, 3, 3)):
        intervals.append(bounded(np.array([0.5, 1.0, 0.3]), correlation + last + last.T))
    assert np.ptp(intervals, axis=0).max() < 1e-9


def test_students_t_is_that_of_scipy():
    freedom = range(1, 200)
    assert [student(n) for n in freedom] == pytest.approx(student_t.ppf(0.975, list(freedom)), rel=3e-4)


# ---- turning points and two peaks


@pytest.mark.parametrize(("sine", "a"), [(False, 0.1), (True, 0.1), (True, 2.0)])
def test_the_turning_points_alone_tell_the_same(sine, a):
    found = identify(swung(0.02, 0.003, 0.02, sine, a=a, t=np.linspace(0, 5, 8001)), Known(pendulum=sine))
    expected = {"zeta": 0.02, "r": 0.003, "b": 0.02, "rest": 0.02}
    tolerance = {"rel": 0.02, "abs": 0.01 if a < 1 else 1e-3}
    assert values(found.by_turns) == pytest.approx(
        {name: expected[name] for name in values(found.by_turns)}, **tolerance
    )
    assert {"zeta", "r"} <= set(values(found.by_turns))


@pytest.mark.parametrize("a", [0.1, 2.5])
@pytest.mark.parametrize("term", TERMS)
def test_two_peaks_of_a_pendulum_tell_its_only_loss(term, a):
    truth = {term: {"zeta": 0.01, "r": 0.003, "b": 0.05}[term]}
    found = identify(swung(**truth, sine=True, a=a, t=np.linspace(0, 4, 401)), Known(pendulum=True))
    assert values(found.published)[term] == pytest.approx(truth[term], rel=5e-3)
    assert set(found.best.terms) == {term}


def test_the_published_peaks_give_the_published_figures():
    assert damping_ratio(0.06031, 0.01323, 3) == pytest.approx(0.0802, abs=5e-5)
    assert friction(0.08703, 0.04837, 3, 157.9) == pytest.approx(0.509, abs=5e-4)


def test_a_column_that_does_not_apply_says_why():
    found = identify(swung(0.02, 0.003, order=1), Known())
    assert found.by_turns == found.published == ()
    assert "No turning points: a record of velocity shows no turning points of the position." in said(found)


def test_two_peaks_beside_a_mixed_law_say_that_they_take_all_of_the_loss():
    assert "Two peaks take all of the loss for one kind" in said(identify(swung(0.02, 0.003), Known()))
    assert "Two peaks take" not in said(identify(swung(0.02), Known()))


def test_the_table_has_a_row_for_every_value():
    found = identify(swung(0.02, 0.003, noise=1e-4), Known(k=157.9))
    assert table(found).row_count == len(found.estimates) == 8


# ---- beginnings and ends


def test_a_hold_before_and_a_rest_after_the_motion_are_left_out():
    """The mass rests where static friction holds it, off what sliding friction alone would allow."""
    record = swung(0.01, 0.005)
    held = np.concatenate(
        [np.full(100, record.x[record.x.argmin()]), record.x[record.x.argmin() :], np.full(300, 0.03)]
    )
    found = identify(Record("held", 0.004 * np.arange(len(held)), held), Known())
    assert values(found.estimates)["r"] == pytest.approx(0.005, rel=1e-3)
    assert "are left out" in said(found)


def test_a_push_before_the_motion_is_left_out_and_said():
    t = np.linspace(0, 6, 3000)
    x = swung(0.01, 0.001, turn=1.06, t=t, noise=1e-5).x
    x[t < 1.2] = 0.02 + 1e-5 * np.random.default_rng(2).standard_normal((t < 1.2).sum())
    found = identify(Record("pushed", t, x), Known())
    assert values(found.estimates)["zeta"] == pytest.approx(0.01, rel=1e-2)
    assert found.t[0] >= 1.2
    assert "The motion is free from t = " in said(found)


def test_a_hand_that_stops_the_motion_is_left_out_and_said():
    t = np.linspace(0, 8, 3000)
    x = swung(0.005, 0.0003, turn=0.0, t=t, noise=1e-4).x
    x[t > 6] = 0.02 + 0.3 * (x[t > 6] - 0.02)
    found = identify(Record("stopped", t, x), Known())
    assert values(found.estimates)["zeta"] == pytest.approx(0.005, rel=0.1)
    assert "follows the law until t = " in said(found)


def test_samples_that_a_logger_repeats_before_and_after_the_motion_are_left_out():
    """They are longer than the motion, and stop it in mid-swing."""
    record = swung(0.01, 0.001, turn=0.0, noise=1e-4)
    x = np.concatenate([np.full(900, record.x[0]), record.x, np.full(1200, record.x[-1])])
    each = {one.name: one for one in identify(Record("padded", 0.004 * np.arange(len(x)), x), Known()).estimates}
    assert abs(each["zeta"].value - 0.01) < 4 * each["zeta"].error < 0.002
    assert abs(each["r"].value - 0.001) < 4 * each["r"].error < 1e-4


@pytest.mark.parametrize("order", range(3), ids=QUANTITIES)
def test_one_sample_far_off_bends_the_fit_no_more_than_it_counts(order):
    record = swung(0.01, 0.001, turn=0.0, noise=1e-5 * OMEGA**order, order=order)
    record.x[0] += 0.3 * OMEGA**order
    found = identify(record, Known())
    assert values(found.estimates)["zeta"] == pytest.approx(0.01, rel=1e-2)
    assert len(found.t) == len(record.t) - 1


def test_stray_samples_are_left_out_and_counted():
    record = swung(0.02, 0.003, noise=1e-4)
    record.x[[200, 500]] += (0.05, -0.08)
    found = identify(record, Known())
    assert values(found.estimates)["r"] == pytest.approx(0.003, rel=2e-2)
    assert "Left out as stray: 2 of 1000 samples." in said(found)


@pytest.mark.parametrize("lost", [(-9999.0, 1), (0.5, 1), (0.0, 5)], ids=["marks", "spikes", "dropouts"])
def test_many_samples_that_were_not_measured_are_left_out_and_counted(lost):
    """What a rangefinder gives without an echo, alone and in runs: turning points that are none."""
    record = swung(0.02, 0.003, rest=0.2, noise=1e-4)
    value, run = lost
    at = np.random.default_rng(3).choice(np.arange(10, 900, 9), 20 // run, replace=False)
    record.x[(at[:, None] + np.arange(run)).ravel()] = value
    found = identify(record, Known())
    each = values(found.estimates)
    assert (each["r"], each["zeta"]) == (pytest.approx(0.003, rel=2e-2), pytest.approx(0.02, rel=2e-2))
    assert 20 <= 1000 - len(found.record.t) <= 30  # a run may take its neighbours with it
    assert f"Left out as stray: {1000 - len(found.record.t)} of 1000 samples." in said(found)


@pytest.mark.parametrize("gap", [(2.0, 2.4), (2.2, 3.7)])
def test_both_sides_of_a_gap_are_used(gap):
    t = np.linspace(0, 6, 3000)
    keep = (t < gap[0]) | (t > gap[1])
    record = swung(0.01, 0.001, t=t, noise=1e-4)
    found = identify(Record("gap", t[keep], record.x[keep]), Known())
    assert values(found.estimates) == pytest.approx(
        {"zeta": 0.01, "r": 0.001, "b": 0.0, "omega": OMEGA, "rest": 0.02}, rel=2e-2, abs=0.05
    )
    assert found.t[0] < gap[0] < gap[1] < found.t[-1]


def test_a_drift_is_told_and_fitted_where_it_is_asked_for():
    record = swung(0.01, 0.001, drift=0.002, noise=1e-4)
    assert "--drift" in said(identify(record, Known()))
    found = identify(record, Known(), drift=True)
    each = {one.name: one for one in found.estimates}
    assert each["drift"].value == pytest.approx(0.002, rel=2e-2)
    assert each["zeta"].low < 0.01 < each["zeta"].high
    assert found.remarks == ()


# ---- what is in doubt, and what is no answer


def test_noise_that_is_not_independent_is_told_and_widens_the_intervals():
    record = swung(0.01, 0.001, noise=1e-3)
    white = identify(record, Known())
    noise = np.convolve(np.random.default_rng(3).standard_normal(1019), np.ones(20), "valid") * 2e-4
    alike = identify(Record("alike", record.t, swung(0.01, 0.001).x + noise), Known())
    assert "not independent" in said(alike)
    zeta = [next(each for each in found.estimates if each.name == "zeta") for found in (white, alike)]
    assert zeta[1].low < 0.01 < zeta[1].high
    assert zeta[1].error > zeta[0].error


@pytest.mark.parametrize(("r", "alike"), [(2e-3, True), (1.999e-3, True), (2.13e-3, False), (1.8e-3, False)])
def test_a_loss_that_keeps_time_with_the_steps_of_the_sensor_is_told(r, alike):
    """Of 1 mm, at which a half swing takes 2 r."""
    side = 1.0 if r > 1.9995e-3 else -1.0
    found = identify(swung(r=r, rest=0.0203, turn=-0.1, step=1e-3, noise=1e-5, side=side), Known())
    assert ("rounds all turning points alike" in said(found)) == alike


def test_a_second_motion_is_told():
    x = swung(0.02).x + 0.004 * np.sin(50 * T)
    assert "something else acts" in said(identify(Record("two", T, x), Known()))


@pytest.mark.parametrize(
    ("x", "sentence"),
    [
        (swung(0.01, noise=1e-4).x + 0.04 * np.sin(7.3 * T), "not a free decay of one oscillator|grows, from a swing"),
        (0.05 * np.cos(OMEGA * T) + 0.05 * np.exp(-T) * np.cos(9 * T), "not a free decay of one oscillator"),
        (np.random.default_rng(1).standard_normal(1000), "all noise"),
        (np.zeros(1000), "does not move"),
        (np.exp(-T), "turning points"),
        (np.cos(T), "turning points"),
        (np.exp(0.1 * T) * np.cos(12 * T), "grows, from a swing of"),
    ],
)
def test_what_is_no_decay_is_refused_in_one_sentence(x, sentence):
    with pytest.raises(HarnessError, match=sentence) as refusal:
        identify(Record("bad", T, x), Known())
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("sine", "order", "drift"), [(False, 0, 0.05), (False, 0, 1.0), (True, 0, 0.05), (False, 2, 0.05), (False, 2, 1.0)]
)
def test_a_drift_too_large_for_a_fit_is_named_with_its_remedy(sine, order, drift):
    size = 0.1 * OMEGA**order
    record = swung(
        0.01, sine=sine, drift=drift * size, noise=1e-3 * size, order=order, turn=0.0, t=np.linspace(0, 5, 450)
    )
    with pytest.raises(HarnessError, match="over the record: --drift fits that as well") as refusal:
        identify(record, Known(pendulum=sine))
    over = float(str(refusal.value).split("drifts, by ")[1].split()[0])
    assert over == pytest.approx(5 * drift * size, rel=0.02)


@pytest.mark.parametrize("a", [2.8, 3.0])
def test_the_two_peaks_of_a_large_angular_acceleration_are_named_with_their_remedy(a):
    record = swung(0.01, sine=True, a=a, omega=6.0, noise=0.05, order=2, turn=0.0, t=np.linspace(0, 5, 500))
    with pytest.raises(HarnessError, match="two peaks a swing: record the angle or its rate"):
        identify(record, Known(pendulum=True))


def test_a_pendulum_that_is_not_said_to_be_one_is_hinted_at():
    record = swung(0.005, 0.001, sine=True, a=1.5, noise=1e-3, t=np.linspace(0, 5, 700))
    with pytest.raises(HarnessError, match="say --pendulum"):
        identify(record, Known())


def test_a_pendulum_is_measured_by_its_angle():
    with pytest.raises(HarnessError, match="measured by its angle"):
        identify(swung(0.02), Known(pendulum=True))


@pytest.mark.parametrize("seed", [3, 11, 29, 30])
def test_whatever_a_fit_tries_a_record_ends_in_a_fit_or_in_one_sentence(seed):
    """A walk at random, on which fits may try anything."""
    walk = np.random.default_rng(seed).standard_normal(60).cumsum()
    with contextlib.suppress(HarnessError):
        assert identify(Record("walk", np.linspace(0, 1, 60), walk), Known())


def test_no_loss_is_called_a_loss():
    found = identify(swung(noise=1e-3), Known())
    assert "No loss stands out" in found.sentence or all(each.value < 3 * each.error for each in found.estimates[1:4])


# ---- the figure


def test_a_figure_shows_angles_in_degrees_and_leaves_out_only_what_was_left_out(tmp_path, monkeypatch):
    """Of a record whose clock counts from 1970."""
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **_: figures.append(figure))
    t = np.linspace(0.0, 9.0, 3001)
    record = swung(0.02, sine=True, a=1.0, turn=0.0, rest=0.0, t=t, noise=1e-3)
    found = identify(replace(record, t=record.t + 1.7e9), Known(pendulum=True))
    draw(found, losses_seen(found), tmp_path / "figure.svg")
    signal, residuals, shares = figures[0].get_axes()
    assert [axes.get_ylabel() for axes in (signal, residuals)] == ["x [deg]", "record - fit [deg]"]
    assert shares.get_xlabel() == "amplitude [deg]"
    drawn = {line.get_label(): line.get_data() for line in signal.lines}
    assert np.degrees(1.0) == pytest.approx(np.max(drawn["record"][1]), rel=5e-3)
    assert len(drawn.get("left out", [[]])[0]) == len(record.t) - len(found.t)
    assert found.record.at(1.7e9 + 0.0125) == "1700000000.0125"


@pytest.mark.parametrize("count", [3000, 120_000])
def test_of_many_samples_those_are_drawn_that_show_how_far_they_reach(count):
    x = np.sin(np.arange(count)) + np.random.default_rng(1).standard_normal(count)
    some, wide = extremes(x), -(-2 * count // MOST)
    assert len(some) <= min(count, 3 * MOST // 2)
    for begin in range(0, count, 100 * wide):
        those = x[some[(some >= begin) & (some < begin + 10 * wide)]]
        assert (those.min(), those.max()) == (x[begin : begin + 10 * wide].min(), x[begin : begin + 10 * wide].max())


# ---- the command line


def harness(folder, *arguments, text="", blank=True):
    """The finished process of the harness in `folder`."""
    return commands.harness(folder, *arguments, text=text, blank=blank, COLUMNS="120")


def test_the_csv_of_another_program_gives_the_parameters_of_its_run(fmus, tmp_path):
    """fmpy's command line simulates the FMU and writes the file."""
    words = ["simulate", fmus / "coulomb.fmu", "--output-file", "run.csv", "--output-interval", "0.005"]
    done = commands.harness(tmp_path, *words, "--start-values", "c", "0.3", "f", "0.4", module="fmpy")
    assert (tmp_path / "run.csv").exists(), done.stderr
    done = harness(tmp_path, "decay", "run.csv", "--unit", "m", "--k", "157.9", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    found = {each["name"]: each["value"] for each in json.loads(done.stdout)["fit"]}
    assert found["f"] == pytest.approx(0.4, rel=1e-9)
    assert found["c"] == pytest.approx(0.3, rel=1e-9)


def test_a_scene_leaves_numbers_turning_points_fit_and_figure(fmus, tmp_path):
    (tmp_path / "fmus").symlink_to(fmus)
    done = harness(tmp_path, "decay", "coulomb", blank=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Best described by dry friction" in done.stdout
    folder = tmp_path / "results/decay/coulomb"
    files = {"decay.json", "turning-points.csv", "fit.csv", "figure.svg", "provenance.json"}
    assert {file.name for file in folder.iterdir()} == files
    found = {each["name"]: each for each in json.loads((folder / "decay.json").read_text())["fit"]}
    assert found["f"]["value"] == pytest.approx(0.5, rel=1e-9)
    with (folder / "fit.csv").open() as file:
        assert next(csv.reader(file)) == ["t [s]", "x [m]", "fit [m]", "residual [m]"]


def test_standard_input_is_a_record_too(tmp_path):
    record = swung(0.02, noise=1e-4)
    text = "t [s],x [m]\n" + "\n".join(f"{t:.9g},{x:.9g}" for t, x in zip(record.t, record.x, strict=True))
    done = harness(tmp_path, "decay", "-", "--json", text=text)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["record"] == "stdin"


def test_the_numbers_keep_their_names():
    found = numbers(identify(swung(0.02, 0.003, noise=1e-4), Known()))
    assert {"fit", "remarks", "laws", "sentence", "turning_points", "published"} <= set(found)
    assert {each["name"] for each in found["fit"]} == {"omega", "zeta", "r", "b", "rest"}
    assert all({"value", "error", "low", "high", "unit"} <= set(each) for each in found["fit"])
    assert len(found["laws"]) == 7
    assert set(found["loss"]["laws"]) == {"+".join(law) for law in LAWS}


def test_a_record_waits_for_nothing_that_it_does_not_need(tmp_path):
    """Nothing that runs FMUs is imported; the figure is drawn once."""
    program = """
import sys
from matplotlib.figure import Figure
from pathlib import Path
from decays import swung
from harness.analyses.decay.figures import Known
from harness.analyses.decay.fit import identify
from harness.studies.decay.job import save

draws, draw = [], Figure.draw
Figure.draw = lambda *arguments: draws.append(draw(*arguments))
save(identify(swung(0.02), Known()), Path.cwd())
print(len(draws), [name for name in ("fmpy", "scipy", "harness.running", "harness.scenes") if name in sys.modules])
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests/support")])},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.stdout.split(maxsplit=1), done.stderr) == (["1", "[]\n"], "")


@pytest.mark.parametrize(
    ("arguments", "status", "sentence"),
    [
        (["decay", "stickslip"], 1, "not a free decay of one oscillator"),
        (["decay", "nosuch"], 2, "unknown scene 'nosuch'"),
        (["decay", "nosuch.csv"], 2, "cannot read nosuch.csv"),
        (["decay", "x.csv", "--k", "1", "--m", "1"], 2, "--k and --m"),
        (["decay", "x.csv", "--velocity", "v", "--position", "x"], 2, "--velocity: one column is fitted"),
    ],
)
def test_what_the_command_line_gets_wrong_is_one_sentence(fmus, tmp_path, arguments, status, sentence):
    (tmp_path / "fmus").symlink_to(fmus)
    done = harness(tmp_path, *arguments)
    assert done.returncode == status
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "results/decay").exists() or not list((tmp_path / "results/decay").iterdir())
