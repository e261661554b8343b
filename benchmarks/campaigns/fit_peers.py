"""Fit ten drawn records with `harness.fit` and with other tools.

    python -m benchmarks.campaigns.fit_peers [--records 10]

Peers: least squares of lmfit and differential evolution of scipy, both with scipy's solve_ivp and friction smoothed by
tanh, and ModestPy, which runs the same FMU as `harness.fit`. Each may take ten times the processor time of the fit,
at least 20 s; `--budget` changes the 20 s. "Found": each value is within 5 % of the truth or five standard errors of
the fit. What a package cannot fit is a failure, with its reason. `--modestpy` names the Python of an environment with
ModestPy (fit_modestpy.py).

The records are drawn as in fit_campaign.py, those with even times: stick-slip by position with three unknowns, and
forced Coulomb friction with four.
"""

import argparse
import contextlib
import inspect
import io
import json
import platform
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from math import exp, isfinite, tanh
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas
from scipy.integrate import solve_ivp
from scipy.optimize import differential_evolution

import harness
from harness.process.temporary_directory import temporary_directory
from harness.scenes.run_spec import RunSpec
from harness.simulation.whole_run import open_simulator

from . import fit_modestpy
from .drawn_records import GROUPS, draw_record
from .fit_campaign import build_fmus, cpu_seconds

KINDS = ("position, 3 free", "forced")
SEED, MAX_SAMPLES = 20261123, 400
BUDGET, LEAST_BUDGET = 10, 20.0  # times the processor time of the fit; s
CLOSE, ERRORS = 0.05, 5.0


# ---- what a user of each tool writes


def stickslip_rates(t, y, m, k, mu_s, mu_d, v_driver, g=9.81):
    """Return the rates of a pulled block, with friction that is smoothed far below the speeds of its slips."""
    x, v = y.tolist()
    mu = (mu_d + (mu_s - mu_d) * exp(-((v / 1e-4) ** 2))) * tanh(v / 1e-6)
    return [v, (k * (v_driver * t - x) - mu * m * g) / m]


def coulomb_rates(t, y, m, k, f, c, times, force):
    """Return the rates of a forced oscillator with smoothed friction."""
    x, v = y.tolist()
    return [v, (np.interp(t, times, force) - k * x - c * v - f * tanh(v / 1e-3)) / m]


def smoothed_run(t, free, known_values, force):
    """Return the positions at the times."""
    rates, start = (
        (stickslip_rates, [0.0, 0.0]) if force is None else (coulomb_rates, [known_values.get("x0", 0.0), 0.0])
    )
    values = {name: value for name, value in {**known_values, **free}.items() if name != "x0"}
    extra = {} if force is None else {"times": t, "force": force}
    run = solve_ivp(
        lambda t, y: rates(t, y, **values, **extra), t[[0, -1]], start, "LSODA", t, rtol=1e-6, atol=1e-9, max_step=0.05
    )
    return run.y[0] if run.y.shape[1] == len(t) else np.full(len(t), 1e6)


def fit_with_lmfit(t, x, free, known_values, force):
    """Fit by least squares from the start values."""
    import lmfit

    parameters = lmfit.Parameters()
    for name, (start, low, high) in free.items():
        parameters.add(name, value=start, min=low, max=high)
    result = lmfit.minimize(lambda p: smoothed_run(t, p.valuesdict(), known_values, force) - x, parameters)
    return result.params.valuesdict()


def fit_with_scipy(t, x, free, known_values, force):
    """Fit by differential evolution in the ranges."""

    def squares(values):
        return np.sum((smoothed_run(t, dict(zip(free, values, strict=True)), known_values, force) - x) ** 2)

    bounds = [(low, high) for _, low, high in free.values()]
    result = differential_evolution(squares, bounds, seed=1)
    return dict(zip(free, result.x, strict=True))


def fit_with_harness(t, x, free, known_values, force, fmu):
    """Fit in the ranges."""
    frame = pandas.DataFrame({"t": t, "x": x, "F_ext": 0.0 if force is None else force})
    ranges = {name: (low, high) for name, (_, low, high) in free.items()}
    return harness.fit(fmu, frame, ranges, observe="x", inputs=[] if force is None else ["F_ext"], values=known_values)


# ---- the comparison


@dataclass(frozen=True)
class Peer:
    """A tool: its package, the function that fits, all functions that a user writes, and whether it runs the FMU."""

    package: str
    fit: Callable
    functions: tuple[Callable, ...]
    runs_fmu: bool = False


