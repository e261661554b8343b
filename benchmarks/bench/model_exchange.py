"""Benchmarks of model exchange: errors against CVODE in C, differences from co-simulation, and cost of calls."""

import re
import shutil
from collections.abc import Callable
from functools import cache, partial
from hashlib import sha256
from itertools import pairwise
from math import inf
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from harness.errors import HarnessError
from harness.process.subprocess_runner import run_subprocess
from harness.process.temporary_directory import temporary_directory
from harness.references.certified_reference import relative_errors
from harness.references.models import MODELS
from harness.scenes.fmu_files import find_fmu, fmi3_path
from harness.simulation.runner import run_own_fmu
from harness.simulation.signals import sample_at
from harness.simulation.trajectory import Trajectory

from ..c_host import Library, MissingToolError, compile_source, load_library
from .benchmark import SETTINGS, Baseline, Benchmark
from .native import (
    CASES_BY_NAME,
    RUN_TIME_TARGETS,
    Measurement,
    build_cvode_fmu,
    built_fmu,
    largest_error,
    measure_or_skip,
    run_host,
    time_cvode,
)
from .scenario import Scenario, make_scenario

TOLERANCES = (1e-6, 1e-8, 1e-10)
REFERENCE_FMUS = Path("Reference-FMUs")  # a clone in the working directory
BOUNCING_BALL_SIZES, BOUNCING_BALL_START = (
    (2, 1),
    {"h": 0.175, "v": 0.3},
)  # numbers of states and event indicators; start values
DEFAULT_SCENARIOS = [make_scenario(case) for case in RUN_TIME_TARGETS]
DRIVEN_SCENARIOS, LATE_SCENARIOS = (
    [
        make_scenario(case, name, changes, start)
        for case in RUN_TIME_TARGETS
        for name, changes in SETTINGS["driven"][CASES_BY_NAME[case].model].items()
    ]
    for start in (0.0, 1000.0)
)
TIE_SCENARIOS = [make_scenario(model, *tie) for model, ties in SETTINGS["ties"].items() for tie in ties.items()]
COMPARED_SCENARIOS = [
    scene for scene in (*DEFAULT_SCENARIOS, *DRIVEN_SCENARIOS, *TIE_SCENARIOS) if not scene.has_ramps
]  # fmpy holds inputs in co-simulation
CALLS = ("the time", "the states", "the derivatives", "the indicators")
REPEATS = 20_000


def exchange_benchmarks() -> list[Callable[[], Benchmark]]:
    """Return the benchmarks of model exchange."""
    return [
        *(partial(error_ratio_to_cvode, scene) for scene in (*DEFAULT_SCENARIOS, *DRIVEN_SCENARIOS, *LATE_SCENARIOS)),
        *(partial(difference_from_cosimulation, scene) for scene in COMPARED_SCENARIOS),
        *(partial(call_overhead, model) for model in MODELS),
    ]


def error_ratio_to_cvode(scene: Scenario, tolerances: tuple[float, ...] = TOLERANCES) -> Benchmark:
    """Measure the largest error of importers' CVode relative to CVODE in C with the events in C.

    Both use BDF with a finite-difference Jacobian; the position of the driver is a state.
    """

    def figures() -> Measurement:
        ratio, baselines, missing_tools = 0.0, [], set()
        for rtol in tolerances:
            errors = {
                "CVODE in C": largest_error_of(scene, run_cvode(scene, rtol)),
                "fmpy": largest_error_of(scene, run_fmpy(scene, rtol)),
            }
            try:
                errors["fmusim"] = largest_error_of(scene, run_fmusim(scene, rtol))
            except MissingToolError as reason:
                missing_tools.add(Baseline(str(reason)))
            reference_error, *others = errors.values()
            ratio = max(ratio, *(error / reference_error for error in others))
            if scene.is_default:
                errors["CVODE with Adams or exact Jacobian"] = largest_error(
                    scene.case.name, time_cvode(scene.case.name, rtol)
                )
            text = ", ".join(f"{name} {error:.1e}" for name, error in errors.items())
            baselines.append(Baseline(f"errors at rtol {rtol:.0e}: {text}"))
        return ratio, 3.0, (*baselines, *missing_tools)

    return measure_or_skip(f"{scene}, model exchange: largest error, ratio to CVODE in C", "1", figures)


