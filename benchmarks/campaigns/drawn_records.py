"""Records with known parameters, drawn at random: models, parameters, sampling and noise."""

from dataclasses import dataclass, field, replace

import numpy as np

MAX_FACTOR = 3.0  # of a true value over the start value of the FMU
FINE_POINTS = 20_000  # of a run under a force that is known between the samples as well


@dataclass(frozen=True)
class Group:
    """Records of one kind: model, outputs, free parameters, stop time in s."""

    model: str
    outputs: tuple[str, ...]
    free: tuple[str, ...]
    stop: float
    record_of: str = ""  # another model that makes the record


GROUPS = {
    "position, 3 free": Group("stickslip", ("x",), ("mu_s", "mu_d", "k"), 16.0),
    "position, 4 free": Group("stickslip", ("x",), ("mu_s", "mu_d", "k", "v_driver"), 16.0),
    "position, 5 free": Group("stickslip", ("x",), ("mu_s", "mu_d", "k", "v_driver", "x0"), 16.0),
    "force": Group("stickslip", ("F_spring",), ("mu_s", "mu_d", "k", "v_driver"), 16.0),
    "forced": Group("coulomb", ("x",), ("m", "k", "f", "c"), 10.0),
    "pendulum": Group("pendulum", ("theta",), ("mu", "J_G", "theta0"), 5.0),
    "Stribeck": Group("stribeck_sled", ("x",), ("k", "f_s", "f_d", "v_s"), 16.0),
    "belt": Group("belt", ("x",), ("k", "f_s", "f_d", "v_belt"), 10.0),
    "two sleds": Group("sleds", ("x1", "x2"), ("k", "slide1", "slide2", "hold1", "hold2"), 16.0),
    "k and m": Group("stickslip", ("x",), ("mu_s", "mu_d", "k", "m"), 16.0),
    "wrong law": Group("stickslip", ("x",), ("mu_s", "mu_d", "k", "v_driver"), 16.0, "stribeck_sled"),
}
LARGER = {"mu_s": "mu_d", "f_s": "f_d", "hold1": "slide1", "hold2": "slide2"}  # static over sliding friction


@dataclass(frozen=True)
class DrawnRecord:
    """A record: times (n,), columns (n, outputs), the true values, ranges to search, and what is known."""

    t: np.ndarray
    y: np.ndarray
    truth: dict[str, float]
    free: dict[str, tuple[float, float] | None]
    noise: str
    fixed_values: dict[str, float] = field(default_factory=dict)
    inputs: dict[str, np.ndarray] = field(default_factory=dict)


def draw_record(group, simulator, random, max_samples=20_000):
    """Draw a record of a group.

    Parameters
    ----------
    group : Group
    simulator : harness.simulation.whole_run.Simulator
        Of the model that makes the record.
    random : numpy.random.Generator
    max_samples : int
    """
    start = {name: variable.start for name, variable in simulator.variables.items()}
    names = group.free if not group.record_of else ("k", "f_s", "f_d", "v_s")
    free = dict.fromkeys(group.free)
    t = draw_times(group.stop, random, max_samples)
    truth = {name: start[name] * factor(random) for name in names if start[name]}
    for static, sliding in LARGER.items():
        if sliding in truth:
            truth[sliding] = truth[static] * random.uniform(0.3, 0.95)
    fixed_values, inputs, run_inputs = {}, {}, {}
    if "x0" in names:
        reach = truth["mu_s"] * start["m"] * start["g"] / truth["k"]
        truth["x0"], free["x0"] = random.uniform(-1, 1) * reach, (-0.5, 0.5)
    if "theta0" in names:
        truth["theta0"], free["theta0"] = random.uniform(0.05, 1.5), (-2.0, 2.0)
    if group.model == "coulomb":
        truth["c"], free["c"], fixed_values["x0"] = random.uniform(0, 3), (0.0, 10.0), 0.0
        force = draw_force(truth["f"], random)
        inputs["F_ext"] = force(t)
        parts = -(-FINE_POINTS // len(t))
        fine = np.append((t[:-1, None] + np.diff(t)[:, None] * np.arange(parts) / parts).ravel(), t[-1])
        run_inputs = {"time": fine, "F_ext": force(fine)}
    run = replace(simulator.spec, outputs=group.outputs, times=t, inputs=run_inputs, follow=False)
    clean = simulator.prepare(run)(truth | fixed_values)
    y, noise = add_noise(clean, random)
    if group.record_of:
        truth = {"k": truth["k"], "mu_s": truth["f_s"] / (start["m"] * 9.81), "v_driver": start["v_driver"]}
    return DrawnRecord(t, y, truth, free, f"{noise}, n = {len(t)}", fixed_values, inputs)


def factor(random):
    """Return a factor between 1/MAX_FACTOR and MAX_FACTOR."""
    return float(np.exp(random.uniform(-np.log(MAX_FACTOR), np.log(MAX_FACTOR))))


def draw_times(stop, random, max_samples):
    """Return 200 to `max_samples` times (n,) in s; in three of ten records they are uneven."""
    n = int(np.exp(random.uniform(np.log(200), np.log(max_samples))))
    if random.random() < 0.3:
        return np.concatenate([[0.0], np.sort(random.uniform(0, stop, n - 2)), [stop]])
    return np.linspace(0, stop, n)


def draw_force(friction, random):
    """Return a force over time: two sines of 0.3 to 3 Hz, up to five times the friction."""
    omega = 2 * np.pi * random.uniform(0.3, 3.0, 2)
    amplitude, phase = random.uniform(1, 5, 2) * friction, random.uniform(0, 2 * np.pi, 2)
    return lambda t: sum(a * np.sin(w * t + p) for a, w, p in zip(amplitude, omega, phase, strict=True))


def add_noise(clean, random):
    """Add white or coloured noise of 0.1 to 3 % of the range of each column, or quantise to such steps."""
    size = np.exp(random.uniform(np.log(1e-3), np.log(3e-2))) * np.where(
        np.ptp(clean, axis=0), np.ptp(clean, axis=0), 0.01
    )
    kind = str(random.choice(["white", "white", "white", "coloured", "quantised"]))
    e = random.normal(size=clean.shape) * size
    if kind == "coloured":
        for i in range(1, len(e)):
            e[i] = 0.8 * e[i - 1] + 0.6 * e[i]
    if kind == "quantised":
        return np.round((clean + 0.05 * e) / size) * size, kind
    return clean + e, kind
