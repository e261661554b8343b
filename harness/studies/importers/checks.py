"""What every importer is asked of every FMU, and when the answer is right.

Numbers agree when they differ by less than AGREE of the largest value of their variable: an importer counts time in
its own way, and a change in mid-run that comes an instant later makes other internal steps, within the tolerance.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from math import isfinite, isnan, nan
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from ...errors import HarnessError
from ...process.subprocess_runner import SubprocessTimeoutError, run_module
from ...running.c_host import COMPILER, PYTHON_LIBRARY
from ...running.description import read_description
from . import by_c
from .request import END, Reply, Request

AGREE = 1e-6
PATIENCE = 300  # s, for a process
LIVES = 100
POINTS = 200  # communication steps of a run
DIVERGED = "the motion leaves the range of numbers"
EXCHANGE = "fmi2EnterEventMode"
NEGATIVE, TINY = {"m": -1.0}, {"m": 1e-300}  # masses: one is refused, with the other a motion diverges
FACTOR = 1.1  # a tunable is changed by this factor


@dataclass(frozen=True)
class Importer:
    """A tool: its player, the packages it needs; whether it shows the log, heeds the status of a step, ends its own
    process, with the FMU's sentence, when initialisation answers an error, and asks for the functions of model exchange
    whatever it runs."""

    name: str
    player: str
    packages: tuple[str, ...]
    logs: bool
    heeds: bool
    ends: bool = False
    exchange: bool = False


IMPORTERS = (
    Importer("fmpy", "by_fmpy", ("fmpy",), True, True),
    Importer("C, cc", "by_c", (), True, True),
    Importer("fmuloader", "by_fmuloader", ("fmuloader",), True, True, exchange=True),
    Importer("FMUContainer", "by_fmucontainer", ("fmu-manipulation-toolbox",), True, True),
    Importer("Ecos", "by_ecos", ("ecospy", "tbb"), False, False),
    Importer("libcosim", "by_libcosim", ("libcosimpy",), True, True, ends=True),
)


ELSEWHERE = {  # why some are not driven
    "OMSimulator": "its pip package fetches its programs from elsewhere when it is installed",
    "PyFMI": "conda has it; what pip has of it is of 2018, and wants libraries that pip has not",
    "fmusim, FMU Compliance Checker, libfmi4c": "neither pip nor Debian has them",
}


@dataclass(frozen=True)
class Played:
    """An answer, and what the process said on standard error meanwhile."""

    answer: Reply
    said: str


class Wrong(Exception):
    """A check that failed, in a few words."""


ANSWERS: dict[tuple[str, str], Played | Wrong] = {}  # of each player to each request, in JSON


def absent(importer: Importer, fmu: Path | None = None) -> str:
    """Why an importer cannot be asked here, of an FMU if one is named, or nothing."""
    for package in importer.packages:
        try:
            version(package)
        except PackageNotFoundError:
            return f"{package} is not installed: pip install -e '.[importers]'"
    if importer.player == "by_c":
        if COMPILER is None:
            return "there is no C compiler here"
        if not PYTHON_LIBRARY.is_file():
            return "this Python has no shared library that a C program could load"
    if importer.exchange and fmu and not exports(fmu, EXCHANGE):
        return f"it opens only FMUs whose library has all functions of FMI, and {fmu.name} has none of model exchange"
    return ""


def exports(fmu: Path, function: str) -> bool:
    """Whether the library of an FMU for this machine names a function."""
    with ZipFile(fmu) as archive:
        names = [name for name in archive.namelist() if name.startswith("binaries/linux64/") and name.endswith(".so")]
        return any(function.encode() in archive.read(name) for name in names)


def play(importer: Importer, request: Request) -> Played:
    """The answer of an importer, from another process than this; Wrong if that crashes or hangs."""
    prepare(importer, [request])
    answer = ANSWERS[importer.player, json.dumps(asdict(request))]
    if isinstance(answer, Wrong):
        raise answer
    return answer


def prepare(importer: Importer, requests: list[Request]) -> None:
    """Ask an importer what it was not asked yet: a process all, and where it crashes or hangs, another one the rest."""
    texts = [json.dumps(asdict(request)) for request in requests]
    texts = [text for text in dict.fromkeys(texts) if (importer.player, text) not in ANSWERS]
    while texts:
        answers = asked(importer.player, texts)
        ANSWERS.update(((importer.player, text), answer) for text, answer in zip(texts, answers, strict=False))
        texts = texts[len(answers) :]


def asked(player: str, texts: list[str]) -> list[Played | Wrong]:
    """The answers to as many of these requests as a process carries out, and of the next one how it crashed or hung."""
    text, hung = "\n".join(texts), ""
    try:
        in_c = player == "by_c"
        done = by_c.ran(text, PATIENCE) if in_c else run_module(f"{__package__}.{player}", text, timeout=PATIENCE)
    except SubprocessTimeoutError as late:
        done, hung = late.process, f"hangs for {PATIENCE} s"
    *said, rest = done.stderr.split(END)
    replies = [Reply(**json.loads(line)) for line in done.stdout.splitlines()]
    found: list[Played | Wrong] = [Played(*each) for each in zip(replies, said, strict=False)]
    if done.returncode or rest or len(found) < len(texts):
        last = rest.strip().splitlines()[-1:] or ["nothing said"]
        found[len(texts) - 1 :] = [Wrong(hung or f"exit status {done.returncode}: {last[0]}")]
    return found


@dataclass(frozen=True)
class Subject:
    """An FMU and what the checks need to know of it."""

    fmu: Path
    basis: Request  # the default experiment, its first two outputs and acceleration read
    wire: list[str]  # an output, and the input, which is of the same unit
    change: dict[str, float]  # a tunable and its new value in mid-run


class Unfit(HarnessError):
    """An FMU that the checks cannot be made with."""


def subject(fmu: Path) -> Subject:
    """Read the description of an FMU of this project."""
    if not fmu.is_file():
        raise HarnessError(f"there is no {fmu}: build the FMUs with `python build_fmus.py`, or name another folder")
    found = read_description(fmu)
    if found.fmiVersion != "2.0":
        raise HarnessError(f"{fmu} is of FMI {found.fmiVersion}; the importers are asked with FMUs of FMI 2.0")
    reals = {v.name: v for v in found.modelVariables if v.type == "Real"}
    outputs = [name for name, v in reals.items() if v.causality == "output"]
    entry = next((name for name, v in reals.items() if v.causality == "input"), "")
    source = next((name for name in outputs if entry and reals[name].unit == reals[entry].unit), "")
    if not source or "m" not in reals:
        raise Unfit("the checks want a mass m, an input, and an output of its unit")
    change = {name: FACTOR * float(v.start) for name, v in reals.items() if name in ("k", "r")}
    basis = Request(
        fmu=str(fmu.resolve()),
        references={name: v.valueReference for name, v in reals.items()},
        step=float(found.defaultExperiment.stopTime) / POINTS,
        steps=POINTS,
        read=outputs[:2],
    )
    return Subject(fmu, basis, [source, entry], change)


def agreement(importer: Importer, request: Request) -> str:
    """The largest difference from fmpy, as a share of the largest value of the variable."""
    mine = play(importer, request)
    if mine.said:
        raise Wrong(f"it says: {mine.said.splitlines()[0]}")
    if not all(isfinite(value) for row in mine.answer.rows for value in row):
        raise Wrong("it answers what is not a number")
    expected = play(IMPORTERS[0], request).answer.rows
    worst = difference(mine.answer.rows, expected)
    return f"{worst:.0e}" if importer is not IMPORTERS[0] else "runs"


def difference(rows: list[list[float]], expected: list[list[float]]) -> float:
    """The same as a number, from the first step on: libcosim shows nothing before it; Wrong if too large."""
    if len(rows) != len(expected):
        raise Wrong(f"{len(rows)} points instead of {len(expected)}")
    worst = 0.0
    for mine, right in zip(zip(*rows[1:], strict=True), zip(*expected[1:], strict=True), strict=True):
        size = max(abs(value) for value in right) or 1.0
        worst = max(worst, *(abs(a - b) / size if a == a else 1.0 for a, b in zip(mine, right, strict=True)))
    if not worst <= AGREE:
        raise Wrong(f"differs from fmpy by {worst:.0e}")
    return worst


def failure(importer: Importer, request: Request) -> str:
    """A run that fails: said once on standard error and in the log, no number afterwards, all well after a reset."""
    sentence = refusal(request)
    try:
        played = play(importer, request)
    except Wrong as wrong:
        if importer.ends and request.values and sentence in str(wrong):
            return "told, ends"
        raise
    kind = request.instances[0]
    lines = [line for line in played.said.splitlines() if sentence in line]
    names = f"({kind}): ", f"{Path(request.fmu).name}): ", f"({kind}.0.fmu): "  # the last one in a container
    own = [line for line in lines if any(name in line for name in names)]
    if len(own) != 1:
        raise Wrong(f"{len(own)} lines on standard error instead of one")
    if importer.logs and len(lines) != 2:
        raise Wrong("the log says nothing")
    rows, accepted = played.answer.rows, played.answer.accepted
    if importer.heeds and accepted == request.steps:
        raise Wrong("every step is accepted")
    if not (all(isnan(value) for value in rows[-1]) or (importer.heeds and rows[-1] == rows[accepted])):
        raise Wrong(f"answers {rows[-1][0]!r} after it failed")
    fresh = play(IMPORTERS[0], replace(request, values={}, change={}, instances=["a"], again=False)).answer.rows
    difference(played.answer.again, fresh)
    return "told"


def refusal(request: Request) -> str:
    """What is to be said of its values: of several, that the motion diverges."""
    (name, value), *more = [*request.values.items(), *request.change.items()]
    return DIVERGED if more else f"{name} = {value!r}"


def failing(subject: Subject, **changes: Any) -> Request:
    """A request that fails, and then one that does not."""
    return replace(subject.basis, steps=10, again=True, **changes)


def lives(importer: Importer, request: Request) -> str:
    """Runs, saves, runs on, restores, runs on, resets, runs and frees, in one process; then unloads the library."""
    if importer.player != "by_c":
        return "-"
    rows = play(importer, request).answer.rows
    if len(rows) != 3 * LIVES or any(row != rows[0] for row in rows):
        raise Wrong("the lives differ")
    difference([[], rows[0]], [[], play(IMPORTERS[0], replace(request, lives=0)).answer.rows[-1]])
    return "alike"


Judge = Callable[[Importer, Request], str]  # returns what the table shows, or raises Wrong
CHECKS: dict[str, tuple[Judge, Callable[[Subject], Request]]] = {
    "default run": (agreement, lambda its: its.basis),
    "tunable changed": (agreement, lambda its: replace(its.basis, change=its.change)),
    "two connected": (agreement, lambda its: replace(its.basis, instances=["a", "b"], connect=its.wire)),
    "100 lives": (lives, lambda its: replace(its.basis, steps=10, lives=LIVES)),
    "bad parameter": (failure, lambda its: failing(its, values=NEGATIVE)),
    "bad input": (failure, lambda its: failing(its, change={its.wire[1]: nan})),
    "diverging run": (failure, lambda its: failing(its, change={**TINY, its.wire[1]: 1e308})),
    "% in a name": (failure, lambda its: failing(its, instances=["100%s%n"], values=NEGATIVE)),
}
