"""Model exchange: errors beside those of CVODE by hand, answers beside co-simulation's, and what a call costs."""

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

from ...errors import HarnessError
from ...process.subprocess_runner import run_subprocess
from ...process.temporary_directory import temporary_directory
from ...references.certified_reference import relative_errors
from ...references.models import MODELS
from ...running.c_host import Library, MissingToolError, compile_source, load_library
from ...running.fmi3 import CO_SIMULATION, MODEL_EXCHANGE, RecordedRun, fmi3_path, open_fmi3_instance
from ...scenes.fmu_files import find_fmu
from .benchmark import SETTINGS, Baseline, Benchmark
from .native import (
    CASES_BY_NAME,
    RUN_TIME_TARGETS,
    Measured,
    build_cvode_fmu,
    fmu,
    largest_error,
    measure_or_skip,
    run_host,
    time_cvode,
)
from .scenario import Scenario

TOLERANCES = (1e-6, 1e-8, 1e-10)
REFERENCE_FMUS = Path("Reference-FMUs")  # a clone in the folder that one is in
BOUNCING_BALL_SIZES, BOUNCING_BALL_START = (
    (2, 1),
    {"h": 0.175, "v": 0.3},
)  # states and indicators of BouncingBall, and where it starts
DEFAULT_SCENARIOS = [Scenario(case) for case in RUN_TIME_TARGETS]
DRIVEN_SCENARIOS = [
    Scenario(case, *its) for case in RUN_TIME_TARGETS for its in SETTINGS["led"][CASES_BY_NAME[case].model].items()
]
LATE_SCENARIOS = [Scenario(each.case, each.name, each.values, 1000.0) for each in DRIVEN_SCENARIOS]
TIE_SCENARIOS = [Scenario(model, *its) for model, ties in SETTINGS["ties"].items() for its in ties.items()]
COMPARED_SCENARIOS = [
    scene for scene in (*DEFAULT_SCENARIOS, *DRIVEN_SCENARIOS, *TIE_SCENARIOS) if not scene.has_ramps
]  # which fmpy holds in co-simulation
CALLS = ("the time", "the states", "the derivatives", "the indicators")
REPEATS = 20_000


def exchange_benchmarks() -> list[Callable[[], Benchmark]]:
    """What to measure: errors, answers, and calls."""
    return [
        *(partial(error_ratio_to_cvode, scene) for scene in (*DEFAULT_SCENARIOS, *DRIVEN_SCENARIOS, *LATE_SCENARIOS)),
        *(partial(difference_from_cosimulation, scene) for scene in COMPARED_SCENARIOS),
        *(partial(call_overhead, model) for model in MODELS),
    ]


def error_ratio_to_cvode(scene: Scenario, tolerances: tuple[float, ...] = TOLERANCES) -> Benchmark:
    """The largest error through importers' CVode, as a multiple of that of CVODE on the same equations with the events
    written by hand in C: both by BDF with a Jacobian by differences, the position of the driver being a state."""

    def figures() -> Measured:
        ratio, told, lacks = 0.0, [], set()
        for rtol in tolerances:
            errors = {"CVODE by hand": error(scene, hand(scene, rtol)), "fmpy": error(scene, fmpy(scene, rtol))}
            try:
                errors["fmusim"] = error(scene, fmusim(scene, rtol))
            except MissingToolError as why:
                lacks.add(Baseline(str(why)))
            by_hand, *theirs = errors.values()
            ratio = max(ratio, *(each / by_hand for each in theirs))
            if scene.is_default:
                errors["CVODE at its best"] = largest_error(scene.case, time_cvode(scene.case, rtol))
            words = ", ".join(f"{name} {each:.1e}" for name, each in errors.items())
            told.append(Baseline(f"errors at rtol {rtol:.0e}: {words}"))
        return ratio, 3.0, (*told, *lacks)

    return measure_or_skip(f"{scene}, model exchange: largest error, ratio to CVODE's by hand", "1", figures)


