"""The numbers in the opening and the stories of the live page, computed by the native FMUs through `harness.simulate`.

The page computes them by the same C code in WebAssembly, with an importer of its own in JavaScript.
"""

import re
from functools import cache
from math import asin, degrees, radians

import native_fmus
import numpy as np

import harness

SCENE_STOP, CREEP_FROM = 4.3, 4.1  # s
BELT_STOP, SWING_STOP = 12.0, 6.0  # s
UNITS = {"": 1.0, "m": 1.0, "m/s": 1.0, "N": 1.0, "s": 1.0, "°": 1.0, "N·m": 1.0}
PREFIXES = {"m": 1e-3, "µ": 1e-6, "n": 1e-9}
UNITS |= {prefix + unit: size for prefix, size in PREFIXES.items() for unit in ("m", "m/s", "s", "N·m")}
NUMBER = re.compile(
    r"(?<!\w)(±?)(-?\d+(?:\.(\d+))?) ?("
    + "|".join(sorted(map(re.escape, UNITS), key=len, reverse=True))
    + r")(?![\w·/])"
)


def plain(text):
    """Return a text with plain minus signs and without the narrow spaces between groups of digits."""
    return (
        text.replace("\N{NARROW NO-BREAK SPACE}", "").replace("\N{MINUS SIGN}", "-").replace("\N{NO-BREAK SPACE}", " ")
    )


def read_numbers(text):
    """Return the numbers with units in a text, as (value in SI units, half a unit of the last digit)."""
    return [
        (float(number) * UNITS[unit], 0.5 * 10.0 ** -len(decimals or "") * UNITS[unit])
        for _, number, decimals, unit in NUMBER.findall(plain(text))
    ]


def shows(text, *values):
    """Whether a text has exactly these numbers, each rounded to its last digit."""
    numbers = read_numbers(text)
    return len(numbers) == len(values) and all(
        abs(number - value) <= half_digit * (1 + 1e-6)
        for (number, half_digit), value in zip(numbers, values, strict=True)
    )


def simulate(model, values=None, **options):
    return harness.simulate(native_fmus.build_native_fmus() / f"{model}.fmu", values or {}, **options)


def ode23(model, values, rtol, **options):
    """Run a model by ode23, with the absolute tolerance in the ratio of MATLAB's defaults."""
    return simulate(model, values | {"solver.atol": rtol / 1000}, method="ode23", rtol=rtol, **options)


@cache
def closed_form():
    """The motion of the opening by the default method."""
    return simulate("coulomb", stop=SCENE_STOP)


@cache
def opening_run(law, exponent):
    """A run of the opening under a friction law with the tolerance 10**exponent."""
    return ode23("coulomb", {"friction": law}, 10.0**exponent, stop=SCENE_STOP)


def last_step_before(run, t):
    """Return the number of steps that end at or before t."""
    return int(np.count_nonzero(run.steps.t[1:] <= t))


def creep(run):
    """Return the mean speed at the end."""
    x = run["x"]
    return abs(x[-1] - np.interp(CREEP_FROM, run.time, x)) / (run.time[-1] - CREEP_FROM)


def errors(*runs):
    """Return the distances of the ends of runs from the closed form."""
    return [abs(run["x"][-1] - closed_form()["x"][-1]) for run in runs]


def opening_numbers(exponent):
    """Return the numbers in the text of the opening."""
    true, sign = (opening_run(law, exponent) for law in ("hybrid", "sign"))
    fine = [opening_run(law, -4) for law in ("hybrid", "sign")]
    rows = [abs(run[name][-1]) for name in ("v", "F_spring", "F_friction") for run in (true, sign)]
    sentence = [SCENE_STOP, true.statistics.steps, true.events.t[-1], sign.statistics.steps, creep(sign)]
    accuracy = [number for run in fine for number in (run.statistics.steps, *errors(run))]
    return [*sentence, *errors(true, sign), *rows, 10, 4, *accuracy, closed_form().statistics.steps]


def chatters_numbers(exponent=-3):
    true, sign = (opening_run(law, exponent) for law in ("hybrid", "sign"))
    rest = closed_form().events.t[-1]

    def count(run):
        before = last_step_before(run, rest)
        return [before, run.statistics.steps - before, 0.3, run.statistics.rejected, *errors(run)]

    force = [abs(sign["F_friction"][-1]), abs(sign["F_spring"][-1])]
    return [*force, rest, *count(sign), *count(true), 0.3e-3]


def stops_numbers():
    run = simulate("coulomb", stop=5.0)
    band = run.parameters["f"] / run.parameters["k"]
    return [4 * band, np.count_nonzero(run.events.t > 0), run.events.t[-1], abs(run["x"][-1]), band]


def squeaks_numbers():
    run = simulate("stickslip", stop=BELT_STOP)
    (modes,) = run.events.modes.values()
    slips, holds = run.events.t[modes != 0], run.events.t[modes == 0]
    friction = [run.parameters["mu_d"], run.parameters["mu_s"]]
    return [*friction, len(slips), BELT_STOP, slips[-1] - slips[-2], holds[holds > slips[0]][0] - slips[0]]


def creeps_numbers(x_m=0.01):
    run = simulate("pacejka", {"x_m": x_m}, stop=BELT_STOP)
    row = int(np.argmax(run["v"] > x_m))
    share = (x_m - run["v"][row - 1]) / (run["v"][row] - run["v"][row - 1])
    x, t = (column[row - 1] + share * (column[row] - column[row - 1]) for column in (run["x"], run.time))
    exact = simulate("stickslip", stop=BELT_STOP)
    (modes,) = exact.events.modes.values()
    steps = [
        ode23(model, values, 1e-3, stop=BELT_STOP).statistics.steps
        for model, values in (("pacejka", {"x_m": x_m}), ("stickslip", {}))
    ]
    return [x_m, x - run["x"][0], t, exact.events.t[modes != 0][0], steps[0], 10, 3, steps[1]]


def swings_numbers():
    run = simulate("pendulum", {"theta0": radians(10)}, stop=SWING_STOP)
    mu, r, a = (run.parameters[name] for name in ("mu", "r", "a"))
    return [mu, 10, run.events.t[-1], degrees(abs(run["theta"][-1])), degrees(asin(mu * r / a))]
