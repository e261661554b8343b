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
from . import c_adapter
from .request import END, ImporterReply, ImporterRequest

TOLERANCE = 1e-6
TIMEOUT = 300  # s, for a process
RESET_CYCLES = 100
POINTS = 200  # communication steps of a run
DIVERGED = "the solution diverges"
EXCHANGE = "fmi2EnterEventMode"
NEGATIVE, TINY = {"m": -1.0}, {"m": 1e-300}  # masses: one is refused, with the other a motion diverges
FACTOR = 1.1  # a tunable is changed by this factor


@dataclass(frozen=True)
class Importer:
    """A tool: its player, the packages it needs; whether it shows the log, heeds the status of a step, ends its own
    process, with the FMU's sentence, when initialisation answers an error, and asks for the functions of model exchange
    whatever it runs."""

    name: str
    adapter: str
    packages: tuple[str, ...]
    shows_log: bool
    checks_status: bool
    exits_on_error: bool = False
    needs_model_exchange: bool = False


IMPORTERS = (
    Importer("fmpy", "fmpy_adapter", ("fmpy",), True, True),
    Importer("C, cc", "c_adapter", (), True, True),
    Importer("fmuloader", "fmuloader_adapter", ("fmuloader",), True, True, needs_model_exchange=True),
    Importer("FMUContainer", "fmucontainer_adapter", ("fmu-manipulation-toolbox",), True, True),
    Importer("Ecos", "ecos_adapter", ("ecospy", "tbb"), False, False),
    Importer("libcosim", "libcosim_adapter", ("libcosimpy",), True, True, exits_on_error=True),
)


NOT_RUN = {  # why some are not driven
    "OMSimulator": "its pip package fetches its programs from elsewhere when it is installed",
    "PyFMI": "conda has it; what pip has of it is of 2018, and wants libraries that pip has not",
    "fmusim, FMU Compliance Checker, libfmi4c": "neither pip nor Debian has them",
}


@dataclass(frozen=True)
class AdapterResult:
    """An answer, and what the process said on standard error meanwhile."""

    reply: ImporterReply
    stderr: str


class CheckFailedError(Exception):
    """A check that failed, in a few words."""


RESULTS: dict[tuple[str, str], AdapterResult | CheckFailedError] = {}  # of each player to each request, in JSON


def unavailable_reason(importer: Importer, fmu: Path | None = None) -> str:
    """Why an importer cannot be asked here, of an FMU if one is named, or nothing."""
    for package in importer.packages:
        try:
            version(package)
        except PackageNotFoundError:
            return f"{package} is not installed: pip install -e '.[importers]'"
    if importer.adapter == "c_adapter":
        if COMPILER is None:
            return "there is no C compiler here"
        if not PYTHON_LIBRARY.is_file():
            return "this Python has no shared library that a C program could load"
    if importer.needs_model_exchange and fmu and not has_function(fmu, EXCHANGE):
        return f"it opens only FMUs whose library has all functions of FMI, and {fmu.name} has none of model exchange"
    return ""


def has_function(fmu: Path, function: str) -> bool:
    """Whether the library of an FMU for this machine names a function."""
    with ZipFile(fmu) as archive:
        names = [name for name in archive.namelist() if name.startswith("binaries/linux64/") and name.endswith(".so")]
        return any(function.encode() in archive.read(name) for name in names)


def run_request(importer: Importer, request: ImporterRequest) -> AdapterResult:
    """The answer of an importer, from another process than this; Wrong if that crashes or hangs."""
    prepare(importer, [request])
    answer = RESULTS[importer.adapter, json.dumps(asdict(request))]
    if isinstance(answer, CheckFailedError):
        raise answer
    return answer


def prepare(importer: Importer, requests: list[ImporterRequest]) -> None:
    """Ask an importer what it was not asked yet: a process all, and where it crashes or hangs, another one the rest."""
    texts = [json.dumps(asdict(request)) for request in requests]
    texts = [text for text in dict.fromkeys(texts) if (importer.adapter, text) not in RESULTS]
    while texts:
        answers = run_adapter(importer.adapter, texts)
        RESULTS.update(((importer.adapter, text), answer) for text, answer in zip(texts, answers, strict=False))
        texts = texts[len(answers) :]


def run_adapter(adapter: str, texts: list[str]) -> list[AdapterResult | CheckFailedError]:
    """The answers to as many of these requests as a process carries out, and of the next one how it crashed or hung."""
    text, hung = "\n".join(texts), ""
    try:
        in_c = adapter == "c_adapter"
        done = (
            c_adapter.run_requests(text, TIMEOUT)
            if in_c
            else run_module(f"{__package__}.{adapter}", text, timeout=TIMEOUT)
        )
    except SubprocessTimeoutError as late:
        done, hung = late.process, f"hangs for {TIMEOUT} s"
    *said, rest = done.stderr.split(END)
    replies = [ImporterReply(**json.loads(line)) for line in done.stdout.splitlines()]
    found: list[AdapterResult | CheckFailedError] = [AdapterResult(*each) for each in zip(replies, said, strict=False)]
    if done.returncode or rest or len(found) < len(texts):
        last = rest.strip().splitlines()[-1:] or ["nothing said"]
        found[len(texts) - 1 :] = [CheckFailedError(hung or f"exit status {done.returncode}: {last[0]}")]
    return found


@dataclass(frozen=True)
class FmuUnderTest:
    """An FMU and what the checks need to know of it."""

    fmu: Path
    base_request: ImporterRequest  # the default experiment, its first two outputs and acceleration read
    connection: list[str]  # an output, and the input, which is of the same unit
    midrun_changes: dict[str, float]  # a tunable and its new value in mid-run


