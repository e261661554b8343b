"""HTML page of the report. All HTML of the harness is in page.html."""

import os
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from ..errors import HarnessError
from ..results.provenance import HARNESS, package_version
from ..results.summary import METHODS_TABLE, SKETCH_SIZE, MissingResult
from .sections import (
    COLLECTED_TABLES,
    RUNS,
    PublishedScene,
    ResultItem,
    Section,
    build_sections,
    collect_tables,
    list_missing,
    read_items,
)
from .typeset import is_text_column, typeset
from .verdicts import build_verdicts

FILE = "report.html"
MAX_EMBEDDED_BYTES = 30_000  # larger data files are named, not embedded, so that the page loads at once
LIVE_PAGE = Path("fmus/web/index.html")  # the interactive page, if it has been built
ADVICE = (
    "For dry friction with sticking use the law hybrid: stick and slip are modes, a stuck body does not creep, and "
    "every change of mode is located as an event.",
    "If the model is linear between events, use the method exact: it is the fastest and accurate to rounding.",
    "The laws sign and threshold show the cost of common approximations: they chatter.",
    "For a smooth friction curve use the magic formula with the method radau9, because it is stiff.",
)
ENVIRONMENT = Environment(
    loader=PackageLoader(__package__, "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
)
ENVIRONMENT.filters |= {"typeset": typeset, "is_text_column": is_text_column}
TEMPLATE = ENVIRONMENT.get_template("page.html")


@dataclass(frozen=True)
class ReportPage:
    """Path of the written page, and the missing results."""

    path: Path
    missing: tuple[MissingResult, ...]


def write_report(results: Path, scenes: Sequence[PublishedScene]) -> ReportPage:
    """Write the page of all results in a folder to that folder.

    Raises
    ------
    HarnessError
        If there are no results or the page cannot be written.
    """
    items = read_items(results)
    if not items:
        raise HarnessError(f"no results in {results}: run `friction-fmus`, or choose another --out")
    sections = build_sections(items, scenes)
    missing = list_missing(items, sections, scenes)
    path = results / FILE
    temporary = path.with_suffix(".new")
    try:
        temporary.write_text(render_page(items, sections, missing, scenes, results), encoding="utf-8", errors="replace")
        temporary.replace(path)
    except OSError as error:
        raise HarnessError(f"cannot write {path}: {error.strerror}") from None
    return ReportPage(path, tuple(missing))


def render_page(
    items: Sequence[ResultItem],
    sections: Sequence[Section],
    missing: Sequence[MissingResult],
    scenes: Sequence[PublishedScene],
    results: Path,
) -> str:
    """Return the HTML of the page. It refers to no other file, so a copy of the page is complete."""
    summaries = {item.summary.title: item.summary for item in items if item.summary.sketches}
    gallery = [(scene, summaries[scene.name].sketches) for scene in scenes if scene.name in summaries and scene.about]
    # without results of the shipped models, the page begins with the runs of the user's models
    leading = [] if gallery else [replace(section, title="Runs") for section in sections if section.study == RUNS]
    has_live_page = LIVE_PAGE.is_file()
    return TEMPLATE.render(
        relative_path=lambda file: Path(os.path.relpath(file, results)).as_posix(),
        embed_file=embed_file,
        leading=leading,
        sections=[section for section in sections if gallery or section.study != RUNS],
        missing=missing,
        gallery=gallery,
        sketch_size=SKETCH_SIZE,
        verdicts=build_verdicts([item.summary for item in items]),
        advice=ADVICE,
        collected_tables=COLLECTED_TABLES,
        choices=collect_tables(items, METHODS_TABLE),
        live=LIVE_PAGE.as_posix() if has_live_page else "",
        live_content=LIVE_PAGE.read_text(encoding="utf-8", errors="replace") if has_live_page else "",
        made=f"{date.today()} by {HARNESS} {package_version(HARNESS)}",
    )


def embed_file(file: Path) -> str:
    """Return a data file as a data URL; empty if it is large or cannot be read."""
    try:
        if file.stat().st_size > MAX_EMBEDDED_BYTES:
            return ""
        return f"data:text/csv;base64,{b64encode(file.read_bytes()).decode()}"
    except OSError:
        return ""