@dataclass(frozen=True)
class Attempt:
    """A fit of one record by one tool: its values, or why it has none, and its processor time in s."""

    values: dict[str, float]
    failure: str
    seconds: float
    is_found: bool = False


def run_modestpy(python, t, x, free, known_values, force, fmu):
    """Fit with ModestPy in the environment of an interpreter."""
    record = {"t": t.tolist(), "x": x.tolist(), "force": None if force is None else force.tolist()}
    request = json.dumps(record | {"free": free, "known_values": known_values, "fmu": str(fmu)})
    process = subprocess.run(
        [python, "-W", "ignore", fit_modestpy.__file__], input=request, capture_output=True, text=True
    )
    if process.returncode == -signal.SIGXCPU:
        raise TimeoutError("stopped")
    if process.returncode:
        raise RuntimeError((process.stderr.strip() or "no message").splitlines()[-1])
    return json.loads(process.stdout.splitlines()[-1])


MODELS = (smoothed_run, stickslip_rates, coulomb_rates)
PEERS = {
    "lmfit": Peer("lmfit", fit_with_lmfit, (fit_with_lmfit, *MODELS)),
    "scipy": Peer("scipy", fit_with_scipy, (fit_with_scipy, *MODELS)),
    "ModestPy": Peer("modestpy", partial(run_modestpy, sys.executable), (fit_modestpy.fit_with_modestpy,), True),
}


def lines_of_code(*functions):
    """Return the number of lines, without those of docstrings and blank ones."""
    total = 0
    for function in functions:
        text = inspect.getsource(function).replace(inspect.cleandoc(function.__doc__), "")
        total += sum(1 for line in text.splitlines() if line.strip() and line.strip() != '""""""')
    return total


def version_of(package, python):
    """Return the version of a package of an interpreter, or None if it is not installed."""
    if python == sys.executable:
        try:
            return version(package)
        except PackageNotFoundError:
            return None
    code = f"from importlib.metadata import version; print(version({package!r}))"
    process = subprocess.run([python, "-c", code], capture_output=True, text=True)
    return None if process.returncode else process.stdout.strip()


def draw_even_record(name, number, fmus):
    """Return the first drawn record of this number with even times, and the start values of the FMU."""
    group = GROUPS[name]
    with open_simulator(RunSpec(fmus / f"{group.model}.fmu")) as simulator:
        for attempt in range(100):
            random = np.random.default_rng([SEED, KINDS.index(name), number, attempt])
            record = draw_record(group, simulator, random, max_samples=MAX_SAMPLES)
            if np.ptp(np.diff(record.t)) < 1e-9:
                return record, {key: variable.start for key, variable in simulator.variables.items()}
    raise RuntimeError("no record has even times")


def run_peer(function, arguments, budget, connection):
    """Send the values or a failure, and the processor time, of a peer; a signal ends it when its time is used."""
    start = cpu_seconds()
    limit = int(start + budget)
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    values, failure = {}, ""
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            values = {name: float(value) for name, value in function(*arguments).items()}
        except TimeoutError:
            return
        except Exception as error:  # a package may fail in any way
            failure = f"{type(error).__name__}: {error}"
    connection.send(Attempt(values, failure, cpu_seconds() - start))


def call_peer(function, arguments, budget):
    """Return the attempt of a peer in a child process."""
    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=run_peer, args=(function, arguments, budget, sender))
    process.start()
    sender.close()
    try:
        return receiver.recv()
    except EOFError:
        return Attempt({}, "stopped", budget)
    finally:
        process.join()


def is_found(values, fit, truth):
    """Return whether all values are close to the truth."""
    errors = {name: fit[name].error if isfinite(fit[name].error) else 0.0 for name in truth}
    return all(
        abs(values[name] - true) <= max(CLOSE * abs(true), ERRORS * errors[name]) for name, true in truth.items()
    )


