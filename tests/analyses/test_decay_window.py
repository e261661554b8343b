"""The free decay is found within a record of a laboratory, and other motions are refused by their features."""

import numpy as np
import pytest
from decays import Signal, decay_record, identify
from scipy.integrate import solve_ivp
from variants import slow_after

from harness import HarnessError

# Simulated laboratory records: decays with what happens before and after them, and motions that are no decays.
A = 0.05  # m, amplitude of the release


def hand_motion(rng, duration, start, end, rate):
    """Return a smooth motion by hand between two positions, with a tremor."""
    s = np.linspace(0.0, 1.0, max(int(duration * rate), 2))
    tremor = 0.03 * (end - start) * np.sin(2 * np.pi * rng.uniform(2, 4) * s + rng.uniform(0, 6)) * s * (1 - s) * 4
    return start + (end - start) * s * s * (3 - 2 * s) + tremor


def free_decay(duration, rate, a, omega, zeta, r, b):
    """Return a decay from rest at -a, about a rest position of 0."""
    t = np.arange(int(duration * rate)) / rate
    return decay_record(zeta, r, b, omega=omega, turn=0.0, a=a, rest=0.0, t=t).x


def laboratory_record(scene, seed, rate=200.0):
    """Return the record of a laboratory scene, its true parameters, and the times of its largest free decay.

    Scenes: "lift" (rest, hand, release, decay, rest), "hold" (lifted and held before), "push" (an impact from rest),
    "two" (a second, smaller release), "stopped" (caught by hand), "driven" (a drive that is switched off).
    """
    rng = np.random.default_rng((seed, len(scene)))
    omega, a = 2 * np.pi * rng.uniform(0.8, 3.0), A * rng.uniform(0.5, 2.0)
    zeta, r = rng.uniform(0.002, 0.01), a * rng.uniform(0.002, 0.008)
    law = {"omega": omega, "zeta": zeta, "r": r, "b": 0.0}
    period = 2 * np.pi / omega
    decay = free_decay(45 * period, rate, a, **law)
    rest = np.full(int(rng.uniform(2, 6) * rate), 0.0)
    parts = {
        "lift": [rest, hand_motion(rng, 1.5 * period, 0.0, -a, rate), decay, rest + decay[-1]],
        "hold": [
            rest,
            hand_motion(rng, 1.0, 0.0, -a, rate),
            np.full(int(rng.uniform(2, 9) * rate), -a),
            decay,
            rest + decay[-1],
        ],
        "push": [rest, decay[int(0.25 * period * rate) :]],
        "two": [
            rest,
            hand_motion(rng, 1.0, 0.0, -a, rate),
            decay[: int(rng.uniform(20, 30) * period * rate)],
            hand_motion(rng, 0.7, 0.0, -0.6 * a, rate),
            free_decay(15 * period, rate, 0.6 * a, **law),
        ],
        "stopped": [decay[: int(20 * period * rate)], np.full(int(3 * rate), decay[int(20 * period * rate)])],
        "driven": [
            -a * np.cos(omega * np.arange(-int(12 * period * rate), 0) / rate),
            decay,
        ],
    }[scene]
    lengths = np.cumsum([0, *(len(part) for part in parts)])
    at = {"lift": 2, "hold": 3, "push": 1, "two": 2, "stopped": 0, "driven": 1}[scene]
    x = np.concatenate(parts) + 0.02 + 2e-4 * a * rng.standard_normal(lengths[-1])
    record = Signal(np.arange(len(x)) / rate, x)
    return record, law, (lengths[at] / rate, lengths[at + 1] / rate)


SCENES = ("lift", "hold", "push", "two", "stopped", "driven")


