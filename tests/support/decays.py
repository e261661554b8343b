"""Simulated decays with known parameters: `decay_record` for given ones, `random_record` for random ones."""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from harness import identify_decay
from harness.analyses.decay.signal_model import SignalModel

TERMS = ("zeta", "r", "b")
LAWS = tuple(law for size in (3, 2, 1) for law in combinations(TERMS, size))
UNKNOWNS = np.array([0, 1, 2, 4, 5, 6, 7])  # start, amplitude, rest, omega, zeta, r and b of the model, without drift
T = np.linspace(0.0, 4.0, 1000)
OMEGA = 12.566


class Signal(NamedTuple):
    """Samples x over times t in s."""

    t: np.ndarray
    x: np.ndarray
    unit: str = "m"

    def select(self, begin, end):
        """Return the samples from `begin` to `end` in s."""
        keep = (self.t >= begin) & (self.t <= end)
        return self._replace(t=self.t[keep], x=self.x[keep])


def identify(signal, **options):
    """Return the identified decay of a signal."""
    return identify_decay((signal.t, signal.x), unit=signal.unit, progress=False, **options)


def values(estimates):
    return {estimate.name: estimate.value for estimate in estimates}


def remarks_text(fit):
    return " ".join(block for block in fit.blocks() if isinstance(block, str))


def decay_record(
    zeta=0.0,
    r=0.0,
    b=0.0,
    sine=False,
    omega=OMEGA,
    turn=0.1,
    a=0.1,
    rest=0.02,
    t=T,
    noise=0.0,
    step=0.0,
    order=0,
    side=1.0,
    drift=0.0,
    seed=6,
):
    """Return the signal of a decay that starts at rest with amplitude `a` at time `turn`, with white noise, rounded
    to `step`."""
    model = SignalModel(side, order, sine, 0.0, 1e-7 * a)
    x, _ = model(np.array([turn, a, rest, drift, omega, zeta, r, b]), UNKNOWNS, t)
    if order:
        x[t < turn] = rest  # held at rest
    x = x + noise * np.random.default_rng(seed).standard_normal(len(t))
    base = "rad" if sine else "m"
    return Signal(t, step * np.round(x / step) if step else x, base + ("", "/s", "/s2")[order])


def random_record(seed, law=None, sine=None, is_quantised=None, samples=None, order=0):
    """Return a random signal, its true parameters, and whether it is a pendulum.

    Law, amplitude, rate and noise are random; a third of the records are quantised and half are pendulums. The record
    is the derivative of the position of the given order.
    """
    rng = np.random.default_rng(seed)
    sine = bool(rng.integers(2)) if sine is None else sine
    law = LAWS[rng.integers(len(LAWS))] if law is None else law
    a = 10 ** (rng.uniform(-0.7, 0.45) if sine else rng.uniform(-3, 0))
    if sine and order == 2:
        a = min(a, 1.4)  # beyond 90 degrees the acceleration has two peaks per swing
    omega = 10 ** rng.uniform(-0.3, 2)
    losses = dict(
        zip(law, rng.dirichlet(np.ones(len(law))) * 10 ** rng.uniform(-2, -0.7), strict=True)
    )  # relative to a, at first
    truth = {
        "zeta": losses.get("zeta", 0.0) / np.pi,
        "r": losses.get("r", 0.0) * (min(a, 1.0) if sine else a) / 2,
        "b": losses.get("b", 0.0) * 0.75 / a,
    }
    swings = rng.uniform(6, 80)
    samples = int(10 ** rng.uniform(2.7, 4)) if samples is None else samples
    t = np.linspace(0, swings * np.pi / omega, max(samples, int(12 * swings)))
    size = a * omega**order
    noise = size * 10 ** rng.uniform(-4, -1.7)
    is_quantised = rng.random() < 1 / 3 if is_quantised is None else is_quantised
    step = noise * 10 ** rng.uniform(-0.5, 1) if is_quantised else 0.0
    turn = rng.uniform(-1, 0.3) * np.pi / omega
    rest = rng.normal() * size
    if sine and a > 2:
        turn = abs(turn)  # the start is not extrapolated
    record = decay_record(
        **truth,
        sine=sine,
        omega=omega,
        turn=turn,
        a=a,
        rest=rest,
        t=t,
        noise=0.3 * noise if is_quantised else noise,
        step=step,
        order=order,
        side=rng.choice([-1.0, 1.0]),
        seed=(*np.ravel(seed).tolist(), 1),
    )
    return record, truth | {"omega": omega, "rest": rest}, sine
