"""Rounding errors of events do not accumulate: the last of 300 000 agrees with the closed form."""

from math import ulp

import pytest
from mpmath import atan2, cos, mpf, pi, sign, sqrt, workdps
from variants import campaign_after

DIGITS = 50
PLACES = 4  # units in the last place of the time


def fmu_at(fmu, values, start, stop):
    """Return the FMU at the time stop, after a few communication steps."""
    fmu.begin(values, start=start)
    times = [start + (stop - start) * i / 10 for i in range(10)] + [stop]
    return fmu.run(times, ["events.count", "events.t_last", "x"])[-1]


def assert_close_times(t, true):
    return abs(mpf(t) - true) <= PLACES * ulp(t)


LITTLE, LESS, OTHER = 1e-6, 1e-7, {"m": 0.7, "k": 1233.1}
SWINGS = [  # covers every pair of friction, values and backend
    (LITTLE, {}, "native"),
    (LITTLE, OTHER, "python"),
    (LESS, {}, "python"),
    (LESS, OTHER, "native"),
]


@pytest.mark.parametrize(("f", "values", "backend_fmus"), campaign_after(2, SWINGS), indirect=["backend_fmus"], ids=str)
def test_half_cycles_of_a_mass_with_little_friction_end_on_time(worker, backend_fmus, f, values):
    """Each lasts half a period and loses 2 f/k."""
    with workdps(DIGITS):
        number = int(0.03 / f)
        m, k = mpf(values.get("m", 1.0)), mpf(values.get("k", 157.9))
        half, loss = pi * sqrt(m / k), 2 * mpf(f) / k
        stop = float((number + mpf("0.25")) * half)
        fmu = worker.instantiate(backend_fmus / "coulomb.fmu")
        count, t, x = fmu_at(fmu, {"f": f, **values}, 0.0, stop)
        fmu.free()
        assert count == number
        assert assert_close_times(t, number * half)
        turning_point = (-1) ** number * (mpf(0.1) - number * loss)
        rest = sign(turning_point) * loss / 2
        assert abs(x - (rest + (turning_point - rest) * cos((mpf(stop) - number * half) * pi / half))) < 1e-9 * 0.1


SLEDS = {"default": {}, "to the other limit": {"mu_d": 0.0}, "backward": {"mu_s": 0.7, "mu_d": 0.3, "v_driver": -0.5}}


RUNS = [  # covers every pair of sled, start and backend
    ("default", 0.0, "python"),
    ("default", -77.7, "native"),
    ("to the other limit", 0.0, "native"),
    ("to the other limit", -77.7, "python"),
    ("backward", 0.0, "python"),
    ("backward", -77.7, "native"),
]


@pytest.mark.parametrize(("sled", "start", "backend_fmus"), campaign_after(2, RUNS), indirect=["backend_fmus"])
def test_slips_of_the_sled_end_on_time(worker, backend_fmus, sled, start):
    """It sticks while the spring is stretched from d - (h - d) to h, and slips through the angle 2 (pi - phi) with
    tan(phi) = w (h - d)/u, where h and d are the stretches at the static limit and at sliding friction.
    """
    with workdps(DIGITS):
        number = 100_000
        parameters = {"m": 12.5, "k": 742.5, "g": 9.81, "mu_s": 0.9, "mu_d": 0.6, "v_driver": 0.034, **SLEDS[sled]}
        m, k, g, mu_s, mu_d, v = (mpf(value) for value in parameters.values())
        h, d, w, u = mu_s * m * g / k, mu_d * m * g / k, sqrt(k / m), abs(v)
        slip, stick = 2 * (pi - atan2(w * (h - d), u)) / w, 2 * (h - d) / u
        first = mpf(start) + h / u
        last = first + (number - 1) * (slip + stick)
        stop = float(last + slip + stick / 2)
        fmu = worker.instantiate(backend_fmus / "stickslip.fmu")
        count, t, x = fmu_at(fmu, SLEDS[sled], start, stop)
        fmu.free()
        assert count == 2 * number
        assert assert_close_times(t, last + slip)
        path = number * (slip + stick) * v
        assert abs(x - path) < 1e-9 * 0.1
        assert assert_close_times(x, path)
