"""Records whose defect only their residuals show: `python -m benchmarks.campaigns.hidden_defects [RECORDS] [KIND ...]`.

RECORDS are drawn for each kind of defect (default: 60).  The table gives the share of 95 % intervals that hold, of
records refused, and of records that are wrong without a remark: a constant whose interval misses the true value, or the
range over which the true value drifts, by more than its own half width.  Decays with coloured noise, coarse steps or a
wandering amplitude are identified in halves, and the interval of the second is the true value of the first.  The exit
status is 1 if more than 1 % are wrong.
"""

import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from decays import random_record
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

import harness
from harness import HarnessError

RATE = 200.0  # Hz, of the records of friction


def draw_friction(rng):
    """Return the constants of Stribeck friction in N, m/s and N.s/m."""
    coulomb = rng.uniform(4.0, 12.0)
    static, speed = coulomb * rng.uniform(1.3, 1.8), rng.uniform(0.01, 0.03)
    return {"F_c": coulomb, "F_s": static, "v_s": speed, "F_v": coulomb * rng.uniform(1.0, 4.0), "bias": 0.0}


def friction(v, constants):
    """Return the friction (n,) at velocities v (n,)."""
    fall = np.exp(-((v / constants["v_s"]) ** 2))
    force = constants["F_c"] + (constants["F_s"] - constants["F_c"]) * fall
    return np.sign(v) * force + constants["F_v"] * v + constants["bias"]


def sweep(rng):
    """Return times and velocities of one to four cycles of a sine in 40 s."""
    t = np.arange(0, 40.0, 1 / RATE)
    return t, 0.2 * np.sin(2 * np.pi * rng.integers(1, 5) * t / 40.0)


def stairs(rng):
    """Return times and velocities of plateaus with pauses between them, in any order."""
    levels = np.geomspace(0.004, 0.2, 8)
    levels = rng.permutation(np.concatenate([levels, -levels]))
    parts = [
        np.concatenate([np.linspace(0, v, 20), np.full(360, v), np.linspace(v, 0, 20), np.zeros(80)]) for v in levels
    ]
    v = np.concatenate(parts)
    return np.arange(len(v)) / RATE, v


