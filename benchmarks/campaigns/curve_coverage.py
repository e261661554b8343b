"""Coverage of the 95 % intervals of identified friction: `python -m benchmarks.campaigns.curve_coverage [RECORDS]`.

RECORDS points of friction over velocity (default: 900) are drawn, from each law in turn, every fifth as a record over
time with inertia, noise and ramps between its plateaus. The table states how often the drawn law has the smallest BIC,
and how often the intervals of the drawn law contain the drawn constants. The coverage of n records has a standard
deviation of sqrt(0.95 0.05/n).
"""

import sys
from collections import defaultdict

import numpy as np

import harness
from harness.analyses.curve.law_fit import LAWS

NAMES = ("F_c", "F_s", "v_s", "F_v", "bias")
DRAWN_LAWS = tuple(law for law in LAWS if law.name != "asymmetric-coulomb")  # which a bias replaces
PLATEAU, RAMP, REST = 400, 60, 20  # samples
RATE = 500.0  # Hz


def draw_constants(rng, law, suffix, v_max):
    """Return constants of one direction, in N, m/s and N.s/m."""
    coulomb = rng.uniform(5.0, 20.0)
    constants = {"F_c": coulomb}
    if law.exponent:
        constants |= {"F_s": coulomb * rng.uniform(1.3, 2.0), "v_s": v_max * 10 ** rng.uniform(-1.7, -1.0)}
    if law.is_viscous:
        constants["F_v"] = coulomb * rng.uniform(0.2, 1.5) / v_max
    return {f"{name}{suffix}": value for name, value in constants.items()}


def friction(law, constants, v):
    """Return the friction (n,) of a law at velocities v (n,)."""
    result = np.zeros(len(v))
    for suffix, mask in (("", v != 0),) if law.is_symmetric else (("+", v > 0), ("-", v < 0)):
        value = {name.removesuffix(suffix): number for name, number in constants.items() if name.endswith(suffix)}
        speed = np.abs(v[mask])
        fall = np.exp(-((speed / value["v_s"]) ** law.exponent)) if law.exponent else 0.0
        force = value["F_c"] + (value.get("F_s", value["F_c"]) - value["F_c"]) * fall + value.get("F_v", 0.0) * speed
        result[mask] = np.sign(v[mask]) * force
    return result


def draw_record(number):
    """Return the law, the constants, the arguments of `identify_curve`, and whether the record is one over time."""
    rng = np.random.default_rng(number)
    law = DRAWN_LAWS[number % len(DRAWN_LAWS)]
    v_max = 10 ** rng.uniform(-1, 0.5)
    speeds = np.geomspace(v_max * 10 ** rng.uniform(-3, -2.2), v_max, int(rng.integers(9, 20)))
    suffixes = ("",) if law.is_symmetric else ("+", "-")
    constants = {}
    for suffix in suffixes:
        constants |= draw_constants(rng, law, suffix, v_max)
    bias = rng.uniform(-3.0, 3.0) if law.is_symmetric else 0.0
    v = np.concatenate([speeds, -speeds]) * rng.uniform(0.95, 1.05, 2 * len(speeds))
    sigma = 10 ** rng.uniform(-2, -1)
    if number % 5:
        force = friction(law, constants, v) + bias + sigma * rng.standard_normal(len(v))
        return law, constants | {"bias": bias}, {"record": (v, force)}, False
    mass = rng.uniform(0.5, 5.0)
    parts = [
        np.concatenate([np.linspace(0, w, RAMP), np.full(PLATEAU, w), np.linspace(w, 0, RAMP), np.zeros(REST)])
        for w in rng.permutation(v)
    ]
    velocity = np.concatenate(parts)
    scatter = np.repeat(sigma * rng.standard_normal(len(v)), len(parts[0]))  # from plateau to plateau
    force = friction(law, constants, velocity) + bias + mass * np.gradient(velocity, 1 / RATE) + scatter
    force += 0.5 * rng.standard_normal(len(velocity))
    velocity = velocity + 1e-4 * v_max * rng.standard_normal(len(velocity))
    record = {"t [s]": np.arange(len(velocity)) / RATE, "v [m/s]": velocity, "F [N]": force}
    return law, constants | {"bias": bias}, {"record": record, "mass": mass}, True


def check_record(number):
    """Identify a drawn record; return its law, whether it is one over time, the chosen law, and what is covered."""
    law, constants, arguments, is_over_time = draw_record(number)
    curve = harness.identify_curve(**arguments)
    fit = curve.find_law(law.name)
    coverage = {}
    for estimate in fit.estimates if fit else ():
        coverage[estimate.name.rstrip("+-")] = estimate.low <= constants[estimate.name] <= estimate.high
    return law.name, is_over_time, curve.best.name, coverage, int((~curve.used).sum())


def table_lines(rows):
    """Yield the table of the coverage of each law."""
    yield f"{'drawn law':22} {'records':>7} {'chosen':>7} " + " ".join(f"{name:>6}" for name in NAMES) + "    all"
    groups = defaultdict(list)
    for row in rows:
        groups[row[0]].append(row)
        groups["all, over time" if row[1] else "all, points"].append(row)
        groups["all"].append(row)
    for name, group in groups.items():
        shares = [[row[3][key] for row in group if key in row[3]] for key in NAMES]
        cells = [f"{np.mean(share):6.3f}" if share else " " * 6 for share in shares]
        chosen_share = np.mean([row[0] == row[2] for row in group])
        total = np.mean([value for share in shares for value in share])
        yield f"{name:22} {len(group):7} {chosen_share:7.3f} {' '.join(cells)} {total:6.3f}"
    points = sum(row[4] for row in rows)
    yield f"{points} points of {len(rows)} records were left out as points that do not fit, though none was drawn."


if __name__ == "__main__":
    count = int((sys.argv[1:] or [900])[0])
    print(*table_lines([check_record(number) for number in range(count)]), sep="\n")