def error(scene: Scenario, found: RecordedRun | np.ndarray) -> float:
    """The largest at the common times, of a recording or of position and speed (n, 2)."""
    motion = found.sample_at(scene.times, scene.reference_case.outputs) if isinstance(found, RecordedRun) else found
    return float(relative_errors(motion, scene.reference_motion).max())


def hand(scene: Scenario, rtol: float) -> np.ndarray:
    """Position and speed (n, 2) at the common times, by CVODE."""
    its, library = scene.reference_case, build_cvode_fmu(scene.reference_case.model, plain=True)

    def put(**values: float) -> list[str]:
        return [f"0 setr {library.references[name]} {value!r}" for name, value in values.items()]

    read = "0 getr {} {}".format(*map(library.references.__getitem__, ("x", "v")))
    led = {t: put(force=value, rate=rate) for t, _, value, rate in scene.lines}
    common = {*scene.times.tolist()}
    calls = ["0 new hand quiet", *put(**its.values, rtol=rtol, atol=rtol * its.problem.atol_factor)]
    calls += [*led.pop(scene.start), f"0 begin {scene.start!r}", read]
    for t, ahead in pairwise(sorted(common | led.keys())):
        calls += [*led.get(t, []), f"0 step {t!r} {ahead - t!r}", *[read] * (ahead in common)]
    answers = run_host(library, "\n".join([*calls, "0 free\n"])).splitlines()
    if {answer for answer in answers if answer.startswith("status")} != {"status 0"}:
        raise HarnessError(f"{scene}: CVODE by hand gives up")
    return np.array([answer.split()[1:] for answer in answers if answer.startswith("values")], dtype=float)


def fmpy(scene: Scenario, rtol: float, way: str = MODEL_EXCHANGE) -> RecordedRun:
    """A run of the FMI 3.0 FMU through fmpy, its events counted."""
    its = scene.reference_case
    outputs = (*its.outputs, *["events.count"] * its.problem.has_dry_friction)
    span = scene.stop, scene.interval, rtol, None, scene.start
    with open_fmi3_instance(fmi3_fmu(its.model), way) as fmu:
        return fmu.simulate(scene.numbers, outputs, *span, signals=scene.signals, drive_inputs=scene.has_ramps)


def fmusim(scene: Scenario, rtol: float) -> RecordedRun:
    """A run of the FMI 3.0 FMU through fmusim."""
    program, its = shutil.which("fmusim"), scene.reference_case
    if program is None:
        raise MissingToolError("not installed: fmusim")
    if scene.has_ramps:
        raise MissingToolError("fmusim holds an input within its steps")
    if scene.start:
        raise MissingToolError("fmusim takes times for the same that differ by 1e-5 of them")
    with temporary_directory("fmusim-") as folder:
        file, led = folder / "out.csv", folder / "in.csv"
        command = [program, "--interface-type", "me", "--solver", "cvode", "--tolerance", repr(rtol)]
        command += ["--start-time", repr(scene.start), "--stop-time", repr(scene.stop)]
        command += ["--output-interval", repr(scene.interval), "--output-file", str(file)]
        command += [word for name, value in scene.numbers.items() for word in ("--start-value", name, repr(value))]
        if scene.signals is not None:
            heads = ",".join(scene.signals.dtype.names or ())
            np.savetxt(led, scene.signals, "%.17g", ",", header=heads, comments="")
            command += ["--input-file", str(led)]
        done = run_subprocess([*command, str(fmi3_fmu(its.model))])
        if done.returncode:
            raise HarnessError(" ".join((done.stderr or done.stdout).split()) or "fmusim gives no reason")
        return RecordedRun(np.genfromtxt(file, delimiter=",", names=True), 0)


