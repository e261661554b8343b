"""Sections of the report, from the summaries of results; missing results are listed with their commands."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import HarnessError
from ..results.provenance import FILE as PROVENANCE_FILE
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

COLLECTED_TABLES = (STEPS_TABLE, METHODS_TABLE)  # shown together, not with each result


@dataclass(frozen=True)
class PublishedScene:
    """A scene with published values: its name, its model, and a description of the model (may be empty)."""

    name: str
    model: str
    about: str


@dataclass(frozen=True)
class ResultItem:
    """A result in the report: folder, summary, and the figure as a data URL; or the reason why it cannot be shown."""

    folder: Path
    summary: Summary
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


PUBLISHED, RUNS, STEPS = "published", "run", "steps"
SECTIONS = (
    Section(
        PUBLISHED, "Published cases", "Each published value with the measured one. Run times depend on the machine."
    ),
    Section(RUNS, "Other runs", "User scenes and FMUs, with first and last values."),
    Section(
        "decay",
        "Decay",
        "Damping, dry friction and drag from the whole signal and from its turning points, with 95 % intervals.",
        "a decay",
        "decay coulomb",
    ),
    Section("fit", "Fits", "Parameters of FMUs from measured records, with 95 % intervals."),
    Section(
        STEPS,
        "Steps",
        "Internal steps, read from solver.t_next, independent of the communication step. If friction jumps without an "
        "event, the steps collapse at every reversal; with stick and slip as modes they do not.",
    ),
    Section(
        "precision",
        "Error against run time",
        "Error against run time and right-hand side evaluations; lower left is better. References are certified. FMU "
        "is the code of the FMU in this process; scipy and cvode solve the same equations.",
    ),
    Section(
        "stability",
        "Stability",
        "Every case either finishes within its error bound or is rejected with an error message; none hangs.",
        "stability",
        "stability",
    ),
    Section(
        "importers",
        "Importers",
        "The same FMUs in other tools. Numbers are the largest difference from fmpy, relative to the largest value; "
        "message: the tool reports the error of the FMU; - : not checked with this tool.",
    ),
    Section(
        "sweep",
        "Sweeps",
        "Parameter sweeps; known boundaries are dashed.",
        "a sweep",
        "sweep stickslip --vary mu_d=0.3:0.9:60 --vary v_driver=0.01:0.1:60 --measure slips",
    ),
    Section(
        "compare",
        "Comparisons",
        "Differences between two results or FMUs.",
        "a comparison",
        "compare results/coulomb results/coulomb-sign",
    ),
    Section(
        "coupled",
        "Coupled",
        "Coupled FMUs, run by existing engines and compared with one model of the whole system.",
        "a coupled scene",
        "couple two-masses",
    ),
    Section("rivals", "Rivals", "The same scenes in other engines, at their defaults and at their best settings."),
    Section(
        "bench",
        "Benchmarks",
        "Targets, measured values and baselines of the same run. Times depend on the machine and on its load.",
    ),
)


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
        return ResultItem(folder, summary, read_picture(folder / PICTURE_FILE) if summary.picture else "")
    except (HarnessError, OSError) as error:
        first, *_ = folder.relative_to(results).parts
        study = first if first in [section.study for section in SECTIONS[2:]] else RUNS
        text = f"{folder} cannot be shown: {error}."
        return ResultItem(folder, Summary(study, folder.name, (text,)), error=text)


def read_picture(file: Path) -> str:
    """Return a figure as a data URL; raise HarnessError if it is not a complete SVG drawing."""
    data = file.read_bytes()
    if not (b"<svg" in data and data.rstrip().endswith(b"</svg>")):
        raise HarnessError(f"{file.name} is not a complete SVG drawing: repeat the command that wrote it")
    return f"data:image/svg+xml;base64,{b64encode(data).decode()}"


def build_sections(items: Sequence[ResultItem], scenes: Sequence[PublishedScene]) -> list[Section]:
    """Return the sections that have results; published scenes are in their order, judged results first."""
    order = {scene.name: i for i, scene in enumerate(scenes)}

    def rank(item: ResultItem) -> int:
        is_published = find_section(item) == PUBLISHED
        return order.get(item.summary.title, len(order)) if is_published else item.summary.outcome is None

    items = sorted(items, key=rank)
    sections = []
    for section in SECTIONS:
        selected = tuple(item for item in items if find_section(item) == section.study)
        if section.study == STEPS:
            selected = tuple(steps_item(table) for table in collect_tables(items, STEPS_TABLE))
        if selected:
            sections.append(replace(section, items=selected))
    return sections


def find_section(item: ResultItem) -> str:
    """Return the section of a result: a run is a published case if it is compared with published values."""
    return PUBLISHED if item.summary.study == RUNS and item.summary.outcome else item.summary.study


def steps_item(table: SummaryTable) -> ResultItem:
    """Return the item that shows step statistics of several runs in one table."""
    return ResultItem(Path(), Summary(STEPS, table.title, tables=(replace(table, title=""),)))


def collect_tables(items: Iterable[ResultItem], title: str) -> tuple[SummaryTable, ...]:
    """Return one table with the rows of all tables of this title in judged results; nothing without rows."""
    tables = [table for item in items if item.summary.outcome for table in item.summary.tables if table.title == title]
    return (replace(tables[0], rows=tuple(row for table in tables for row in table.rows)),) if tables else ()


def list_missing(
    items: Iterable[ResultItem], sections: Sequence[Section], scenes: Sequence[PublishedScene]
) -> list[MissingResult]:
    """Return the missing results, and those that the studies left out."""
    titles = [(find_section(item), item.summary.title) for item in items]
    missing = [
        MissingResult(scene.name, f"run {scene.name}") for scene in scenes if (PUBLISHED, scene.name) not in titles
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