class UnsuitableFmuError(HarnessError):
    """An FMU that the checks cannot be made with."""


def describe_fmu(fmu: Path) -> FmuUnderTest:
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
        raise UnsuitableFmuError("the checks want a mass m, an input, and an output of its unit")
    midrun_changes = {name: FACTOR * float(v.start) for name, v in reals.items() if name in ("k", "r")}
    base_request = ImporterRequest(
        fmu=str(fmu.resolve()),
        references={name: v.valueReference for name, v in reals.items()},
        step=float(found.defaultExperiment.stopTime) / POINTS,
        steps=POINTS,
        outputs=outputs[:2],
    )
    return FmuUnderTest(fmu, base_request, [source, entry], midrun_changes)


def check_agreement(importer: Importer, request: ImporterRequest) -> str:
    """The largest difference from fmpy, as a share of the largest value of the variable."""
    mine = run_request(importer, request)
    if mine.stderr:
        raise CheckFailedError(f"it says: {mine.stderr.splitlines()[0]}")
    if not all(isfinite(value) for row in mine.reply.rows for value in row):
        raise CheckFailedError("it answers what is not a number")
    expected = run_request(IMPORTERS[0], request).reply.rows
    worst = largest_difference(mine.reply.rows, expected)
    return f"{worst:.0e}" if importer is not IMPORTERS[0] else "runs"


def largest_difference(rows: list[list[float]], expected: list[list[float]]) -> float:
    """The same as a number, from the first step on: libcosim shows nothing before it; Wrong if too large."""
    if len(rows) != len(expected):
        raise CheckFailedError(f"{len(rows)} points instead of {len(expected)}")
    worst = 0.0
    for mine, right in zip(zip(*rows[1:], strict=True), zip(*expected[1:], strict=True), strict=True):
        size = max(abs(value) for value in right) or 1.0
        worst = max(worst, *(abs(a - b) / size if a == a else 1.0 for a, b in zip(mine, right, strict=True)))
    if not worst <= TOLERANCE:
        raise CheckFailedError(f"differs from fmpy by {worst:.0e}")
    return worst


def check_failure(importer: Importer, request: ImporterRequest) -> str:
    """A run that fails: said once on standard error and in the log, no number afterwards, all well after a reset."""
    sentence = expected_message(request)
    try:
        run_instances = run_request(importer, request)
    except CheckFailedError as wrong:
        if importer.exits_on_error and request.values and sentence in str(wrong):
            return "told, ends"
        raise
    kind = request.instances[0]
    lines = [line for line in run_instances.stderr.splitlines() if sentence in line]
    names = f"({kind}): ", f"{Path(request.fmu).name}): ", f"({kind}.0.fmu): "  # the last one in a container
    own = [line for line in lines if any(name in line for name in names)]
    if len(own) != 1:
        raise CheckFailedError(f"{len(own)} lines on standard error instead of one")
    if importer.shows_log and len(lines) != 2:
        raise CheckFailedError("the log says nothing")
    rows, accepted = run_instances.reply.rows, run_instances.reply.accepted
    if importer.checks_status and accepted == request.steps:
        raise CheckFailedError("every step is accepted")
    if not (all(isnan(value) for value in rows[-1]) or (importer.checks_status and rows[-1] == rows[accepted])):
        raise CheckFailedError(f"answers {rows[-1][0]!r} after it failed")
    fresh = run_request(
        IMPORTERS[0], replace(request, values={}, midrun_changes={}, instances=["a"], rerun=False)
    ).reply.rows
    largest_difference(run_instances.reply.rerun, fresh)
    return "told"


def expected_message(request: ImporterRequest) -> str:
    """What is to be said of its values: of several, that the motion diverges."""
    (name, value), *more = [*request.values.items(), *request.midrun_changes.items()]
    return DIVERGED if more else f"{name} = {value!r}"


def failing_request(subject: FmuUnderTest, **changes: Any) -> ImporterRequest:
    """A request that fails, and then one that does not."""
    return replace(subject.base_request, steps=10, rerun=True, **changes)


def check_reset_cycles(importer: Importer, request: ImporterRequest) -> str:
    """Runs, saves, runs on, restores, runs on, resets, runs and frees, in one process; then unloads the library."""
    if importer.adapter != "c_adapter":
        return "-"
    rows = run_request(importer, request).reply.rows
    if len(rows) != 3 * RESET_CYCLES or any(row != rows[0] for row in rows):
        raise CheckFailedError("the lives differ")
    largest_difference([[], rows[0]], [[], run_request(IMPORTERS[0], replace(request, reset_cycles=0)).reply.rows[-1]])
    return "alike"


Judge = Callable[[Importer, ImporterRequest], str]  # returns what the table shows, or raises Wrong
CHECKS: dict[str, tuple[Judge, Callable[[FmuUnderTest], ImporterRequest]]] = {
    "default run": (check_agreement, lambda its: its.base_request),
    "tunable changed": (check_agreement, lambda its: replace(its.base_request, midrun_changes=its.midrun_changes)),
    "two connected": (
        check_agreement,
        lambda its: replace(its.base_request, instances=["a", "b"], connection=its.connection),
    ),
    "100 lives": (check_reset_cycles, lambda its: replace(its.base_request, steps=10, reset_cycles=RESET_CYCLES)),
    "bad parameter": (check_failure, lambda its: failing_request(its, values=NEGATIVE)),
    "bad input": (check_failure, lambda its: failing_request(its, midrun_changes={its.connection[1]: nan})),
    "diverging run": (
        check_failure,
        lambda its: failing_request(its, midrun_changes={**TINY, its.connection[1]: 1e308}),
    ),
    "% in a name": (check_failure, lambda its: failing_request(its, instances=["100%s%n"], values=NEGATIVE)),
}