def curve_record(rng, kind):
    """Return the arguments of `identify_curve`, and the true values of each constant, one or two ends of a range."""
    truth = draw_friction(rng)
    is_sweep = kind in ("lag", "presliding") or (kind not in ("offset", "code") and rng.random() < 0.5)
    t, v = (sweep if is_sweep else stairs)(rng)
    force, share = friction(v, truth), rng.uniform(0.1, 0.3) * rng.choice([-1, 1])
    measured_speed, ranges = v, {name: [value] for name, value in truth.items()}
    if kind in ("drift", "viscous drift"):
        change = share * t / t[-1]
        part = np.sign(v) * abs(truth["F_c"]) if kind == "drift" else truth["F_v"] * v
        force = force + change * part
        names = ("F_c", "F_s") if kind == "drift" else ("F_v",)
        size = truth["F_c"] if kind == "drift" else truth["F_v"]
        ranges |= {name: [truth[name], truth[name] + share * size] for name in names}
    elif kind == "lag":
        force = lfilter([1 - (keep := np.exp(-1 / RATE / rng.uniform(0.02, 0.1)))], [1, -keep], force)
    elif kind == "presliding":
        x, distance = np.cumsum(v) / RATE, rng.uniform(2e-4, 1e-3)
        force = preslide(x, v, force, distance)
    elif kind == "offset":
        measured_speed = v + rng.uniform(0.01, 0.03) * rng.choice([-1, 1])
    elif kind == "code":
        step = rng.uniform(0.005, 0.015)
        measured_speed = (np.floor(v / step) + 0.5) * step
    rest_force = (v == 0) * np.repeat(rng.uniform(-1, 1, len(v) // 40 + 1), 40)[: len(v)]  # force at rest, by the drive
    force = force + rest_force * truth["F_c"] * (kind in ("offset", "code")) + 0.05 * rng.standard_normal(len(v))
    noise = 0.0 if kind == "code" else 1e-4
    record = {"t [s]": t, "v [m/s]": measured_speed + noise * rng.standard_normal(len(v)), "F [N]": force}
    return record, ranges


def preslide(x, v, force, distance):
    """Return the force (n,) that follows a reversal over a distance, as that of a spring with this reach."""
    result, at, start = force.copy(), 0.0, force[0]
    for i in range(1, len(x)):
        if v[i] * v[i - 1] < 0:
            at, start = x[i], result[i - 1]
        result[i] = force[i] + (start - force[i]) * np.exp(-abs(x[i] - at) / distance)
    return result


def check_curve(rng, kind):
    record, ranges = curve_record(rng, kind)
    curve = harness.identify_curve(record, mass=1e-9)
    return curve.estimates, ranges, [*curve.remarks, *(note for note in curve.points.notes if "tandstill" in note)]


def check_decay(rng, kind):
    t = np.arange(0, 40.0, 0.02)
    omega, zeta = rng.uniform(1.5, 6.0), rng.uniform(0.01, 0.1)
    if kind == "driven":
        drive, size = omega * rng.uniform(0.4, 1.6), rng.uniform(0.2, 1.0)
        motion = solve_ivp(
            lambda s, y: [y[1], -(omega**2) * y[0] - 2 * zeta * omega * y[1] + size * np.cos(drive * s)],
            (0, t[-1]), [1.0, 0.0], t_eval=t, rtol=1e-9, atol=1e-12,
        )  # fmt: skip
        x = motion.y[0] + 1e-3 * rng.standard_normal(len(t))
        ranges = {"omega": [omega * np.sqrt(1 - zeta**2)], "zeta": [zeta], "r": [0.0], "b": [0.0]}
    else:  # sustained: no loss, and an amplitude that wanders
        knots = np.linspace(0, t[-1], 30)
        wander = np.interp(t, knots, 0.25 * rng.standard_normal(30))
        x = (1 + wander) * np.cos(omega * t) + 0.03 * rng.standard_normal(len(t))
        ranges = {"zeta": [0.0], "r": [0.0], "b": [0.0]}
    fit = harness.identify_decay((t, x), unit="m")
    return fit.estimates, ranges, fit.remarks


def check_halves(rng, kind):
    """Identify both halves of a decay, whose rounding, noise or loss is that of a measurement; they must agree."""
    record, _, _ = random_record(int(rng.integers(2**31)), None, False, kind == "quantised", 1500, 0)
    x, n = record.x, len(record.t)
    size = np.ptp(x) / 2
    if kind == "coloured":
        x = x + 0.002 * size * lfilter([0.6], [1, -0.8], rng.standard_normal(n))
    elif kind == "wandering":  # the amplitude, by 2 %
        knots = np.linspace(0, n - 1, 7)
        walk = np.cumsum(rng.standard_normal(7)) / np.sqrt(7)
        x = x.mean() + (x - x.mean()) * (1 + 0.02 * np.interp(np.arange(n), knots, walk))
    stop = np.flatnonzero(np.abs(x - x[-1]) > 0.02 * size)[-1]  # the rest is no half
    halves = [slice(0, stop // 2), slice(stop // 2, n)]
    first, second = (harness.identify_decay((record.t[half], x[half]), unit="m") for half in halves)
    ranges = {estimate.name: [estimate.low, estimate.high] for estimate in second.estimates if estimate.name != "rest"}
    return first.estimates, ranges, [*first.remarks, *second.remarks]


def check_fit(rng, kind):
    """Fit a driven oscillator with dry friction to a record whose input has noise, or whose sensor lags or drifts."""
    truth = {"f": rng.uniform(0.5, 1.5), "c": rng.uniform(0.2, 1.0)}
    t = np.linspace(0, 10, 1001)
    force = 5.0 * np.sin(2 * np.pi * rng.uniform(0.3, 0.6) * t) + 3.0 * np.sin(2 * np.pi * rng.uniform(0.8, 1.5) * t)
    run = harness.simulate("coulomb", truth | {"x0": 0.0}, inputs={"time": t, "F_ext": force}, times=t)
    x = run["x"] + 1e-4 * np.ptp(run["x"]) * rng.standard_normal(len(t))
    noisy = force
    if kind == "input noise":
        noisy = force + 0.02 * np.ptp(force) * rng.standard_normal(len(t))
    elif kind == "sensor lag":
        x = np.interp(t - rng.uniform(0.005, 0.05), t, x)
    else:
        x += rng.uniform(0.02, 0.1) * np.ptp(x) * t / t[-1]
    fit = harness.fit(
        "coulomb", {"t [s]": t, "x [m]": x, "F_ext [N]": noisy}, {"f": (0.1, 4.0), "c": (0.0, 4.0)}, values={"x0": 0.0}
    )
    return fit.estimates, {name: [value] for name, value in truth.items()}, fit.remarks


KINDS = {
    **dict.fromkeys(("none", "drift", "viscous drift", "lag", "presliding", "offset", "code"), check_curve),
    **dict.fromkeys(("driven", "sustained"), check_decay),
    **dict.fromkeys(("coloured", "quantised", "wandering"), check_halves),
    **dict.fromkeys(("input noise", "sensor lag", "sensor drift"), check_fit),
}


def check_record(task):
    """Identify a record; return its kind, which intervals hold, which are far off, and the remarks or the refusal."""
    kind, number = task
    try:
        estimates, ranges, remarks = KINDS[kind](np.random.default_rng((number, len(kind))), kind)
    except HarnessError as refusal:
        return kind, number, None, [], str(refusal)
    coverage, far_values = [], []
    for estimate in estimates:
        name = estimate.name.rstrip("+-")
        if name not in ranges or not estimate.low <= estimate.high or np.isnan(ranges[name]).any():  # or no interval
            continue
        low, high = min(ranges[name]), max(ranges[name])
        coverage.append(estimate.low <= high and low <= estimate.high)
        if max(estimate.low - high, low - estimate.high) > (estimate.high - estimate.low) / 2:
            far_values.append(
                f"{estimate.name} {estimate.value:.4g} [{estimate.low:.4g}, {estimate.high:.4g}] for {low:.4g}"
            )
    return kind, number, coverage, far_values, " ".join(remarks)


def table_lines(rows):
    yield f"{'kind':14} {'records':>7} {'refused':>7} {'hold':>7} {'far':>5} {'silent':>7} {'remark':>7}"
    for kind in dict.fromkeys(row[0] for row in rows):
        group = [row for row in rows if row[0] == kind]
        coverage = [value for row in group for value in row[2] or ()]
        n_silent = sum(bool(row[3]) and not row[4] for row in group)
        n_far, n_remarked = (
            sum(bool(row[3]) for row in group),
            sum(row[2] is not None and bool(row[4]) for row in group),
        )
        n_refused = sum(row[2] is None for row in group)
        share = np.mean(coverage) if coverage else np.nan
        yield f"{kind:14} {len(group):7} {n_refused:7} {share:7.3f} {n_far:5} {n_silent:7} {n_remarked:7}"
    for kind, number, _, far_values, remarks in rows:
        if far_values:
            yield f"{kind} {number}: {', '.join(far_values)}: {remarks or 'NO REMARK'}"


if __name__ == "__main__":
    count, kinds = int((sys.argv[1:] or [60])[0]), sys.argv[2:] or [*KINDS]
    with ProcessPoolExecutor(2) as pool:
        rows = [*pool.map(check_record, [(kind, number) for kind in kinds for number in range(count)], chunksize=4)]
    print(*table_lines(rows), sep="\n")
    n_silent = sum(bool(far_values) and not remarks for _, _, _, far_values, remarks in rows)
    sys.exit(n_silent > 0.01 * len(rows))
