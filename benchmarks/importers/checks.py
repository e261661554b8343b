"""Checks of every FMU in every importer.

Values agree if they differ by at most TOLERANCE, relative to the largest value of the variable: importers compute time
differently, and a slightly later change during the run causes other internal steps.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from math import isfinite, isnan, nan
from pathlib import Path
from typing import Any
from zipfile import ZipFile

from harness.errors import HarnessError, install_command
from harness.process.worker import Worker, WorkerError
from harness.scenes.run_spec import RunSpec
from harness.simulation.fmu_archive import read_description
from harness.simulation.whole_run import COMPILER

from ..c_host import PYTHON_LIBRARY
from . import c_adapter
from .request import ImporterReply, ImporterRequest, run_in_adapter

TOLERANCE = 1e-6
TIMEOUT = 300.0  # s per request
RESET_CYCLES = 100
POINTS = 200  # communication steps
DIVERGENCE_MESSAGE = "the solution diverges"
EXCHANGE = "fmi2EnterEventMode"
NEGATIVE, TINY = {"m": -1.0}, {"m": 1e-300}  # masses: the first is rejected, with the second a run diverges
FACTOR = 1.1  # by which tunable parameters change


@dataclass(frozen=True)
class Importer:
    """A simulation tool.

    Attributes
    ----------
    name : str
        Name of the tool.
    adapter : str
        Module of the adapter.
    packages : tuple of str
        Required packages.
    shows_log : bool
        Whether the tool prints log messages of the FMU.
    checks_status : bool
        Whether the tool checks the status of a step.
    exits_on_error : bool
        Whether the tool exits if initialisation fails.
    needs_model_exchange : bool
        Whether the tool requires the functions of model exchange in every FMU.
    """

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


NOT_RUN = {  # tools without adapter, with reasons
    "OMSimulator": "its pip package downloads its programs from another site during installation",
    "PyFMI": "only available from conda; the pip package is from 2018 and needs libraries that pip does not provide",
    "fmusim, FMU Compliance Checker, libfmi4c": "not available from pip or Debian",
}


@dataclass(frozen=True)
class AdapterResult:
    """Reply to a request, and the messages on standard error."""

    reply: ImporterReply
    stderr: str


class CheckFailedError(Exception):
    """A check failed."""


RESULTS: dict[tuple[str, str], AdapterResult | CheckFailedError] = {}  # cache by adapter and request


def unavailable_reason(importer: Importer, fmu: Path | None = None) -> str:
    """Return the reason why an importer cannot run, or cannot run this FMU; empty if it can."""
    for package in importer.packages:
        try:
            version(package)
        except PackageNotFoundError:
            return f"{package} is not installed: {install_command('importers')}"
    if importer.adapter == "c_adapter":
        if COMPILER is None:
            return "no C compiler found"
        if not PYTHON_LIBRARY.is_file():
            return "this Python has no shared library for a C program"
    if importer.needs_model_exchange and fmu and not has_function(fmu, EXCHANGE):
        return f"the tool requires the functions of model exchange, which {fmu.name} does not have"
    return ""


def has_function(fmu: Path, function: str) -> bool:
    """Return whether the library of an FMU contains the name of a function."""
    with ZipFile(fmu) as archive:
        names = [name for name in archive.namelist() if name.startswith("binaries/linux64/") and name.endswith(".so")]
        return any(function.encode() in archive.read(name) for name in names)


def run_request(importer: Importer, request: ImporterRequest) -> AdapterResult:
    """Run a request in an importer; CheckFailedError if its process crashes or times out."""
    prepare(importer, [request])
    result = RESULTS[importer.adapter, repr(request)]
    if isinstance(result, CheckFailedError):
        raise result
    return result


def prepare(importer: Importer, requests: list[ImporterRequest]) -> None:
    """Run all new requests of an importer in one process; after a crash or timeout, another process continues."""
    keys = {(importer.adapter, repr(request)): request for request in requests}
    new_requests = {key: request for key, request in keys.items() if key not in RESULTS}
    with Worker() as worker:
        for key, request in new_requests.items():
            RESULTS[key] = run_adapter(worker, importer, request)
        try:
            worker.finish()
        except WorkerError as error:
            RESULTS[key] = CheckFailedError(str(error))


def run_adapter(worker: Worker, importer: Importer, request: ImporterRequest) -> AdapterResult | CheckFailedError:
    """Run a request in the process of an adapter, or in the C program."""
    try:
        if importer.adapter == "c_adapter":
            return AdapterResult(*c_adapter.run_request(request, TIMEOUT))
        module = f"{__package__}.{importer.adapter}"
        return AdapterResult(worker.call(run_in_adapter, module, request, timeout=TIMEOUT), worker.messages)
    except HarnessError as error:
        return CheckFailedError(str(error))


@dataclass(frozen=True)
class FmuUnderTest:
    """An FMU with the data for the checks."""

    fmu: Path
    base_request: ImporterRequest  # default experiment with the first two outputs
    connection: list[str]  # an output and an input of the same unit
    midrun_changes: dict[str, float]  # tunable parameters with new values during the run


class UnsuitableFmuError(HarnessError):
    """The FMU does not have the variables that the checks need."""


def describe_fmu(fmu: Path) -> FmuUnderTest:
    """Read the description of an FMU and return the data for the checks."""
    if not fmu.is_file():
        raise HarnessError(f"{fmu} does not exist: build the FMUs with `friction-fmus build`, or give another folder")
    fmu_description = read_description(fmu)
    if fmu_description.fmiVersion != "2.0":
        raise HarnessError(f"{fmu} is an FMU for FMI {fmu_description.fmiVersion}; the checks require FMI 2.0")
    reals = {v.name: v for v in fmu_description.modelVariables if v.type == "Real"}
    outputs = [name for name, v in reals.items() if v.causality == "output"]
    input_name = next((name for name, v in reals.items() if v.causality == "input"), "")
    output_name = next((name for name in outputs if input_name and reals[name].unit == reals[input_name].unit), "")
    if not output_name or "m" not in reals:
        raise UnsuitableFmuError("the checks require a mass m, an input, and an output of the same unit")
    stop = float(fmu_description.defaultExperiment.stopTime)
    midrun_changes = {name: FACTOR * float(v.start) for name, v in reals.items() if name in ("k", "r")}
    base_request = ImporterRequest(
        RunSpec(fmu.resolve(), tuple(outputs[:2]), stop=stop, grid=stop / POINTS),
        references={name: v.valueReference for name, v in reals.items()},
    )
    return FmuUnderTest(fmu, base_request, [output_name, input_name], midrun_changes)


def check_agreement(importer: Importer, request: ImporterRequest) -> str:
    """Compare a run with fmpy; return the largest difference relative to the largest value of the variable."""
    result = run_request(importer, request)
    if result.stderr:
        raise CheckFailedError(f"it prints: {result.stderr.splitlines()[0]}")
    if not all(isfinite(value) for row in result.reply.rows for value in row):
        raise CheckFailedError("values are not finite")
    expected = run_request(IMPORTERS[0], request).reply.rows
    worst = largest_difference(result.reply.rows, expected)
    return f"{worst:.0e}" if importer is not IMPORTERS[0] else "runs"


def largest_difference(rows: list[list[float]], expected: list[list[float]]) -> float:
    """Return the largest relative difference from the first step on, because libcosim records nothing before it."""
    if len(rows) != len(expected):
        raise CheckFailedError(f"{len(rows)} points instead of {len(expected)}")
    worst = 0.0
    for column, reference in zip(zip(*rows[1:], strict=True), zip(*expected[1:], strict=True), strict=True):
        size = max(abs(value) for value in reference) or 1.0
        worst = max(worst, *(abs(a - b) / size if a == a else 1.0 for a, b in zip(column, reference, strict=True)))
    if not worst <= TOLERANCE:
        raise CheckFailedError(f"differs from fmpy by {worst:.0e}")
    return worst


def check_failure(importer: Importer, request: ImporterRequest) -> str:
    """Check a failing run: a message on standard error and in the log, no result afterwards, success after a reset.

    After a failure every value is NaN.  A refused value changes nothing: a tool that ignores the refusal continues with
    the previous value, and only the message shows the refusal.
    """
    message = expected_message(request)
    try:
        result = run_request(importer, request)
    except CheckFailedError as error:
        if importer.exits_on_error and request.run.values and message in str(error):
            return "message, exits"
        raise
    instance = request.instances[0]
    lines = [line for line in result.stderr.splitlines() if message in line]
    # the third name is that in a container
    names = (f"({instance}): ", f"{request.run.fmu.name}): ", f"({instance}.0.fmu): ")
    own_lines = [line for line in lines if any(name in line for name in names)]
    if not own_lines:
        raise CheckFailedError("no message on standard error")
    if importer.shows_log and len(lines) != 2 * len(own_lines):
        raise CheckFailedError("no message in the log")
    rows, n_accepted = result.reply.rows, result.reply.n_accepted
    if importer.checks_status and n_accepted == request.steps:
        raise CheckFailedError("every step was accepted")
    unchanged_run = replace(request.run, values={})
    expected = run_request(
        IMPORTERS[0], replace(request, run=unchanged_run, midrun_changes={}, instances=["a"], rerun=False)
    ).reply.rows
    if importer.checks_status:
        if not (all(isnan(value) for value in rows[-1]) or rows[-1] == rows[n_accepted]):
            raise CheckFailedError(f"returns {rows[-1][0]!r} after the failure")
    elif not all(isnan(value) for value in rows[-1]):
        largest_difference(rows, expected)
    largest_difference(result.reply.rerun, expected)
    return "message"


def expected_message(request: ImporterRequest) -> str:
    """Return the expected message: the rejected value, or divergence if several values are set."""
    (name, value), *other_values = {**request.run.values, **request.midrun_changes}.items()
    return DIVERGENCE_MESSAGE if other_values else f"{name} = {value!r}"


def shorten(subject: FmuUnderTest, values: dict[str, float] | None = None, **changes: Any) -> ImporterRequest:
    """Return a request of ten communication steps."""
    request = subject.base_request
    return replace(request, run=replace(request.run, values=values or {}, stop=10 * request.step), **changes)


def check_reset_cycles(importer: Importer, request: ImporterRequest) -> str:
    """Check reset cycles in one process: run, save, continue, restore, continue, reset, run and free."""
    if importer.adapter != "c_adapter":
        return "-"
    rows = run_request(importer, request).reply.rows
    if len(rows) != 3 * RESET_CYCLES or any(row != rows[0] for row in rows):
        raise CheckFailedError("the cycles differ")
    largest_difference([[], rows[0]], [[], run_request(IMPORTERS[0], replace(request, reset_cycles=0)).reply.rows[-1]])
    return "identical"


CheckFunction = Callable[[Importer, ImporterRequest], str]  # returns the table cell, or raises CheckFailedError
CHECKS: dict[str, tuple[CheckFunction, Callable[[FmuUnderTest], ImporterRequest]]] = {
    "default run": (check_agreement, lambda subject: subject.base_request),
    "tunable changed": (
        check_agreement,
        lambda subject: replace(subject.base_request, midrun_changes=subject.midrun_changes),
    ),
    "two connected": (
        check_agreement,
        lambda subject: replace(subject.base_request, instances=["a", "b"], connection=subject.connection),
    ),
    "100 resets": (
        check_reset_cycles,
        lambda subject: shorten(subject, reset_cycles=RESET_CYCLES),
    ),
    "bad parameter": (check_failure, lambda subject: shorten(subject, NEGATIVE, rerun=True)),
    "bad input": (
        check_failure,
        lambda subject: shorten(subject, midrun_changes={subject.connection[1]: nan}, rerun=True),
    ),
    "diverging run": (
        check_failure,
        lambda subject: shorten(subject, midrun_changes={**TINY, subject.connection[1]: 1e308}, rerun=True),
    ),
    "% in a name": (check_failure, lambda subject: shorten(subject, NEGATIVE, instances=["100%s%n"], rerun=True)),
}
