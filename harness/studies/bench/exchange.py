"""Model exchange: errors beside those of CVODE by hand, answers beside co-simulation's, and what a call costs."""

import re
import shutil
from collections.abc import Callable
from functools import cache, partial
from math import inf
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ...errors import HarnessError
from ...process.child import ask
from ...process.room import room
from ...running.fmi3 import COSIMULATION, EXCHANGE, Recording, instance, sibling
from ...running.in_c import Library, NotHereError, built, compiled
from ...running.loops import POINTS
from ...scenes.fmus import fmu_of
from ...truths.models import MODELS
from ...truths.reference import POINTS as COMMON
from ...truths.reference import relative
from .measure import NUMBERS, Beside, Measure
from .native import CASE, REACH, Figures, cvode, fmu, of_cvode, off, played, row, runs

TOLERANCES = (1e-6, 1e-8, 1e-10)
REFERENCES = Path("Reference-FMUs")  # a clone in the folder that one is in
THEIRS = (2, 1)  # states and indicators of BouncingBall
TIES = [(model, values, what) for model, its in NUMBERS["ties"].items() for what, values in its.items()]
CALLS = ("the time", "the states", "the derivatives", "the indicators")
TURNS = 20_000


def exchange() -> list[Callable[[], Measure]]:
    """What to measure: errors, answers, and calls (of those whose derivatives need no sine, which costs more)."""
    return [
        *(partial(by_cvode, case, rtol) for case in REACH for rtol in TOLERANCES),
        *(partial(beside_co_simulation, model, {}, "default run") for model in MODELS),
        *(partial(beside_co_simulation, *tie) for tie in TIES),
        *(partial(calls, model) for model in ("smd", "coulomb", "stickslip")),
    ]


def by_cvode(case: str, rtol: float) -> Measure:
    """The largest error through importers' CVode, as a multiple of that of CVODE on the same equations with the events
    written by hand in C: both by BDF with a Jacobian by differences, the position of the driver being a state."""

    def figures() -> Figures:
        values = {**CASE[case].values, "rtol": rtol, "atol": rtol * CASE[case].problem.absolute}
        plain = runs(cvode(CASE[case].model, plain=True), values, ("x", "v"), CASE[case].problem.stop, POINTS, 1)
        errors, told = [], [Beside(f"CVODE at its best, error {off(case, of_cvode(case, rtol)):.1e}")]
        for name, way in ("fmpy", by_fmpy), ("fmusim", by_fmusim):
            try:
                errors.append(way(case, rtol))
                told.append(Beside(f"{name}, error {errors[-1]:.1e}"))
            except NotHereError as error:
                told.append(Beside(str(error)))
        return max(errors) / off(case, plain), 3.0, (Beside(f"CVODE by hand, error {off(case, plain):.1e}"), *told)

    return row(f"{case}, model exchange at rtol {rtol:.0e}: error, ratio to CVODE's by hand", "1", figures)


def by_fmpy(case: str, rtol: float) -> float:
    """The largest error through fmpy."""
    its, truth = CASE[case], CASE[case].reference
    found = recorded(its.model, EXCHANGE, its.values, its.outputs, its.problem.stop, rtol)
    return float(relative(found.at(truth.times, its.outputs), truth.motion).max())


def by_fmusim(case: str, rtol: float) -> float:
    """The largest error through fmusim."""
    program, its, truth = shutil.which("fmusim"), CASE[case], CASE[case].reference
    if program is None:
        raise NotHereError("not installed: fmusim")
    with room("fmusim-") as folder:
        file = folder / "out.csv"
        command = [program, "--interface-type", "me", "--solver", "cvode", "--tolerance", repr(rtol)]
        command += ["--output-interval", repr(its.problem.stop / (COMMON - 1)), "--output-file", str(file)]
        command += [word for name, value in its.values.items() for word in ("--start-value", name, repr(value))]
        done = ask([*command, str(three(its.model))])
        if done.returncode:
            raise HarnessError((done.stderr or done.stdout or "fmusim gives no reason").splitlines()[0])
        rows = np.genfromtxt(file, delimiter=",", names=True)
    return float(relative(Recording(rows, 0).at(truth.times, its.outputs), truth.motion).max())


