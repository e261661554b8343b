"""Benchmarks of native FMUs against Python FMUs, through fmpy and in a C host, and against an FMU with SUNDIALS CVODE
(cvode.c)."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from math import nan
from pathlib import Path

import numpy as np

from harness.errors import HarnessError
from harness.process.subprocess_runner import run_subprocess
from harness.references.certified_reference import relative_errors
from harness.references.models import CASES, MODELS
from harness.scenes.fmu_files import find_fmu, list_more_models
from harness.scenes.run_spec import RunSpec

from ..c_host import Library, MissingToolError, compile_source, find_compiler, load_library
from ..stepping_loops import COMMUNICATION_STEPS, time_direct_loop, time_per_step
from .benchmark import SETTINGS, Baseline, Benchmark

Measurement = tuple[float, float, tuple[Baseline, ...]]  # value, target, baselines

CASES_BY_NAME = {case.name: case for case in CASES}

RUN_TIME_TARGETS: dict[str, float] = SETTINGS["in_c"]
TOLERANCES = (1e-4, 1e-6, 1e-8)  # relative tolerances of CVODE
REPEAT, REPEAT_PYTHON = 100, 5
CVODE_VARIABLES = ("x", "v", "z", "rtol", "atol", "x_m", "force", "rate")  # by value reference, as in cvode.c


def native_benchmarks() -> list[Callable[[], Benchmark]]:
    """Return the benchmarks of native FMUs."""
    return [
        *(partial(run_in_c, case) for case in RUN_TIME_TARGETS),
        *(partial(step_in_c, case) for case in RUN_TIME_TARGETS),
        *(partial(run_through_fmpy, model) for model in MODELS),
        *(partial(step_through_fmpy, model) for model in MODELS),
        *(partial(compare_with_cvode, case) for case in RUN_TIME_TARGETS),
    ]


def run_in_c(case: str) -> Benchmark:
    """Measure a run with 1600 points in the C host."""

    def figures() -> Measurement:
        try:
            peer = Baseline("FMU in Python", time_fmu(case, "python").seconds)
        except MissingToolError as error:
            peer = Baseline(f"FMU in Python: {error}")
        return time_fmu(case, "native").seconds, RUN_TIME_TARGETS[case], (peer,)

    return measure_or_skip(
        f"{case}, native: {CASES_BY_NAME[case].problem.stop:g} s, {COMMUNICATION_STEPS} points, C host", "s", figures
    )


def step_in_c(case: str) -> Benchmark:
    """Measure a communication step in the C host, with position and speed read."""

    def seconds(backend: str) -> float:
        return time_per_step(time_fmu(case, backend).seconds, time_fmu(case, backend, 1).seconds)

    return measure_or_skip(f"{case}, native: communication step, C host", "s", partial(compare_backends, seconds))


def run_through_fmpy(model: str) -> Benchmark:
    """Measure a run with 1600 points through fmpy, with all outputs recorded."""
    seconds = partial(time_through_fmpy, model, steps=COMMUNICATION_STEPS)
    return measure_or_skip(
        f"{model}, native: {COMMUNICATION_STEPS} points through fmpy, loop of the harness",
        "s",
        partial(compare_backends, seconds),
    )


def step_through_fmpy(model: str) -> Benchmark:
    """Measure a communication step through fmpy, with all outputs recorded."""

    def seconds(backend: str) -> float:
        return time_per_step(
            time_through_fmpy(model, backend, steps=COMMUNICATION_STEPS), time_through_fmpy(model, backend, steps=1)
        )

    return measure_or_skip(
        f"{model}, native: communication step through fmpy, loop of the harness",
        "s",
        partial(compare_backends, seconds),
    )


def compare_with_cvode(case: str) -> Benchmark:
    """Measure run time and error relative to CVODE, and return the larger ratio; below 1, both are better.

    The run time is compared with the shortest and the error with the smallest of CVODE over several tolerances.
    """
    method = "BDF" if CASES_BY_NAME[case].problem.is_stiff else "Adams"

    def figures() -> Measurement:
        timing, peers = time_fmu(case, "native"), [time_cvode(case, rtol) for rtol in TOLERANCES]
        error, errors = largest_error(case, timing), [largest_error(case, peer) for peer in peers]
        ratio = max(timing.seconds / min(peer.seconds for peer in peers), error / min(errors))
        baselines = [Baseline(f"this FMU, error {error:.1e}", timing.seconds)]
        for rtol, peer, peer_error in zip(TOLERANCES, peers, errors, strict=True):
            baselines.append(Baseline(f"CVODE FMU, {method} at {rtol:.0e}, error {peer_error:.1e}", peer.seconds))
        return ratio, 1.0, tuple(baselines)

    return measure_or_skip(f"{case}, native: larger of run time and error, ratio to the CVODE FMU", "1", figures)


def compare_backends(seconds: Callable[[str], float]) -> Measurement:
    """Compare the native FMU with the Python FMU, whose time is the target."""
    native, python = seconds("native"), seconds("python")
    return native, python, (Baseline("FMU in Python", python),)


def measure_or_skip(title: str, unit: str, figures: Callable[[], Measurement]) -> Benchmark:
    """Run a measurement; if a tool is missing, return a benchmark with the reason."""
    try:
        value, target, baselines = figures()
    except MissingToolError as error:
        return Benchmark(title, nan, unit, nan, (Baseline(str(error)),))
    return Benchmark(title, value, unit, target, baselines)


def built_fmu(model: str, backend: str) -> Path:
    """Return the built FMU of a backend: python or native."""
    path, option = find_fmu(model), f" {model}" if model in list_more_models() else ""
    if backend == "native":
        path, option = path.parent / "native" / path.name, f"{option} --native"
    if not path.is_file():
        raise MissingToolError(f"not built: {path} (friction-fmus build{option})")
    return path


@dataclass(frozen=True)
class Timing:
    """Run time in s of the fastest run, and values of the last run (points, variables)."""

    seconds: float
    rows: np.ndarray


def time_runs(library: Library, run: RunSpec) -> Timing:
    """Time the repetitions of a run of one instance from 0 to the stop in equal steps; numbers are set as they are."""
    references = library.references
    words = [f"{'i' * isinstance(value, int)}{references[name]}={value!r}" for name, value in run.values.items()]
    words += [str(references[name]) for name in run.outputs]
    calls = f"0 new bench quiet\n0 time {run.repeat} {run.stop!r} {run.equal_steps} {' '.join(words)}\n0 free\n"
    (_, seconds), *rows = (line.split() for line in run_host(library, calls).splitlines())
    return Timing(float(seconds), np.array([row[1:] for row in rows], dtype=float))


def run_host(library: Library, calls: str) -> str:
    """Execute calls in the C host and return its output."""
    process = run_subprocess(library.command, calls, library.environment)
    if process.returncode:
        raise HarnessError((process.stderr.splitlines() or [f"{library.file.name} terminated the C host"])[0])
    return process.stdout


# Cached, because several benchmarks use the results.


@cache
def build_cvode_fmu(model: str, plain: bool = False, adams: bool = False) -> Library:
    """Compile the CVODE FMU of a model.

    Parameters
    ----------
    plain : whether to use the solver settings of importers in model exchange
    adams : whether to use the method of Adams for a stiff model
    """
    command = [find_compiler(), "-E", "-x", "c", "-", "-o", os.devnull]
    if run_subprocess(command, "#include <cvode/cvode.h>\n").returncode:
        raise MissingToolError("not installed: SUNDIALS for C (on Debian libsundials-dev)")
    options = (f"-DMODEL={model.upper()}", f"-DPLAIN={plain:d}", f"-DADAMS={adams:d}", "-shared", "-fPIC")
    libraries = ("-lsundials_cvode", "-lsundials_nvecserial", "-lm")
    name = f"{model}-{plain:d}{adams:d}-cvode.so"
    file = compile_source(Path(__file__).with_name("cvode.c"), name, options, libraries)
    return Library(file, {variable: number for number, variable in enumerate(CVODE_VARIABLES)})


@cache
def time_fmu(case: str, backend: str, steps: int = COMMUNICATION_STEPS) -> Timing:
    """Time a built FMU with default method and tolerance in the C host."""
    data = CASES_BY_NAME[case]
    fmu, repeat = built_fmu(data.model, backend), REPEAT if backend == "native" else REPEAT_PYTHON
    run = replace(data.run, fmu=fmu, stop=data.problem.stop, equal_steps=steps, repeat=repeat)
    return time_runs(load_library(fmu), run)


@cache
def time_cvode(case: str, rtol: float) -> Timing:
    """Time the CVODE FMU in the C host."""
    data = CASES_BY_NAME[case]
    library = build_cvode_fmu(data.model)
    values = {**data.run.values, "rtol": rtol, "atol": rtol * data.problem.atol_factor}
    stop = data.problem.stop
    run = RunSpec(library.file, ("x", "v"), values, stop=stop, equal_steps=COMMUNICATION_STEPS, repeat=REPEAT)
    return time_runs(library, run)


@cache
def time_through_fmpy(model: str, backend: str, steps: int) -> float:
    """Return the run time in s of a built FMU through fmpy, in the loop of the harness."""
    return time_direct_loop(built_fmu(model, backend), steps)


def largest_error(case: str, timing: Timing) -> float:
    """Return the largest error at the points of the reference, relative to the largest position and speed."""
    truth = CASES_BY_NAME[case].reference
    return float(relative_errors(timing.rows[:: COMMUNICATION_STEPS // (len(truth.times) - 1)], truth.states).max())