def largest_error_of(scene: Scenario, result: Trajectory | np.ndarray) -> float:
    """Return the largest error of a recording, or of position and speed (n, 2), at the common times."""
    motion = sample_at(result, scene.times, scene.case.run.outputs) if isinstance(result, Trajectory) else result
    return float(relative_errors(motion, scene.reference_motion).max())


def run_cvode(scene: Scenario, rtol: float) -> np.ndarray:
    """Run CVODE in C; return position and speed (n, 2) at the common times."""
    case, library = scene.case, build_cvode_fmu(scene.case.model, plain=True)

    def set_values(**values: float) -> list[str]:
        return [f"0 setr {library.references[name]} {value!r}" for name, value in values.items()]

    read = "0 getr {} {}".format(*map(library.references.__getitem__, ("x", "v")))
    input_calls = {t: set_values(force=value, rate=rate) for t, _, value, rate in scene.segments}
    common_times = {*scene.times.tolist()}
    calls = ["0 new cvode quiet", *set_values(**case.run.values, rtol=rtol, atol=rtol * case.problem.atol_factor)]
    calls += [*input_calls.pop(scene.start), f"0 begin {scene.start!r}", read]
    for t, ahead in pairwise(sorted(common_times | input_calls.keys())):
        calls += [*input_calls.get(t, []), f"0 step {t!r} {ahead - t!r}", *[read] * (ahead in common_times)]
    answers = run_host(library, "\n".join([*calls, "0 free\n"])).splitlines()
    if {answer for answer in answers if answer.startswith("status")} != {"status 0"}:
        raise HarnessError(f"{scene}: CVODE in C failed")
    return np.array([answer.split()[1:] for answer in answers if answer.startswith("values")], dtype=float)


def run_fmpy(scene: Scenario, rtol: float, exchange: bool = True) -> Trajectory:
    """Run the FMI 3.0 FMU with fmpy's CVode or with its own solver, and count its events."""
    return run_own_fmu(scene.run_with(fmi3_fmu(scene.case.model), rtol, exchange))


def run_fmusim(scene: Scenario, rtol: float) -> Trajectory:
    """Run the FMI 3.0 FMU with fmusim 0.8."""
    program, case = shutil.which("fmusim"), scene.case
    if program is None:
        raise MissingToolError("not installed: fmusim")
    if scene.has_ramps:
        raise MissingToolError("fmusim holds inputs constant within steps")
    if scene.start:
        raise MissingToolError("fmusim does not distinguish times with a relative difference below 1e-5")
    with temporary_directory("fmusim-") as folder:
        file, input_file = folder / "out.csv", folder / "in.csv"
        options = {
            "interface-type": "me",
            "solver": "cvode",
            "tolerance": repr(rtol),
            "start-time": repr(scene.start),
            "stop-time": repr(scene.stop),
            "output-interval": repr(scene.run.grid),
            "output-file": str(file),
        }
        if inputs := scene.run.inputs:
            rows = np.column_stack([*inputs.values()])
            np.savetxt(input_file, rows, "%.17g", ",", header=",".join(inputs), comments="")
            options["input-file"] = str(input_file)
        command = [program, "simulate", str(fmi3_fmu(case.model))]
        command += [f"--{name}={value}" for name, value in options.items()]
        command += [f"--start-value={name}={value!r}" for name, value in scene.run.values.items()]
        process = run_subprocess(command)
        if process.returncode:
            raise HarnessError(
                " ".join((process.stderr or process.stdout).split()) or "fmusim failed without a message"
            )
        rows = np.genfromtxt(file, delimiter=",", names=True)
        spec = scene.run_with(fmi3_fmu(case.model), rtol, exchange=True)
        return Trajectory(rows["time"], {name: rows[name] for name in case.run.outputs}, {}, spec=spec)


