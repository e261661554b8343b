"""The native FMUs beside those in Python, through fmpy and in a host in C, and beside one that integrates with SUNDIALS
CVODE (cvode.c)."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from math import nan
from pathlib import Path

import numpy as np

from ...errors import HarnessError
from ...process.subprocess_runner import run_subprocess
from ...references.certified_reference import relative_errors
from ...references.models import CASES, MODELS
from ...running.c_host import Library, MissingToolError, compile_source, find_compiler, load_library
from ...running.stepping_loops import COMMUNICATION_STEPS, time_direct_loop, time_per_step
from ...scenes.fmu_files import find_fmu
from .benchmark import SETTINGS, Baseline, Benchmark

Measured = tuple[float, float, tuple[Baseline, ...]]  # measured, to reach, beside

CASES_BY_NAME = {case.name: case for case in CASES}

RUN_TIME_TARGETS: dict[str, float] = SETTINGS["in_c"]
TOLERANCES = (1e-4, 1e-6, 1e-8)  # of CVODE, relative
REPEAT, REPEAT_PYTHON = 100, 5


def native_benchmarks() -> list[Callable[[], Benchmark]]:
    """What to measure: runs and communication steps in C, through fmpy, and runs beside CVODE's."""
    return [
        *(partial(run_in_c, case) for case in RUN_TIME_TARGETS),
        *(partial(step_in_c, case) for case in RUN_TIME_TARGETS),
        *(partial(run_through_fmpy, model) for model in MODELS),
        *(partial(step_through_fmpy, model) for model in MODELS),
        *(partial(compare_with_cvode, case) for case in RUN_TIME_TARGETS),
    ]


def run_in_c(case: str) -> Benchmark:
    """One run with 1600 points in the host in C."""

    def figures() -> Measured:
        try:
            peer = Baseline("FMU in Python", time_fmu(case, "python").seconds)
        except MissingToolError as error:
            peer = Baseline(f"FMU in Python: {error}")
        return time_fmu(case, "native").seconds, RUN_TIME_TARGETS[case], (peer,)

    return measure_or_skip(
        f"{case}, native: {CASES_BY_NAME[case].problem.stop:g} s, {COMMUNICATION_STEPS} points, host in C", "s", figures
    )


def step_in_c(case: str) -> Benchmark:
    """One communication step in the host in C, with position and speed read."""

    def seconds(kind: str) -> float:
        return time_per_step(time_fmu(case, kind).seconds, time_fmu(case, kind, 1).seconds)

    return measure_or_skip(f"{case}, native: communication step, host in C", "s", partial(duel, seconds))


def run_through_fmpy(model: str) -> Benchmark:
    """One run with 1600 points through fmpy, all outputs recorded."""
    seconds = partial(time_through_fmpy, model, steps=COMMUNICATION_STEPS)
    return measure_or_skip(
        f"{model}, native: {COMMUNICATION_STEPS} points through fmpy, harness's loop", "s", partial(duel, seconds)
    )


def step_through_fmpy(model: str) -> Benchmark:
    """One communication step through fmpy, all outputs recorded."""

    def seconds(kind: str) -> float:
        return time_per_step(
            time_through_fmpy(model, kind, steps=COMMUNICATION_STEPS), time_through_fmpy(model, kind, steps=1)
        )

    return measure_or_skip(
        f"{model}, native: communication step through fmpy, harness's loop", "s", partial(duel, seconds)
    )


def compare_with_cvode(case: str) -> Benchmark:
    """Run time and error as shares of CVODE's, the larger of them: below 1 it is both faster and closer.

    The time is compared with CVODE's shortest, the error with its smallest, which is that of another tolerance.
    """
    method = "BDF" if CASES_BY_NAME[case].problem.is_stiff else "Adams"

    def figures() -> Measured:
        mine, theirs = time_fmu(case, "native"), [time_cvode(case, rtol) for rtol in TOLERANCES]
        error, errors = largest_error(case, mine), [largest_error(case, each) for each in theirs]
        share = max(mine.seconds / min(each.seconds for each in theirs), error / min(errors))
        told = [Baseline(f"this FMU, error {error:.1e}", mine.seconds)]
        for rtol, each, its in zip(TOLERANCES, theirs, errors, strict=True):
            told.append(Baseline(f"CVODE FMU, {method} at {rtol:.0e}, error {its:.1e}", each.seconds))
        return share, 1.0, tuple(told)

    return measure_or_skip(f"{case}, native: larger of run time and error, ratio to the CVODE FMU's", "1", figures)


