"""Sections of the report, from the summaries of results; missing results are listed with their commands."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import HarnessError
from ..results.provenance import FILE as PROVENANCE_FILE
from ..results.provenance import load_provenance
from ..results.registry import STUDIES
from ..results.summary import (
    METHODS_TABLE,
    PICTURE_FILE,
    STEPS_TABLE,
    SUMMARY_FILE,
    MissingResult,
    Summary,
    SummaryTable,
    read_summary,
)
from .embedding import encode_figure
from .verdicts import PUBLISHED, REFERENCE

COLLECTED_TABLES = (STEPS_TABLE, METHODS_TABLE)  # shown together, not with each result


@dataclass(frozen=True)
class ComparedScene:
    """A shipped scene with known values: its name, its model, and a description of the model (may be empty)."""

    name: str
    model: str
    about: str


@dataclass(frozen=True)
class ResultItem:
    """A result in the report.

    Attributes
    ----------
    folder : pathlib.Path
        Folder of the result.
    summary : Summary
        Summary of the result.
    source : str
        Source in its provenance: a shipped scene by name, or a path.
    picture : str
        Figure as a data URL; empty without one.
    error : str
        Reason why the result cannot be shown; otherwise empty.
    """

    folder: Path
    summary: Summary
    source: str = ""
    picture: str = ""
    error: str = ""


@dataclass(frozen=True)
class Section:
    """Section of the report.

    Attributes
    ----------
    study : str
        Study whose results are shown.
    title, intro : str
        Title and introduction.
    missing_name, command : str
        Name and command of a result of the study, for the list of missing results.
    items : tuple of ResultItem
        Results in the section.
    """

    study: str
    title: str
    intro: str
    missing_name: str = ""
    command: str = ""
    items: tuple[ResultItem, ...] = ()


RUNS, STEPS = "run", "steps"


def make_sections(verifies: bool) -> tuple[Section, ...]:
    """Return the sections of the studies that verify the project, or of the others."""
    return tuple(
        Section(study.name, study.title, study.intro, *study.example) for study in STUDIES if study.verifies == verifies
    )


USER_SECTIONS = make_sections(verifies=False)
OWN_SECTIONS = (
    Section(
        PUBLISHED,
        "Published cases",
        "Each value that a publication prints, beside the measured one; the publication is named with each case. "
        "Run times depend on the machine.",
    ),
    Section(
        REFERENCE,
        "Cases with a reference or a parameter",
        "Values that no publication prints: a reference is a closed form or a certified result; a parameter is the "
        "value that was set.",
    ),
    Section(
        STEPS,
        "Steps",
        "Internal steps, read from solver.t_next, independent of the communication step. If friction jumps without an "
        "event, the steps collapse at every reversal; with stick and slip as modes they do not.",
    ),
    *make_sections(verifies=True),
    Section(
        "importers",
        "Importers",
        "The same FMUs in other tools. Numbers are the largest difference from fmpy, relative to the largest value; "
        "message: the tool reports the error of the FMU; - : not checked with this tool.",
    ),
    Section("rivals", "Rivals", "The same scenes in other engines, at their defaults and at their best settings."),
    Section(
        "bench",
        "Benchmarks",
        "Targets, measured values and baselines of the same run. Times depend on the machine and on its load.",
    ),
)
SECTIONS = USER_SECTIONS + OWN_SECTIONS


def read_items(results: Path) -> list[ResultItem]:
    """Read all results in a folder, in the order of their names."""
    files = (SUMMARY_FILE, PROVENANCE_FILE)  # a result of an earlier version has a provenance only
    folders = {
        file.parent for depth in ("[!.]*", "[!.]*/[!.]*") for name in files for file in results.glob(f"{depth}/{name}")
    }
    return [read_item(folder, results) for folder in sorted(folders)]


def read_item(folder: Path, results: Path) -> ResultItem:
    """Read a result with its figure."""
    try:
        summary = read_summary(folder)
        picture = read_picture(folder / PICTURE_FILE) if summary.picture else ""
        return ResultItem(folder, summary, load_provenance(folder).get("source", ""), picture)
    except (HarnessError, OSError) as error:
        first, *_ = folder.relative_to(results).parts
        studies = [section.study for section in SECTIONS if section.study not in (PUBLISHED, REFERENCE, STEPS)]
        study = first if first in studies else RUNS
        text = f"{folder} cannot be shown: {error}."
        return ResultItem(folder, Summary(study, folder.name, (text,)), error=text)


def read_picture(file: Path) -> str:
    """Return a figure as a data URL; raise HarnessError if it is not a complete SVG drawing."""
    text = file.read_text(encoding="utf-8", errors="replace")
    if not ("<svg" in text and text.rstrip().endswith("</svg>")):
        raise HarnessError(f"{file.name} is not a complete SVG drawing: repeat the command that wrote it")
    return encode_figure(text)


def build_sections(items: Sequence[ResultItem], scenes: Sequence[ComparedScene]) -> list[Section]:
    """Return the sections that have results.

    Shipped scenes are in their order. In other sections, results of the user are first, and judged ones among them.
    """
    order = {scene.name: i for i, scene in enumerate(scenes)}

    def rank(item: ResultItem) -> tuple[int, bool]:
        is_compared = find_section(item, scenes) in (PUBLISHED, REFERENCE)
        position = order.get(item.summary.title, len(order)) if is_compared else int(item.source in order)
        return position, item.summary.outcome is None

    items = sorted(items, key=rank)
    known = [section.study for section in SECTIONS]
    others = dict.fromkeys(item.summary.study for item in items if find_section(item, scenes) not in known)
    sections = []
    for section in (*SECTIONS, *(Section(study, study, "") for study in others)):  # no result is left out
        selected = tuple(item for item in items if find_section(item, scenes) == section.study)
        if section.study == STEPS:
            selected = tuple(steps_item(table) for table in collect_tables(items, STEPS_TABLE))
        if selected:
            sections.append(replace(section, items=selected))
    return sections


def find_section(item: ResultItem, scenes: Sequence[ComparedScene]) -> str:
    """Return the section of a result: that of its study, or for the run of a shipped scene that of its values."""
    outcome = item.summary.outcome
    if item.summary.study == RUNS and outcome and item.source in [scene.name for scene in scenes]:
        return PUBLISHED if outcome.kind == "published" else REFERENCE
    return item.summary.study


def steps_item(table: SummaryTable) -> ResultItem:
    """Return the item that shows step statistics of several runs in one table."""
    return ResultItem(Path(), Summary(STEPS, table.title, tables=(replace(table, title=""),)))


def collect_tables(items: Iterable[ResultItem], title: str) -> tuple[SummaryTable, ...]:
    """Return one table with the rows of all tables of this title in judged results; nothing without rows."""
    tables = [table for item in items if item.summary.outcome for table in item.summary.tables if table.title == title]
    return (replace(tables[0], rows=tuple(row for table in tables for row in table.rows)),) if tables else ()


def list_missing(
    items: Iterable[ResultItem], sections: Sequence[Section], scenes: Sequence[ComparedScene]
) -> list[MissingResult]:
    """Return the missing results, and those that the studies left out."""
    titles = [(find_section(item, scenes), item.summary.title) for item in items]
    missing = [
        MissingResult(scene.name, f"run {scene.name}")
        for scene in scenes
        if not {(PUBLISHED, scene.name), (REFERENCE, scene.name)} & {*titles}
    ]
    models = sorted({scene.model for scene in scenes})
    missing += [MissingResult(model, f"precision {model}") for model in models if ("precision", model) not in titles]
    studies = [section.study for section in sections]
    missing += [
        MissingResult(section.missing_name, section.command)
        for section in SECTIONS
        if section.command and section.study not in studies
    ]
    left_out = [gap for item in items for gap in item.summary.missing]
    return [MissingResult(gap.name, f"friction-fmus {gap.command}") for gap in missing] + left_out