def beside_co_simulation(model: str, values: dict[str, float], what: str) -> Measure:
    """The largest difference of model exchange and co-simulation at common times, as a share of the largest value of
    each output; without bound if they count different events."""

    def figures() -> Figures:
        case = next(case for case in CASE.values() if case.model == model)
        problem, outputs = case.problem, case.outputs
        its = (*outputs, *["events.count"] * problem.dry)
        times = np.linspace(0.0, problem.stop, COMMON)
        both = [recorded(model, way, values, its, problem.stop, 1e-10) for way in (EXCHANGE, COSIMULATION)]
        one, other = (found.at(times, outputs) for found in both)
        counts = [int(found.rows["events.count"][-1]) if problem.dry else 0 for found in both]
        same = counts[0] == counts[1]
        told = Beside(f"{counts[0]} events in model exchange, {counts[1]} in co-simulation")
        return float(relative(one, other).max()) if same else inf, 1e-6, (told,)

    return row(f"{model}, {what}: model exchange at rtol 1e-10, difference from co-simulation", "1", figures)


def calls(model: str) -> Measure:
    """A call each of setting the time, the states, and of asking the derivatives and the event indicators, as a
    multiple of those of BouncingBall."""

    def figures() -> Figures:
        library = built(fmu(model, "native"))
        root = ElementTree.parse(library.file.parents[2] / "modelDescription.xml").getroot()
        states = len(root.findall("ModelStructure/Derivatives/Unknown"))
        mine = seconds(library, states, int(root.attrib["numberOfEventIndicators"]))
        theirs = seconds(bouncing_ball(), *THEIRS)
        told = [Beside(f"BouncingBall, {call}", its) for call, its in zip(CALLS, theirs, strict=True)]
        told += [Beside(f"this FMU, {call}", its) for call, its in zip(CALLS, mine, strict=True)]
        return sum(mine) / sum(theirs), 1.1, tuple(told)

    return row(f"{model}, model exchange: a call of each kind in C, ratio to the Reference-FMUs'", "1", figures)


def seconds(library: Library, states: int, indicators: int) -> list[float]:
    """How long each of the calls takes, in s."""
    done = played(library, f"0 new bench quiet exchange\n0 begin\n0 calls {states} {indicators} {TURNS}\n0 free\n")
    return [float(word) for word in done.split()[1:]]


@cache
def bouncing_ball() -> Library:
    """That of a Reference FMU, compiled from its sources."""
    clone = REFERENCES.absolute()
    model, source = clone / "BouncingBall", clone / "src"
    if not model.is_dir():
        raise NotHereError(f"not here: {REFERENCES} (git clone https://github.com/modelica/Reference-FMUs)")
    (guid,) = re.findall(r'INSTANTIATION_TOKEN "(.*)"', (model / "config.h").read_text(encoding="utf-8"))
    options = ("-std=gnu99", "-DFMI_VERSION=2", "-DDISABLE_PREFIX", f"-I{clone / 'include'}", f"-I{model}")
    others = (str(source / name) for name in ("fmi2Functions.c", "cosimulation.c"))
    whole = (*options, "-shared", "-fPIC", "-fvisibility=hidden", *others)
    return Library(compiled(model / "model.c", "BouncingBall.so", whole, ("-lm",)), {}, guid)


def three(model: str) -> Path:
    """The FMI 3.0 FMU of a model."""
    file = sibling(fmu_of(model))
    if not file.is_file():
        raise NotHereError(f"not built: {file} (python build_fmus.py --fmi 3)")
    return file


def recorded(
    model: str, way: str, values: dict[str, float], outputs: tuple[str, ...], stop: float, rtol: float
) -> Recording:
    """A run of the FMI 3.0 FMU through fmpy, recorded at the common times."""
    with instance(three(model), way) as fmu:
        return fmu.simulate(values, outputs, stop, stop / (COMMON - 1), rtol)
