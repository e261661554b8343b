"""HTML page of the report. All HTML of the harness is in page.html."""

import os
from base64 import b64encode
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from ..errors import HarnessError
from ..results.provenance import FILE as PROVENANCE_FILE
from ..results.provenance import HARNESS, package_version
from ..results.registry import STUDIES
from ..results.summary import PICTURE_FILE, SUMMARY_FILE, Summary, read_summary
from .typeset import is_text_column, typeset

FILE = "report.html"
LIVE_PAGE = Path("fmus/web/index.html")  # the interactive page; `friction-fmus build --web` writes it
ENVIRONMENT = Environment(
    loader=PackageLoader(__package__, "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
)
ENVIRONMENT.filters |= {"typeset": typeset, "is_text_column": is_text_column}
TEMPLATE = ENVIRONMENT.get_template("page.html")


@dataclass(frozen=True)
class ResultItem:
    """A result in the report: its folder, its summary, and its figure as a data URL, which is empty without one."""

    folder: Path
    summary: Summary
    picture: str = ""


@dataclass(frozen=True)
class Section:
    """Section of the report: the results of a study, with the title and the introduction of the study."""

    study: str
    title: str
    intro: str
    items: tuple[ResultItem, ...] = ()


def write_report(results: Path) -> Path:
    """Write the page of all results in a folder to that folder, and return its path.

    Raises
    ------
    HarnessError
        If there are no results or the page cannot be written.
    """
    items = read_items(results)
    if not items:
        raise HarnessError(f"no results in {results}: run a command that writes some, or choose another --out")
    page = TEMPLATE.render(
        sections=build_sections(items),
        live=relative_path(LIVE_PAGE, results),
        made=f"{date.today()} by {HARNESS} {package_version(HARNESS)}",
        relative_path=lambda file: relative_path(file, results),
    )
    path = results / FILE
    temporary = path.with_suffix(".new")
    try:
        temporary.write_text(page, encoding="utf-8", errors="replace")
        temporary.replace(path)
    except OSError as error:
        raise HarnessError(f"cannot write {path}: {error.strerror}") from None
    finally:
        temporary.unlink(missing_ok=True)
    return path


def relative_path(file: Path, folder: Path) -> str:
    """Return the path of a file relative to a folder, as in a link."""
    return Path(os.path.relpath(file, folder)).as_posix()


def read_items(results: Path) -> list[ResultItem]:
    """Read all results in a folder, in the order of their names."""
    files = (SUMMARY_FILE, PROVENANCE_FILE)  # a result of an earlier version has a provenance only
    folders = {
        file.parent for depth in ("[!.]*", "[!.]*/[!.]*") for name in files for file in results.glob(f"{depth}/{name}")
    }
    return [read_item(folder, results) for folder in sorted(folders)]


def read_item(folder: Path, results: Path) -> ResultItem:
    """Read a result with its figure; a result that cannot be shown states why."""
    try:
        summary = read_summary(folder)
        return ResultItem(folder, summary, read_picture(folder / PICTURE_FILE) if summary.picture else "")
    except (HarnessError, OSError) as error:
        first, *_ = folder.relative_to(results).parts
        study = first if first in [study.name for study in STUDIES] else "run"
        return ResultItem(folder, Summary(study, folder.name, (f"{folder} cannot be shown: {error}.",)))


def read_picture(file: Path) -> str:
    """Return a figure as a data URL; raise HarnessError if it is not a complete SVG drawing."""
    text = file.read_text(encoding="utf-8", errors="replace")
    if not ("<svg" in text and text.rstrip().endswith("</svg>")):
        raise HarnessError(f"{file.name} is not a complete SVG drawing: repeat the command that wrote it")
    return f"data:image/svg+xml;base64,{b64encode(text.encode(errors='replace')).decode()}"


def build_sections(items: list[ResultItem]) -> list[Section]:
    """Return the sections that have results: first those with results of the user, then by the order of the studies.

    Runs that are compared with known values, as those of the project, are last within their section.
    """
    items = sorted(items, key=is_compared)
    study_sections = {study.name: Section(study.name, study.title, study.intro) for study in STUDIES}
    others = {item.summary.study: Section(item.summary.study, item.summary.study, "") for item in items}
    sections = [
        replace(section, items=tuple(item for item in items if item.summary.study == section.study))
        for section in (others | study_sections).values()
    ]
    order = [*study_sections, *others]
    return sorted(
        (section for section in sections if section.items),
        key=lambda section: (all(map(is_compared, section.items)), order.index(section.study)),
    )


def is_compared(item: ResultItem) -> bool:
    """Return whether a result is compared with known values."""
    return item.summary.outcome is not None and item.summary.outcome.deviation is not None
