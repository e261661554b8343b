"""Fit ten drawn records with `harness.fit` and with other tools: python tests/support/fit_peers.py [--records 10]

Peers: least squares of lmfit and differential evolution of scipy, both with scipy's solve_ivp and friction smoothed by
tanh, and ModestPy, which runs the same FMU as `harness.fit`. Each may take ten times the processor time of the fit, at
least 10 s. "Found": each value is within 5 % of the truth or five standard errors of the fit. A package that is not
installed, or fails, is a gap, with its reason.

The records are drawn as in fit_campaign.py, those with even times: stick-slip by position with three unknowns, and
forced Coulomb friction with four.
"""

import argparse
import contextlib
import inspect
import io
import multiprocessing
import os
import platform
import resource
import sys
import tempfile
from importlib.metadata import PackageNotFoundError, version
from math import isfinite
from pathlib import Path
from time import process_time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]

import numpy as np  # noqa: E402
import pandas  # noqa: E402
from drawn_records import GROUPS, draw_record  # noqa: E402
from fit_campaign import build_fmus  # noqa: E402
from scipy.integrate import solve_ivp  # noqa: E402
from scipy.optimize import differential_evolution  # noqa: E402

import harness  # noqa: E402
from harness.process.temporary_directory import temporary_directory  # noqa: E402
from harness.running.whole_run import open_simulator  # noqa: E402
from harness.scenes.run_spec import RunSpec  # noqa: E402

KINDS = ("position, 3 free", "forced")
SEED, MAX_SAMPLES = 20261123, 400
BUDGET, LEAST_BUDGET = 10, 10.0  # times the processor time of the fit; s
CLOSE, ERRORS = 0.05, 5.0
SPEED = 1e-3  # m/s, at which smoothed friction is complete


# ---- what a user of each tool writes


def stickslip_rates(t, y, m, k, mu_s, mu_d, v_driver, g=9.81):
    """Return the rates of a pulled block with smoothed friction."""
    x, v = y
    mu = (mu_d + (mu_s - mu_d) * np.exp(-((v / (5 * SPEED)) ** 2))) * np.tanh(v / SPEED)
    return [v, (k * (v_driver * t - x) - mu * m * g) / m]


def coulomb_rates(t, y, m, k, f, c, times, force):
    """Return the rates of a forced oscillator with smoothed friction."""
    x, v = y
    return [v, (np.interp(t, times, force) - k * x - c * v - f * np.tanh(v / SPEED)) / m]


def smoothed_run(t, free, known, force):
    """Return the positions at the times."""
    rates, start = (stickslip_rates, [0.0, 0.0]) if force is None else (coulomb_rates, [known.get("x0", 0.0), 0.0])
    values = {name: value for name, value in {**known, **free}.items() if name != "x0"}
    extra = {} if force is None else {"times": t, "force": force}
    run = solve_ivp(
        lambda t, y: rates(t, y, **values, **extra), t[[0, -1]], start, "LSODA", t, rtol=1e-6, atol=1e-9, max_step=0.05
    )
    return run.y[0] if run.y.shape[1] == len(t) else np.full(len(t), 1e6)


def fit_with_lmfit(t, x, free, known, force):
    """Fit by least squares from the start values."""
    import lmfit

    parameters = lmfit.Parameters()
    for name, (start, low, high) in free.items():
        parameters.add(name, value=start, min=low, max=high)
    found = lmfit.minimize(lambda p: smoothed_run(t, p.valuesdict(), known, force) - x, parameters)
    return found.params.valuesdict()


def fit_with_scipy(t, x, free, known, force):
    """Fit by differential evolution in the ranges."""

    def squares(values):
        return np.sum((smoothed_run(t, dict(zip(free, values, strict=True)), known, force) - x) ** 2)

    bounds = [(low, high) for _, low, high in free.values()]
    found = differential_evolution(squares, bounds, seed=1)
    return dict(zip(free, found.x, strict=True))


def fit_with_modestpy(t, x, free, known, force, fmu):
    """Fit by a genetic algorithm and pattern search."""
    from modestpy import Estimation

    index = pandas.Index(t, name="time")
    inputs = pandas.DataFrame({"F_ext": np.zeros(len(t)) if force is None else force}, index=index)
    measured = pandas.DataFrame({"x": x}, index=index)
    one_process = {"workers": 1}
    estimation = Estimation(os.getcwd(), str(fmu), inputs, known, free, measured, modestga_opts=one_process)
    estimates, _ = estimation.estimate()
    return estimates


def fit_with_harness(t, x, free, known, force, fmu):
    """Fit in the ranges."""
    frame = pandas.DataFrame({"t": t, "x": x, "F_ext": 0.0 if force is None else force})
    ranges = {name: (low, high) for name, (_, low, high) in free.items()}
    return harness.fit(fmu, frame, ranges, observe="x", inputs=[] if force is None else ["F_ext"], fixed=known)


# ---- the comparison


def lines_of_code(*functions):
    """Return the number of lines, without those of docstrings and blank ones."""
    total = 0
    for function in functions:
        text = inspect.getsource(function).replace(inspect.cleandoc(function.__doc__), "")
        total += sum(1 for line in text.splitlines() if line.strip() and line.strip() != '""""""')
    return total


