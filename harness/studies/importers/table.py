"""The importer table: importers by checks by FMUs."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from rich.table import Table

from ...errors import HarnessError
from ...process.interruptible_wait import map_in_threads
from ...results.files import write_csv_rows
from ...results.folder import replace_folder
from ...results.provenance import describe_sources, prefix_parameters, write_provenance
from ...running.description import declared_parameters
from .checks import (
    CHECKS,
    IMPORTERS,
    NOT_RUN,
    CheckFailedError,
    FmuUnderTest,
    Importer,
    Judge,
    UnsuitableFmuError,
    describe_fmu,
    prepare,
    run_request,
    unavailable_reason,
)
from .request import ImporterRequest

WORKERS = 2
FOLDER, FILES = "importers", ("importers.csv",)


@dataclass(frozen=True)
class CheckResult:
    """One check of one importer: what each FMU gave, and what went wrong; `reason` where it was not asked."""

    importer: str
    check: str
    cells: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    reason: str = ""
    fmus: tuple[str, ...] = ()


def run_importer_checks(fmus: Path, out: Path, report: Callable[[str, float], None]) -> list[CheckResult]:
    """Ask about the FMUs in a folder, and write the rows to out/importers/importers.csv."""
    with replace_folder(out / FOLDER, FILES, describe_sources(str(fmus))) as folder:
        found = run_checks(fmus, report)
        save(found, folder / FILES[0])
        files = [fmus / f"{name}.fmu" for name in fmu_names(found)]
        write_provenance(
            folder,
            files,
            prefix_parameters({file.stem: declared_parameters(file) for file in files}),
            source=describe_sources(str(fmus)),
        )
    return found


def run_checks(folder: Path, report: Callable[[str, float], None]) -> list[CheckResult]:
    """Ask every importer everything about the FMUs in a folder; `report` is told the importer and the share done."""
    subjects: list[FmuUnderTest] = []
    found: list[CheckResult] = []
    for fmu in fmus(folder):
        try:
            subjects.append(describe_fmu(fmu))
        except UnsuitableFmuError as unfit:
            found.append(CheckResult(fmu.name, "", reason=str(unfit)))
    if not subjects:
        raise HarnessError(f"no FMU in {folder} is asked about: {found[0].reason}; name another folder")
    names = tuple(subject.fmu.stem for subject in subjects)
    reasons = [unavailable_reason(importer, subjects[0].fmu) for importer in IMPORTERS]
    present = [importer for importer, reason in zip(IMPORTERS, reasons, strict=True) if not reason]
    # fmpy first, whose answers the others are set beside
    with closing(map_in_threads(WORKERS, partial(ask, subjects), present)) as asked:
        for importer, reason in zip(IMPORTERS, reasons, strict=True):
            if reason:
                found.append(CheckResult(importer.name, "", reason=reason))
                continue
            report(importer.name, 0.0)
            next(asked)
            columns = [judge_fmu(importer, subject) for subject in subjects]
            report(importer.name, 1.0)
            name = name_with_version(importer, subjects[0].base_request)
            for check, *cells in zip(CHECKS, *columns, strict=True):
                failed = tuple(
                    f"{m}: {check_cell}" for m, check_cell in zip(names, cells, strict=True) if "FAILED" in check_cell
                )
                found.append(CheckResult(name, check, tuple(cells), failed, fmus=names))
    return found + [CheckResult(name, "", reason=reason) for name, reason in NOT_RUN.items()]


def name_with_version(importer: Importer, request: ImporterRequest) -> str:
    """Its name, and its version if it lives to tell it."""
    try:
        return f"{importer.name} {run_request(importer, request).reply.version}"
    except CheckFailedError:
        return importer.name


def fmus(folder: Path) -> list[Path]:
    """The FMUs of a folder, by name."""
    found = sorted(folder.glob("*.fmu"))
    if not found:
        raise HarnessError(f"there is no FMU in {folder}: build them with `python build_fmus.py`, or name another one")
    return found


def ask(subjects: list[FmuUnderTest], importer: Importer) -> None:
    """Ask an importer all that is judged: one process about all FMUs, in C one about each."""
    asked = [[request(subject) for _, request in CHECKS.values()] for subject in subjects]
    if importer.adapter != "c_adapter":  # one life, of which fmpy's is what those in C are set beside
        asked = [[replace(request, reset_cycles=0) for requests in asked for request in requests]]
    for requests in asked:
        prepare(importer, requests)


def judge_fmu(importer: Importer, subject: FmuUnderTest) -> list[str]:
    """What every check gives."""
    return [check_cell(judge, importer, request(subject)) for judge, request in CHECKS.values()]


def check_cell(judge: Judge, importer: Importer, request: ImporterRequest) -> str:
    """What one gives."""
    try:
        return judge(importer, request)
    except CheckFailedError as wrong:
        return f"FAILED: {wrong}"


def importer_table(found: list[CheckResult]) -> Table:
    """The rows for reading."""
    shown = Table("importer", "check", *fmu_names(found), box=None)
    last = ""
    for row in found:
        if row.check:
            shown.add_row(row.importer if row.importer != last else "", row.check, *row.cells)
            last = row.importer
    return shown


def legend_lines(found: list[CheckResult]) -> list[str]:
    """What the words in the table mean, and which tools were not asked."""
    words = "numbers: largest difference from fmpy; told: in one sentence, then NaN; reset recovers, or the tool ends"
    return [words, *(f"{row.importer} was not asked: {row.reason}" for row in found if row.reason)]


def fmu_names(found: list[CheckResult]) -> tuple[str, ...]:
    """The names of the FMUs."""
    return next((row.fmus for row in found if row.fmus), ())


def save(found: list[CheckResult], path: Path) -> None:
    """Write the rows as CSV."""
    names = fmu_names(found)
    nothing = ("",) * len(names)
    rows = ((row.importer, row.check or f"not asked: {row.reason}", *(row.cells or nothing)) for row in found)
    write_csv_rows(path, ["importer", "check", *names], rows)