def fit_record(number, fmus, peers, least_budget=LEAST_BUDGET):
    """Fit a record with `harness.fit` and the peers; return the attempts by tool."""
    name = KINDS[number % len(KINDS)]
    record, start = draw_even_record(name, number // len(KINDS), fmus)
    fmu = fmus / f"{GROUPS[name].model}.fmu"
    free = {key: (start[key], start[key] / 4, 4 * start[key]) for key in record.truth if start[key]}
    free |= {key: (sum(ends) / 2, *ends) for key, ends in record.free.items() if ends and key not in free}
    force, x = record.inputs.get("F_ext"), record.y[:, 0]
    begin = cpu_seconds()
    fit = fit_with_harness(record.t, x, free, record.fixed_values, force, fmu)
    seconds = cpu_seconds() - begin
    attempts = {"harness.fit": Attempt(fit.values, "", seconds, is_found(fit.values, fit, record.truth))}
    for tool, peer in peers.items():
        known_values = dict(record.fixed_values)
        if not peer.runs_fmu:
            names = ("m", "k", "mu_s", "mu_d", "v_driver") if force is None else ("m", "k", "f", "c")
            known_values |= {key: start[key] for key in names if key not in free}
        arguments = (record.t, x, free, known_values, force, *((fmu,) if peer.runs_fmu else ()))
        attempt = call_peer(peer.fit, arguments, max(least_budget, BUDGET * seconds))
        is_right = not attempt.failure and is_found(attempt.values, fit, record.truth)
        attempts[tool] = Attempt(attempt.values, attempt.failure, attempt.seconds, is_right)
    return attempts


def print_table(attempts, lines, versions):
    """Print a line for each tool: successes, processor time, and lines of code."""
    own_seconds = float(np.median([record_attempts["harness.fit"].seconds for record_attempts in attempts]))
    print(f"{'':14}{'version':10}{'found':>8}{'stopped':>9}{'failed':>8}{'median s':>10}{'ratio':>8}{'lines':>7}")
    for tool in attempts[0]:
        tries = [record_attempts[tool] for record_attempts in attempts]
        failures = [attempt.failure for attempt in tries if attempt.failure not in ("", "stopped")]
        n_stopped, median = (
            sum(attempt.failure == "stopped" for attempt in tries),
            float(np.median([attempt.seconds for attempt in tries])),
        )
        n_found = f"{sum(attempt.is_found for attempt in tries)}/{len(tries)}"
        print(
            f"{tool:14}{versions[tool]:10}{n_found:>8}{n_stopped:9}{len(failures):8}{median:10.1f}"
            f"{median / own_seconds:8.1f}{lines[tool]:7}"
        )
        for failure in dict.fromkeys(failures):
            print(f"{'':14}failed: {failure}")


def main():
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--records", type=int, default=10)
    options.add_argument("--fmus", type=Path, help="folder of native FMUs that exist already")
    options.add_argument("--peer", action="append", choices=[*PEERS], help="only this peer; repeatable")
    options.add_argument("--modestpy", metavar="PYTHON", default=sys.executable, help="interpreter that has ModestPy")
    options.add_argument("--budget", type=float, default=LEAST_BUDGET, help="least processor time in s of a peer")
    options.add_argument("--processes", type=int, default=1, help="number of records that are fitted at the same time")
    arguments = options.parse_args()
    peers = {tool: PEERS[tool] for tool in arguments.peer or PEERS}
    versions = {"harness.fit": version("friction-fmus")}
    for tool, peer in [*peers.items()]:
        python = arguments.modestpy if tool == "ModestPy" else sys.executable
        versions[tool] = version_of(peer.package, python)
        if versions[tool] is None:
            print(f"{tool} is skipped: {peer.package} is not installed")
            del peers[tool]
        elif tool == "ModestPy":
            peers[tool] = Peer(peer.package, partial(run_modestpy, python), peer.functions, peer.runs_fmu)
    attempts = []
    with temporary_directory("peers-") as folder, ProcessPoolExecutor(arguments.processes) as pool:
        fmus = arguments.fmus or build_fmus(folder)
        compare = partial(fit_record, fmus=fmus, peers=peers, least_budget=arguments.budget)
        for record_attempts in pool.map(compare, range(arguments.records)):
            attempts.append(record_attempts)
            print(
                len(attempts),
                {
                    tool: (attempt.is_found, round(attempt.seconds, 1), attempt.failure)
                    for tool, attempt in record_attempts.items()
                },
            )
            sys.stdout.flush()
    print(f"Python {platform.python_version()}, {platform.machine()}, scipy {version('scipy')}")
    lines = {"harness.fit": lines_of_code(fit_with_harness)}
    print_table(attempts, lines | {tool: lines_of_code(*peer.functions) for tool, peer in peers.items()}, versions)


if __name__ == "__main__":
    main()