PEERS = {  # module, function, all functions that a user writes, and whether it runs the FMU
    "lmfit": ("lmfit", fit_with_lmfit, (fit_with_lmfit, smoothed_run, stickslip_rates, coulomb_rates), False),
    "scipy": ("scipy", fit_with_scipy, (fit_with_scipy, smoothed_run, stickslip_rates, coulomb_rates), False),
    "ModestPy": ("modestpy", fit_with_modestpy, (fit_with_modestpy,), True),
}


def draw_even_record(name, number, fmus):
    """Return the first drawn record of this number with even times, and the start values of the FMU."""
    group = GROUPS[name]
    with open_simulator(RunSpec(fmus / f"{group.model}.fmu")) as simulator:
        for attempt in range(100):
            random = np.random.default_rng([SEED, KINDS.index(name), number, attempt])
            record = draw_record(group, simulator, random, max_samples=MAX_SAMPLES)
            if np.ptp(np.diff(record.t)) < 1e-9:
                return record, {key: each.start for key, each in simulator.variables.items()}
    raise RuntimeError("no record has even times")


def run_peer(function, arguments, budget, connection):
    """Send the values and the processor time of a peer; it ends by a signal when its time is used."""
    resource.setrlimit(resource.RLIMIT_CPU, (int(process_time() + budget), int(process_time() + budget) + 1))
    begun = process_time()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        os.chdir(folder)
        try:
            values = {name: float(value) for name, value in function(*arguments).items()}
        except Exception as error:  # a package may fail in any way
            values = f"fails: {type(error).__name__}: {error}"
        os.chdir("/")
    connection.send((values, process_time() - begun))


def call_peer(function, arguments, budget):
    """Return the values, None if the time was used or a text if the peer failed, and the processor time."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=run_peer, args=(function, arguments, budget, sender))
    process.start()
    sender.close()
    try:
        return receiver.recv()
    except EOFError:
        return None, budget
    finally:
        process.join()


def is_found(values, found, truth):
    """Return whether all values are close to the truth."""
    errors = {name: found[name].error if isfinite(found[name].error) else 0.0 for name in truth}
    return all(
        abs(values[name] - true) <= max(CLOSE * abs(true), ERRORS * errors[name]) for name, true in truth.items()
    )


def compare(n_records, fmus, peers):
    """Fit the records with all tools; return a line of results for each tool."""
    count = dict.fromkeys(("harness.fit", *PEERS), 0)
    seconds = {name: [] for name in count}
    gaps = {}
    for number in range(n_records):
        name = KINDS[number % len(KINDS)]
        record, start = draw_even_record(name, number // len(KINDS), fmus)
        fmu = fmus / f"{GROUPS[name].model}.fmu"
        free = {key: (start[key], start[key] / 4, 4 * start[key]) for key in record.truth if start[key]}
        free |= {key: (sum(ends) / 2, *ends) for key, ends in record.free.items() if ends and key not in free}
        force, x = record.inputs.get("F_ext"), record.y[:, 0]
        begun = process_time()
        found = fit_with_harness(record.t, x, free, record.fixed, force, fmu)
        seconds["harness.fit"].append(process_time() - begun)
        count["harness.fit"] += is_found(found.values, found, record.truth)
        budget = max(LEAST_BUDGET, BUDGET * seconds["harness.fit"][-1])
        for peer, (package, function, _, runs_fmu) in PEERS.items():
            if peer in gaps or peer not in peers:
                continue
            try:
                version(package)
            except PackageNotFoundError:
                gaps[peer] = f"{package} is not installed"
                continue
            known = dict(record.fixed)
            if not runs_fmu:
                names = ("m", "k", "mu_s", "mu_d", "v_driver") if force is None else ("m", "k", "f", "c")
                known |= {key: start[key] for key in names if key not in free}
            arguments = (record.t, x, free, known, force, *((fmu,) if runs_fmu else ()))
            values, used = call_peer(function, arguments, budget)
            if isinstance(values, str):
                gaps[peer] = values
                continue
            seconds[peer].append(used)
            count[peer] += values is not None and is_found(values, found, record.truth)
        print(number + 1, name, record.noise, {key: round(each[-1], 1) for key, each in seconds.items() if each}, count)
        sys.stdout.flush()
    return count, seconds, gaps


def main():
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--records", type=int, default=10)
    options.add_argument("--fmus", type=Path, help="folder of native FMUs that exist already")
    options.add_argument("--peer", action="append", choices=[*PEERS], help="only this peer; repeatable")
    given = options.parse_args()
    with temporary_directory("peers-") as folder:
        count, seconds, gaps = compare(given.records, given.fmus or build_fmus(folder), given.peer or [*PEERS])
    functions = {"harness.fit": (fit_with_harness,)} | {name: peer[2] for name, peer in PEERS.items()}
    packages = {"harness.fit": "friction-fmus"} | {name: peer[0] for name, peer in PEERS.items()}
    own = float(np.median(seconds["harness.fit"]))
    print(f"Python {platform.python_version()}, {platform.machine()}")
    print(f"{'':14}{'version':10}{'found':>8}{'median s':>10}{'ratio':>8}{'lines':>7}")
    for name in filter(lambda name: name in gaps or seconds[name], count):
        if name in gaps:
            print(f"{name:14}{gaps[name]}")
            continue
        median, lines = float(np.median(seconds[name])), lines_of_code(*functions[name])
        found = f"{count[name]}/{given.records}"
        print(f"{name:14}{version(packages[name]):10}{found:>8}{median:10.1f}{median / own:8.1f}{lines:7}")


if __name__ == "__main__":
    main()