def difference_from_cosimulation(scene: Scenario) -> Benchmark:
    """Measure the largest relative difference between model exchange and co-simulation at the common times; infinite if
    the numbers of events differ."""

    def figures() -> Measurement:
        exchange_run, cosimulation_run = (run_fmpy(scene, 1e-10, exchange) for exchange in (True, False))
        counts = [
            int(recording.columns["events.count"][-1]) if scene.case.problem.has_dry_friction else 0
            for recording in (exchange_run, cosimulation_run)
        ]
        baseline = Baseline("{} events in model exchange, {} in co-simulation".format(*counts))
        states = (sample_at(run, scene.times, scene.case.run.outputs) for run in (exchange_run, cosimulation_run))
        difference = relative_errors(*states).max()
        return float(difference) if counts[0] == counts[1] else inf, 1e-6, (baseline,)

    return measure_or_skip(f"{scene}: model exchange at rtol 1e-10, difference from co-simulation", "1", figures)


def call_overhead(model: str) -> Benchmark:
    """Measure the cost of calls that set time and states and read derivatives and event indicators.

    The target is relative to BouncingBall with the acceleration of the model in C.
    """

    def figures() -> Measurement:
        library, equation = load_library(built_fmu(model, "native")), SETTINGS["acceleration"][model]
        root = ElementTree.parse(library.file.parents[2] / "modelDescription.xml").getroot()
        states = len(root.findall("ModelStructure/Derivatives/Unknown"))
        indicators = int(root.attrib["numberOfEventIndicators"])
        original, reference = (
            time_calls(build_bouncing_ball(acceleration), *BOUNCING_BALL_SIZES, BOUNCING_BALL_START)
            for acceleration in ("force", equation)
        )
        fmu_times = time_calls(library, states, indicators, SETTINGS["moving"].get(model, {}))
        baselines = [
            Baseline(f"BouncingBall with this equation, {call}", seconds)
            for call, seconds in zip(CALLS, reference, strict=True)
        ]
        baselines += [Baseline(f"this FMU, {call}", seconds) for call, seconds in zip(CALLS, fmu_times, strict=True)]
        baselines.append(Baseline(f"ratio to the original BouncingBall {sum(fmu_times) / sum(original):.3g}"))
        return sum(fmu_times) / sum(reference), 1.1, tuple(baselines)

    return measure_or_skip(
        f"{model}, model exchange: one call of each kind in C, ratio to a Reference FMU", "1", figures
    )


def time_calls(library: Library, states: int, indicators: int, values: dict[str, float]) -> list[float]:
    """Measure the time of each call in s, with values set."""
    sets = [f"setr {library.references[name]} {value!r}" for name, value in values.items()]
    lines = ["new bench quiet exchange", *sets, "begin", f"calls {states} {indicators} {REPEATS}", "free"]
    output = run_host(library, "".join(f"0 {line}\n" for line in lines))
    return [float(word) for word in output.split()[1:]]


@cache
def build_bouncing_ball(acceleration: str) -> Library:
    """Compile BouncingBall of the Reference FMUs with another acceleration, an expression in C."""
    clone = REFERENCE_FMUS.absolute()
    model, source = clone / "BouncingBall", clone / "src"
    if not model.is_dir():
        raise MissingToolError(f"not found: {REFERENCE_FMUS} (git clone https://github.com/modelica/Reference-FMUs)")
    (guid,) = re.findall(r'INSTANTIATION_TOKEN "(.*)"', (model / "config.h").read_text(encoding="utf-8"))
    options = ("-std=gnu99", "-DFMI_VERSION=2", "-DDISABLE_PREFIX", f"-I{clone / 'include'}", f"-I{model}")
    others = (str(source / name) for name in ("fmi2Functions.c", "cosimulation.c"))
    arguments = (*options, f"-DACCELERATION={acceleration}", "-shared", "-fPIC", "-fvisibility=hidden", *others)
    name = f"BouncingBall-{sha256(acceleration.encode()).hexdigest()[:8]}.so"
    file = compile_source(Path(__file__).with_name("bouncing.c"), name, arguments, ("-lm",))
    return Library(file, {"h": 1, "v": 3}, guid)


def fmi3_fmu(model: str) -> Path:
    """Return the FMI 3.0 FMU of a model."""
    file = fmi3_path(find_fmu(model))
    if not file.is_file():
        raise MissingToolError(f"not built: {file} (friction-fmus build --fmi 3)")
    return file