def difference_from_cosimulation(scene: Scenario) -> Benchmark:
    """The largest difference of model exchange and co-simulation at common times, as a share of the largest value of
    each output; without bound if they count different events."""

    def figures() -> Measured:
        one, other = (fmpy(scene, 1e-10, way) for way in (MODEL_EXCHANGE, CO_SIMULATION))
        counts = [
            int(found.rows["events.count"][-1]) if scene.reference_case.problem.has_dry_friction else 0
            for found in (one, other)
        ]
        told = Baseline("{} events in model exchange, {} in co-simulation".format(*counts))
        apart = relative_errors(
            *(found.sample_at(scene.times, scene.reference_case.outputs) for found in (one, other))
        ).max()
        return float(apart) if counts[0] == counts[1] else inf, 1e-6, (told,)

    return measure_or_skip(f"{scene}: model exchange at rtol 1e-10, difference from co-simulation", "1", figures)


def call_overhead(model: str) -> Benchmark:
    """A call each of setting the time, the states, and of asking the derivatives and the event indicators, as a
    multiple of those of BouncingBall with the acceleration of the model written by hand."""

    def figures() -> Measured:
        library, equation = load_library(fmu(model, "native")), SETTINGS["acceleration"][model]
        root = ElementTree.parse(library.file.parents[2] / "modelDescription.xml").getroot()
        states = len(root.findall("ModelStructure/Derivatives/Unknown"))
        indicators = int(root.attrib["numberOfEventIndicators"])
        plain, theirs = (
            seconds(build_bouncing_ball(of), *BOUNCING_BALL_SIZES, BOUNCING_BALL_START) for of in ("force", equation)
        )
        mine = seconds(library, states, indicators, SETTINGS["moving"].get(model, {}))
        told = [Baseline(f"BouncingBall so, {call}", its) for call, its in zip(CALLS, theirs, strict=True)]
        told += [Baseline(f"this FMU, {call}", its) for call, its in zip(CALLS, mine, strict=True)]
        told.append(Baseline(f"ratio to BouncingBall as it is {sum(mine) / sum(plain):.3g}"))
        return sum(mine) / sum(theirs), 1.1, tuple(told)

    return measure_or_skip(
        f"{model}, model exchange: a call of each kind in C, ratio to a Reference FMU's by hand", "1", figures
    )


def seconds(library: Library, states: int, indicators: int, values: dict[str, float]) -> list[float]:
    """How long each of the calls takes, in s, with values set."""
    sets = [f"setr {library.references[name]} {value!r}" for name, value in values.items()]
    lines = ["new bench quiet exchange", *sets, "begin", f"calls {states} {indicators} {REPEATS}", "free"]
    done = run_host(library, "".join(f"0 {line}\n" for line in lines))
    return [float(word) for word in done.split()[1:]]


@cache
def build_bouncing_ball(acceleration: str) -> Library:
    """That of a Reference FMU, compiled from its sources, with an acceleration in C."""
    clone = REFERENCE_FMUS.absolute()
    model, source = clone / "BouncingBall", clone / "src"
    if not model.is_dir():
        raise MissingToolError(f"not here: {REFERENCE_FMUS} (git clone https://github.com/modelica/Reference-FMUs)")
    (guid,) = re.findall(r'INSTANTIATION_TOKEN "(.*)"', (model / "config.h").read_text(encoding="utf-8"))
    options = ("-std=gnu99", "-DFMI_VERSION=2", "-DDISABLE_PREFIX", f"-I{clone / 'include'}", f"-I{model}")
    others = (str(source / name) for name in ("fmi2Functions.c", "cosimulation.c"))
    whole = (*options, f"-DACCELERATION={acceleration}", "-shared", "-fPIC", "-fvisibility=hidden", *others)
    name = f"BouncingBall-{sha256(acceleration.encode()).hexdigest()[:8]}.so"
    file = compile_source(Path(__file__).with_name("bouncing.c"), name, whole, ("-lm",))
    return Library(file, {"h": 1, "v": 3}, guid)


def fmi3_fmu(model: str) -> Path:
    """The FMI 3.0 FMU of a model."""
    file = fmi3_path(find_fmu(model))
    if not file.is_file():
        raise MissingToolError(f"not built: {file} (python build_fmus.py --fmi 3)")
    return file
