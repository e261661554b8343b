"""Orbits of random oscillators with falling friction: `python -m benchmarks.campaigns.orbit_campaign [COUNT [SEED]]`.

A body with a spring and a damper rubs on a belt; its friction falls by one of four laws. An independent solver (scipy,
with located events) follows motions from three starts until two neighbouring maxima agree. `orbit` must find each
stable motion in which they end, with the same period to PRECISION and the same amplitude; steady sliding included.
Of a motion that still settles after MAX_TURNS, the maximum that repeats is found by bisection; one that still leaves
its start is followed until it settles. Lines of failures are printed; the exit status is 1 if there are any.
"""

import subprocess
import sys
import tempfile
from collections import Counter
from math import exp, nan, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import harness

PRECISION = 1e-8  # relative difference of periods
AMPLITUDE_TOLERANCE = 1e-6  # relative difference of equal amplitudes
SETTLED_DIFFERENCE = 1e-11  # relative difference of neighbouring maxima
STEADY = 1e-7  # share of the amplitude that sticks, of steady sliding
MAX_TURNS = 300
LAWS = ("exponential", "stribeck", "hyperbola", "polynomial")
MODEL = '''
from fmus import Choice, Contact, Fixed, Mode, Model, Output, Parameter, State, exp, fabs


class Rubbed(Model):
    """Body with a spring and a damper on a belt, with friction that falls by one of four laws."""

    m = Parameter(1.0, "kg", "mass")
    k = Parameter(1.0, "N/m", "stiffness")
    c = Parameter(0.0, "N.s/m", "damping")
    b = Parameter(0.0, "N.s/m", "viscous friction")
    law = Choice(
        "friction over the slip",
        exponential="falls as exp(-s)",
        stribeck="falls as exp(-s^2)",
        hyperbola="falls as 1/(1 + s)",
        polynomial="falls and rises as (3 s - s^3)/2",
    )
    hold = Parameter(1.0, "N", "largest friction of a body that sticks")
    F_s = Parameter(1.0, "N", "friction at the end of sticking")
    F_c = Parameter(0.5, "N", "least friction without viscous friction")
    v_s = Parameter(0.1, "m/s", "speed at which it has fallen")
    v_b = Parameter(0.2, "m/s", "speed of the belt")
    x0 = Fixed(0.0, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")

    x = State("m", "position", start=x0)
    v = State("m/s", "speed", start=v0, rate_of=x)
    mode = Mode()
    slip = v - v_b
    s = fabs(slip) / v_s
    share = law.choose(
        exponential=exp(-s), stribeck=exp(-s * s), hyperbola=1.0 / (1.0 + s), polynomial=1.0 - 1.5 * s + 0.5 * s * s * s
    )
    F = Contact(
        "N", "friction", mode=mode, slip=slip, slide=F_c + (F_s - F_c) * share + b * fabs(slip), hold=hold
    )
    a = Output("m/s2", "acceleration", (-k * x - c * v - F) / m, rate_of=v)
'''


class End(NamedTuple):
    """What a motion ends in: "steady sliding", "stick-slip" or "sliding orbit"; period and maximum.

    Of a motion that has not settled after MAX_TURNS, `decay` is the factor by which it does in a turn.
    """

    kind: str
    period: float = nan
    largest: float = nan
    decay: float = nan


class Oscillator:
    """The same oscillator for scipy, with values by name."""

    def __init__(self, values):
        self.__dict__.update(values)

    @property
    def amplitude(self):
        """Return about the amplitude in m from which a motion sticks."""
        return self.v_b * sqrt(self.m / self.k)

    def slide(self, slip):
        """Return the friction of a body that slides."""
        s = abs(slip) / self.v_s
        if self.law == "exponential":
            share = exp(-s)
        elif self.law == "stribeck":
            share = exp(-s * s)
        elif self.law == "hyperbola":
            share = 1.0 / (1.0 + s)
        else:
            share = 1.0 - 1.5 * s + 0.5 * s**3
        return self.F_c + (self.F_s - self.F_c) * share + self.b * abs(slip)

    def slip(self, t, x, v, sign):
        """Return time, position and speed at the next maximum of x, or where the body has the speed of the belt."""

        def rates(t, y):
            return y[1], (-self.k * y[0] - self.c * y[1] - sign * self.slide(y[1] - self.v_b)) / self.m

        def has_speed_of_belt(t, y):
            return y[1] - self.v_b

        def turns(t, y):
            return y[1]

        has_speed_of_belt.terminal, has_speed_of_belt.direction = True, -sign
        turns.terminal, turns.direction = 1 + (v == 0.0), -1  # a maximum at the start counts
        turn = 2 * np.pi * sqrt(self.m / self.k)
        options = {"rtol": 1e-12, "atol": 1e-14 * max(abs(x), abs(v)), "events": (has_speed_of_belt, turns)}
        run = solve_ivp(rates, (0.0, 20 * turn), (x, v), "DOP853", **options)
        return t + run.t[-1], run.y[0, -1], self.v_b if len(run.t_events[0]) else 0.0

    def next_maximum(self, t, x, v):
        """Return time and value of the next maximum of x, and whether the body sticks before it."""
        sign, sticks = 1.0 if v > self.v_b else -1.0, False
        while True:
            if v == self.v_b:
                load = -self.k * x - self.c * v
                if abs(load) <= self.hold:  # it rides along until the spring pulls it off
                    off = (self.hold - self.c * v) / self.k
                    t, x, sign, sticks = t + (off - x) / v, off, -1.0, True
                else:
                    sign = 1.0 if load > 0.0 else -1.0
            t, x, v = self.slip(t, x, v, sign)
            if not v:
                return t, x, sticks

    def follow(self, x, v):
        """Return what the motion from x and v ends in; of a slow one, the maximum that repeats by bisection."""
        steady, maxima = self.slide(-self.v_b) / self.k, []
        time, x, sticks = self.next_maximum(0.0, x, v)
        for number in range(30 * MAX_TURNS):
            if number >= MAX_TURNS and abs(x - maxima[-1]) < abs(maxima[-1] - maxima[-2]):
                break  # it settles slowly; others still move away from where they started
            maxima.append(x)
            t, x, sticks = self.next_maximum(time, x, 0.0)
            if abs(x - steady) <= STEADY * self.amplitude:
                return End("steady sliding")
            if abs(x - maxima[-1]) <= SETTLED_DIFFERENCE * abs(x - steady):
                return End("stick-slip" if sticks else "sliding orbit", t - time, x)
            time = t
        decay = (x - maxima[-1]) / (maxima[-1] - maxima[-2])
        size, factor = x - steady, 0.5 if x < maxima[-1] else 2.0

        def gain(size):
            return self.next_maximum(0.0, steady + size, 0.0)[1] - steady - size

        while size > STEADY * self.amplitude and gain(factor * size) * (factor - 1.0) > 0.0:
            size *= factor
        if size <= STEADY * self.amplitude:
            return End("steady sliding", decay=decay)
        x = steady + brentq(gain, size, factor * size, xtol=1e-15, rtol=1e-14)
        for _ in range(2):  # it may be where motions begin to stick
            t, x, sticks = self.next_maximum(0.0, x, 0.0)
        return End("stick-slip" if sticks else "sliding orbit", t, x, decay)


