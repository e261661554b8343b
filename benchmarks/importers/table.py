"""Runs of the checks of all importers, and their table."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from rich.table import Table

from benchmarks import command_line
from harness.errors import HarnessError
from harness.process.interruptible_wait import map_in_threads
from harness.results.files import write_csv_rows
from harness.results.folder import replace_folder
from harness.results.provenance import describe_sources, prefix_parameters, write_provenance
from harness.results.summary import Summary, SummaryTable, write_summary
from harness.simulation.fmu_archive import declared_parameters

from .checks import (
    CHECKS,
    IMPORTERS,
    NOT_RUN,
    CheckFailedError,
    CheckFunction,
    FmuUnderTest,
    Importer,
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
    """One check of one importer: a cell per FMU, failures, or the `reason` why it was skipped."""

    importer: str
    check: str
    cells: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    reason: str = ""
    fmus: tuple[str, ...] = ()


def run_importer_checks(fmus: Path, out: Path, report: Callable[[str, float], None]) -> list[CheckResult]:
    """Check the FMUs in a folder, and write the results to out/importers/importers.csv."""
    with replace_folder(out / FOLDER, FILES, describe_sources(str(fmus))) as folder:
        results = run_checks(fmus, report)
        headings, rows = result_rows(results)
        write_csv_rows(folder / FILES[0], headings, rows)
        files = [fmus / f"{name}.fmu" for name in fmu_names(results)]
        write_provenance(
            folder,
            files,
            prefix_parameters({file.stem: declared_parameters(file) for file in files}),
            source=describe_sources(str(fmus)),
            command=command_line(),
        )
        table = SummaryTable(tuple(headings), tuple(tuple(map(str, row)) for row in rows))
        write_summary(folder, Summary("importers", "Checks", tables=(table,)))
    return results


def run_checks(folder: Path, report: Callable[[str, float], None]) -> list[CheckResult]:
    """Run all checks of all importers for the FMUs in a folder."""
    subjects: list[FmuUnderTest] = []
    results: list[CheckResult] = []
    for fmu in find_fmus(folder):
        try:
            subjects.append(describe_fmu(fmu))
        except UnsuitableFmuError as error:
            results.append(CheckResult(fmu.name, "", reason=str(error)))
    if not subjects:
        raise HarnessError(f"no FMU in {folder} can be checked: {results[0].reason}; give another folder")
    names = tuple(subject.fmu.stem for subject in subjects)
    reasons = [unavailable_reason(importer, subjects[0].fmu) for importer in IMPORTERS]
    available = [importer for importer, reason in zip(IMPORTERS, reasons, strict=True) if not reason]
    # fmpy first: it is the reference
    with closing(map_in_threads(WORKERS, partial(run_all_requests, subjects), available)) as progress_iterator:
        for importer, reason in zip(IMPORTERS, reasons, strict=True):
            if reason:
                results.append(CheckResult(importer.name, "", reason=reason))
                continue
            report(importer.name, 0.0)
            next(progress_iterator)
            columns = [judge_fmu(importer, subject) for subject in subjects]
            report(importer.name, 1.0)
            name = name_with_version(importer, subjects[0].base_request)
            for check, *cells in zip(CHECKS, *columns, strict=True):
                failures = tuple(f"{m}: {cell}" for m, cell in zip(names, cells, strict=True) if "FAILED" in cell)
                results.append(CheckResult(name, check, tuple(cells), failures, fmus=names))
    return results + [CheckResult(name, "", reason=reason) for name, reason in NOT_RUN.items()]


def name_with_version(importer: Importer, request: ImporterRequest) -> str:
    """Return the name of the importer with its version, if known."""
    try:
        return f"{importer.name} {run_request(importer, request).reply.version}"
    except CheckFailedError:
        return importer.name


def find_fmus(folder: Path) -> list[Path]:
    """Return the FMUs of a folder, sorted by name."""
    files = sorted(folder.glob("*.fmu"))
    if not files:
        raise HarnessError(
            f"there is no FMU in {folder}: build them with `friction-fmus build`, or give another folder"
        )
    return files


def run_all_requests(subjects: list[FmuUnderTest], importer: Importer) -> None:
    """Run all requests of an importer."""
    requests = [request(subject) for subject in subjects for _, request in CHECKS.values()]
    if importer.adapter != "c_adapter":  # fmpy's run without reset cycles is the reference for C
        requests = [replace(request, reset_cycles=0) for request in requests]
    prepare(importer, requests)


def judge_fmu(importer: Importer, subject: FmuUnderTest) -> list[str]:
    """Return the cell of every check."""
    return [check_cell(judge, importer, request(subject)) for judge, request in CHECKS.values()]


def check_cell(judge: CheckFunction, importer: Importer, request: ImporterRequest) -> str:
    """Return the cell of one check."""
    try:
        return judge(importer, request)
    except CheckFailedError as error:
        return f"FAILED: {error}"


def importer_table(results: list[CheckResult]) -> Table:
    """Return the table of results."""
    result_table = Table("importer", "check", *fmu_names(results), box=None)
    last = ""
    for row in results:
        if row.check:
            result_table.add_row(row.importer if row.importer != last else "", row.check, *row.cells)
            last = row.importer
    return result_table


def legend_lines(results: list[CheckResult]) -> list[str]:
    """Return the legend of the table, and the skipped tools."""
    legend = (
        "number: largest difference from fmpy; message: one error message, then NaN, reset recovers (or the tool exits)"
    )
    return [legend, *(f"{row.importer} was skipped: {row.reason}" for row in results if row.reason)]


def fmu_names(results: list[CheckResult]) -> tuple[str, ...]:
    """Return the names of the FMUs."""
    return next((row.fmus for row in results if row.fmus), ())


def result_rows(results: list[CheckResult]) -> tuple[list[str], list[tuple[str, ...]]]:
    """Return headings and rows of the results, with those of skipped tools."""
    names = fmu_names(results)
    empty_cells = ("",) * len(names)
    rows = [(row.importer, row.check or f"skipped: {row.reason}", *(row.cells or empty_cells)) for row in results]
    return ["importer", "check", *names], rows