def duel(seconds: Callable[[str], float]) -> Measured:
    """The time of the native FMU, to be below that of the one in Python."""
    mine, theirs = seconds("native"), seconds("python")
    return mine, theirs, (Baseline("FMU in Python", theirs),)


def measure_or_skip(what: str, unit: str, figures: Callable[[], Measured]) -> Benchmark:
    """The measure of what was measured, to reach and beside; or why nothing is."""
    try:
        value, reach, others = figures()
    except MissingToolError as error:
        return Benchmark(what, nan, unit, nan, (Baseline(str(error)),))
    return Benchmark(what, value, unit, reach, others)


def fmu(model: str, kind: str) -> Path:
    """The built FMU in Python or the native one."""
    path, option = find_fmu(model), ""
    if kind == "native":
        path, option = path.parent / "native" / path.name, " --native"
    if not path.is_file():
        raise MissingToolError(f"not built: {path} (python build_fmus.py{option})")
    return path


@dataclass(frozen=True)
class Timing:
    """Run time in s of the fastest, and what was read at every point of the last (points, read)."""

    seconds: float
    rows: np.ndarray


def time_runs(
    library: Library, values: dict[str, float], read: tuple[str, ...], stop: float, steps: int, repeat: int
) -> Timing:
    """Runs from 0 to the stop in equal steps, one after the other on one instance."""
    words = [f"{library.references[name]}={value!r}" for name, value in values.items()]
    words += [str(library.references[name]) for name in read]
    calls = f"0 new bench quiet\n0 time {repeat} {stop!r} {steps} {' '.join(words)}\n0 free\n"
    (_, seconds), *rows = (line.split() for line in run_host(library, calls).splitlines())
    return Timing(float(seconds), np.array([row[1:] for row in rows], dtype=float))


def run_host(library: Library, calls: str) -> str:
    """What the host in C answers."""
    done = run_subprocess(library.command, calls, library.environment)
    if done.returncode:
        raise HarnessError((done.stderr.splitlines() or [f"{library.file.name} ends the host in C"])[0])
    return done.stdout


# Measured once, for all rows that show it.


@cache
def build_cvode_fmu(model: str, plain: bool = False) -> Library:
    """The CVODE FMU, compiled for a model; `plain` as importers solve in model exchange."""
    looking = [find_compiler(), "-E", "-x", "c", "-", "-o", os.devnull]
    if run_subprocess(looking, "#include <cvode/cvode.h>\n").returncode:
        raise MissingToolError("not installed: SUNDIALS for C (on Debian libsundials-dev)")
    options = (f"-DMODEL={model.upper()}", f"-DPLAIN={plain:d}", "-shared", "-fPIC")
    libraries = ("-lsundials_cvode", "-lsundials_nvecserial", "-lm")
    file = compile_source(Path(__file__).with_name("cvode.c"), f"{model}-{plain:d}-cvode.so", options, libraries)
    return Library(file, {name: place for place, name in enumerate(("x", "v", "rtol", "atol", "x_m", "force", "rate"))})


@cache
def time_fmu(case: str, kind: str, steps: int = COMMUNICATION_STEPS) -> Timing:
    """A built FMU with its own method and tolerance in the host in C."""
    its = CASES_BY_NAME[case]
    library = load_library(fmu(its.model, kind))
    repeat = REPEAT if kind == "native" else REPEAT_PYTHON
    return time_runs(library, its.values, its.outputs, its.problem.stop, steps, repeat)


@cache
def time_cvode(case: str, rtol: float) -> Timing:
    """The CVODE FMU in the host in C."""
    its = CASES_BY_NAME[case]
    values = {**its.values, "rtol": rtol, "atol": rtol * its.problem.atol_factor}
    return time_runs(build_cvode_fmu(its.model), values, ("x", "v"), its.problem.stop, COMMUNICATION_STEPS, REPEAT)


@cache
def time_through_fmpy(model: str, kind: str, steps: int) -> float:
    """Run time in s of a built FMU in the harness's loop through fmpy."""
    return time_direct_loop(fmu(model, kind), steps)


def largest_error(case: str, found: Timing) -> float:
    """The largest error at the points of the reference, relative to the largest of position and speed."""
    truth = CASES_BY_NAME[case].reference
    return float(relative_errors(found.rows[:: COMMUNICATION_STEPS // (len(truth.times) - 1)], truth.motion).max())