def draw_values(random):
    """Return values of the parameters of an oscillator."""
    m, k, F_s = 10.0 ** random.uniform((-1.0, 1.0, -1.0), (1.0, 4.0, 2.0))
    scale = F_s / sqrt(k * m)  # of speeds
    law = LAWS[random.integers(len(LAWS))]
    values = {
        "m": m,
        "k": k,
        "c": sqrt(k * m) * 10.0 ** random.uniform(-2.5, -0.7),
        "b": sqrt(k * m) * random.choice([0.0, 10.0 ** random.uniform(-3.0, -1.0)]),
        "hold": F_s * random.choice([1.0, random.uniform(1.0, 1.3)]),
        "F_s": F_s,
        "F_c": F_s * random.uniform(0.2, 0.95),
        "v_s": scale * 10.0 ** random.uniform(-1.5, 0.5),
        "v_b": scale * 10.0 ** random.uniform(-1.3, 0.5),
    }
    if law == "polynomial":  # it rises steeply beyond v_s
        values["v_s"] = values["v_b"] * 10.0 ** random.uniform(-0.1, 0.7)
    return {name: float(value) for name, value in values.items()} | {"law": law}


def check(fmu, values):
    """Return what motions of an oscillator end in, and lines of failures."""
    oscillator, v_b = Oscillator(values), values["v_b"]
    off, steady = (values["hold"] - values["c"] * v_b) / values["k"], oscillator.slide(-v_b) / values["k"]
    starts = [(off, v_b), *((steady + share * oscillator.amplitude, 0.0) for share in (0.01, 0.7))]
    ends = [oscillator.follow(*start) for start in starts]
    result = harness.orbit(fmu, values, progress=False)
    stable = [motion for motion in result.motions if motion.stability == "stable"]
    failures = []
    for end in ends:
        matching_motions = [motion for motion in stable if motion.kind == end.kind]
        if end.kind != "steady sliding":
            matching_motions = [
                motion
                for motion in matching_motions
                if abs(motion.period / end.period - 1.0) <= PRECISION
                and abs(motion.largest - end.largest) <= AMPLITUDE_TOLERANCE * abs(end.largest - steady)
            ]
        if not matching_motions:
            motions = [(motion.kind, motion.stability, motion.period, motion.largest) for motion in result.motions]
            failures.append(f"{end} is not among {motions} {result.remarks}")
    return ends, failures


def main(count, seed):
    """Check oscillators; return the exit status."""
    counts, decays, n_failed = Counter(), [], 0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "rubbed.py")
        file.write_text(MODEL, encoding="utf-8")
        subprocess.run([sys.executable, "-m", "harness", "build", file, "--native", "--out", folder], check=True)
        for number in range(count):
            values = draw_values(np.random.default_rng((seed, number)))
            ends, failures = check(file.with_suffix(".fmu"), values)
            counts.update(end.kind for end in ends)
            decays += [float(end.decay) for end in ends if end.decay == end.decay]
            print(f"{number + 1} of {count}", end="\r", file=sys.stderr, flush=True)
            n_failed += bool(failures)
            for failure in dict.fromkeys(failures):
                print(f"{number}: {failure}\n    {values}", flush=True)
    print(f"{count} oscillators, {n_failed} with failures; motions: {dict(counts)}")
    if decays:
        factors = f"{min(decays):.4g} to {max(decays):.4g}"
        print(f"{len(decays)} motions had not settled after {MAX_TURNS} turns: they do by {factors} in a turn")
    return int(n_failed > 0)


if __name__ == "__main__":
    arguments = [*map(int, sys.argv[1:])]
    sys.exit(main(*(arguments + [200, 64][len(arguments) :])))