def other_motion(kind, seed, rate=200.0):
    """Return the record of a motion that is no free decay.

    Kinds: "growing", "constant", "beating" (two modes), "sawtooth" (stick-slip), "noise", "relaxation" (van der Pol).
    """
    rng = np.random.default_rng((seed, len(kind), 7))
    t = np.arange(int(rng.uniform(15, 30) * rate)) / rate
    omega, a = 2 * np.pi * rng.uniform(0.8, 3.0), A * rng.uniform(0.5, 2.0)
    phase = omega * t + rng.uniform(0, 2 * np.pi)
    if kind == "growing":
        x = a * np.exp(rng.uniform(0.5, 2.0) * t / t[-1]) * np.cos(phase)
    elif kind == "constant":
        x = a * np.cos(phase)
    elif kind == "beating":
        other = omega * rng.uniform(1.05, 1.15)
        x = a * np.exp(-0.2 * t / t[-1]) * (np.cos(phase) + rng.uniform(0.6, 0.95) * np.cos(other * t))
    elif kind == "sawtooth":
        lengths = rng.uniform(0.7, 1.3, 80)
        edges = np.concatenate([[0.0], np.cumsum(lengths)])
        i = np.searchsorted(edges, t, "right") - 1
        x = a * np.minimum((t - edges[i]) * 1.0, (edges[i + 1] - t) / 0.04)
    elif kind == "noise":
        x = a * rng.standard_normal(len(t))
    else:
        mu = rng.uniform(3.0, 8.0)
        tau = t * omega
        result = solve_ivp(
            lambda s, y: [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]],
            (0.0, tau[-1]),
            [2.0, 0.0],
            t_eval=tau,
            rtol=1e-6,
            method="LSODA",
        )
        x = a * result.y[0]
    return Signal(t, x + 2e-4 * a * rng.standard_normal(len(t)))


OTHERS = ("growing", "constant", "beating", "sawtooth", "noise", "relaxation")


@pytest.mark.parametrize("seed", slow_after(1, [301, 302]))
@pytest.mark.parametrize("scene", SCENES)
def test_the_free_decay_and_its_law_are_found_within_a_laboratory_record(scene, seed):
    """Up to one half cycle at its start; a rest at its end may be a part of it.  One record of two has a gap."""
    record, law, (begin, end) = laboratory_record(scene, seed)
    half_period = np.pi / law["omega"]
    if seed % 2:
        rng = np.random.default_rng(seed)
        gap = begin + half_period * (rng.uniform(6, 20) + np.array([0.0, rng.uniform(0.9, 4.0)]))
        keep = (record.t < gap[0]) | (record.t > gap[1])
        record = record._replace(t=record.t[keep], x=record.x[keep])
    fit = identify(record, drag=False)
    assert begin - 1.6 * half_period < fit.t[0] < begin + 1.6 * half_period
    if scene == "two":
        assert (begin + end) / 2 < fit.t[-1] < end + 1.6 * half_period
    assert ("The free decay from t = " in " ".join(fit.remarks)) == (scene != "stopped")
    assert len(fit.record.t) == len(record.t)  # the figure shows the excluded samples
    assert all(abs(fit[name].value - law[name]) < 4 * fit[name].error for name in ("omega", "zeta", "r"))


FEATURES = {
    "growing": "grows, from .* peak to peak: it is driven or gains energy",
    "constant": "has a constant amplitude: over [0-9]+ half cycles its swings change by",
    "beating": "beats: its swings fall to .* and rise again",
    "sawtooth": r"stick-slip.*harness\.fit\('stickslip'",
    "noise": "all noise|no wave",
    "relaxation": "no wave",
}


@pytest.mark.parametrize("kind", OTHERS)
def test_another_motion_is_refused_by_its_feature(kind):
    for seed in range(300, 303):
        with pytest.raises(HarnessError, match=FEATURES[kind]):
            identify(other_motion(kind, seed)._replace(unit="rad" if seed == 301 else "m"))


def test_a_second_decay_of_nearly_the_same_weight_is_named():
    """Without the first swings of the first decay, both are alike."""
    record, _, (begin, end) = laboratory_record("two", 303)
    fit = identify(record.select(begin + 0.3 * (end - begin), np.inf), drag=False)
    assert "half cycles, one of 2, and the intervals are widened by the choice" in " ".join(fit.remarks)
    assert "The record also decays from t =" in " ".join(fit.remarks)


@pytest.mark.parametrize("stop", slow_after(1, [16, 20, 60]))
def test_a_driven_motion_whose_amplitude_tends_to_a_constant_is_refused(stop):
    """Of x'' = -4 x - 0.5 x' + cos 2t from x = 1, a part has swings of nearly equal size."""
    t = np.linspace(0.0, stop, 50 * stop)
    root = np.sqrt(4 - 0.25**2)  # x = sin(2t) + a free decay from x = 1, v = -2
    x = np.sin(2 * t) + np.exp(-0.25 * t) * (np.cos(root * t) + (0.25 - 2) / root * np.sin(root * t))
    with pytest.raises(
        HarnessError, match=r"is driven or gains energy.*; .*fit a model with its drive by|no free decay|not a free"
    ):
        identify(Signal(t, x))
