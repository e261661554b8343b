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
from .checks import CHECKS, ELSEWHERE, IMPORTERS, Importer, Judge, Subject, Unfit, Wrong, absent, play, prepare, subject
from .request import Request

WORKERS = 2
FOLDER, FILES = "importers", ("importers.csv",)


@dataclass(frozen=True)
class Checked:
    """One check of one importer: what each FMU gave, and what went wrong; `reason` where it was not asked."""

    importer: str
    check: str
    cells: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    reason: str = ""
    fmus: tuple[str, ...] = ()


def perform(fmus: Path, out: Path, report: Callable[[str, float], None]) -> list[Checked]:
    """Ask about the FMUs in a folder, and write the rows to out/importers/importers.csv."""
    with replace_folder(out / FOLDER, FILES, describe_sources(str(fmus))) as folder:
        found = rows(fmus, report)
        save(found, folder / FILES[0])
        files = [fmus / f"{name}.fmu" for name in models(found)]
        write_provenance(
            folder,
            files,
            prefix_parameters({file.stem: declared_parameters(file) for file in files}),
            source=describe_sources(str(fmus)),
        )
    return found


def rows(folder: Path, report: Callable[[str, float], None]) -> list[Checked]:
    """Ask every importer everything about the FMUs in a folder; `report` is told the importer and the share done."""
    subjects: list[Subject] = []
    found: list[Checked] = []
    for fmu in fmus(folder):
        try:
            subjects.append(subject(fmu))
        except Unfit as unfit:
            found.append(Checked(fmu.name, "", reason=str(unfit)))
    if not subjects:
        raise HarnessError(f"no FMU in {folder} is asked about: {found[0].reason}; name another folder")
    names = tuple(subject.fmu.stem for subject in subjects)
    reasons = [absent(importer, subjects[0].fmu) for importer in IMPORTERS]
    present = [importer for importer, reason in zip(IMPORTERS, reasons, strict=True) if not reason]
    # fmpy first, whose answers the others are set beside
    with closing(map_in_threads(WORKERS, partial(ask, subjects), present)) as asked:
        for importer, reason in zip(IMPORTERS, reasons, strict=True):
            if reason:
                found.append(Checked(importer.name, "", reason=reason))
                continue
            report(importer.name, 0.0)
            next(asked)
            columns = [judged(importer, subject) for subject in subjects]
            report(importer.name, 1.0)
            name = titled(importer, subjects[0].basis)
            for check, *cells in zip(CHECKS, *columns, strict=True):
                failed = tuple(f"{m}: {cell}" for m, cell in zip(names, cells, strict=True) if "FAILED" in cell)
                found.append(Checked(name, check, tuple(cells), failed, fmus=names))
    return found + [Checked(name, "", reason=reason) for name, reason in ELSEWHERE.items()]


def titled(importer: Importer, request: Request) -> str:
    """Its name, and its version if it lives to tell it."""
    try:
        return f"{importer.name} {play(importer, request).answer.version}"
    except Wrong:
        return importer.name


def fmus(folder: Path) -> list[Path]:
    """The FMUs of a folder, by name."""
    found = sorted(folder.glob("*.fmu"))
    if not found:
        raise HarnessError(f"there is no FMU in {folder}: build them with `python build_fmus.py`, or name another one")
    return found


def ask(subjects: list[Subject], importer: Importer) -> None:
    """Ask an importer all that is judged: one process about all FMUs, in C one about each."""
    asked = [[request(subject) for _, request in CHECKS.values()] for subject in subjects]
    if importer.player != "by_c":  # one life, of which fmpy's is what those in C are set beside
        asked = [[replace(request, lives=0) for requests in asked for request in requests]]
    for requests in asked:
        prepare(importer, requests)


def judged(importer: Importer, subject: Subject) -> list[str]:
    """What every check gives."""
    return [cell(judge, importer, request(subject)) for judge, request in CHECKS.values()]


def cell(judge: Judge, importer: Importer, request: Request) -> str:
    """What one gives."""
    try:
        return judge(importer, request)
    except Wrong as wrong:
        return f"FAILED: {wrong}"


def table(found: list[Checked]) -> Table:
    """The rows for reading."""
    shown = Table("importer", "check", *models(found), box=None)
    last = ""
    for row in found:
        if row.check:
            shown.add_row(row.importer if row.importer != last else "", row.check, *row.cells)
            last = row.importer
    return shown


def sentences(found: list[Checked]) -> list[str]:
    """What the words in the table mean, and which tools were not asked."""
    words = "numbers: largest difference from fmpy; told: in one sentence, then NaN; reset recovers, or the tool ends"
    return [words, *(f"{row.importer} was not asked: {row.reason}" for row in found if row.reason)]


def models(found: list[Checked]) -> tuple[str, ...]:
    """The names of the FMUs."""
    return next((row.fmus for row in found if row.fmus), ())


def save(found: list[Checked], path: Path) -> None:
    """Write the rows as CSV."""
    names = models(found)
    nothing = ("",) * len(names)
    rows = ((row.importer, row.check or f"not asked: {row.reason}", *(row.cells or nothing)) for row in found)
    write_csv_rows(path, ["importer", "check", *names], rows)
