"""HTML page of the report. All HTML of the harness is in page.html."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import escape

from ..errors import HarnessError
from ..results.provenance import HARNESS, package_version
from ..results.summary import METHODS_TABLE, SKETCH_SIZE, MissingResult
from .embedding import MAX_PAGE_BYTES, Budget, encode_data
from .sections import (
    COLLECTED_TABLES,
    RUNS,
    USER_SECTIONS,
    ComparedScene,
    ResultItem,
    Section,
    build_sections,
    collect_tables,
    find_section,
    list_missing,
    read_items,
)
from .typeset import is_text_column, typeset
from .verdicts import build_verdicts

FILE = "report.html"
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


def write_report(results: Path, scenes: Sequence[ComparedScene]) -> ReportPage:
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
    finally:
        temporary.unlink(missing_ok=True)
    return ReportPage(path, tuple(missing))


def render_page(
    items: Sequence[ResultItem],
    sections: Sequence[Section],
    missing: Sequence[MissingResult],
    scenes: Sequence[ComparedScene],
    results: Path,
) -> str:
    """Return the HTML of the page, which refers to no other file, so that a copy of the page is complete.

    Figures, the live page and data files are embedded, in this order, as far as the page stays small; the results of
    the user come first. Files that are not embedded are named.
    """
    sketches = {item.summary.title: item.summary.sketches for item in items if item.summary.sketches}
    studies = [section.study for section in USER_SECTIONS]
    content = {
        "relative_path": lambda file: Path(os.path.relpath(file, results)).as_posix(),
        "missing": missing,
        "gallery": [(scene, sketches[scene.name]) for scene in scenes if scene.name in sketches and scene.about],
        "sketch_size": SKETCH_SIZE,
        "verdicts": build_verdicts(
            [item.summary for item in items if item.summary.study != RUNS or find_section(item, scenes) != RUNS]
        ),
        "advice": ADVICE,
        "collected_tables": COLLECTED_TABLES,
        "choices": collect_tables(items, METHODS_TABLE),
        "live": LIVE_PAGE.as_posix() if LIVE_PAGE.is_file() else "",
        "made": f"{date.today()} by {HARNESS} {package_version(HARNESS)}",
    }
    size_without_files = len(render(content, sections, studies, Budget(0)).encode(errors="replace"))
    return render(content, sections, studies, Budget(MAX_PAGE_BYTES - size_without_files))


def render(content: Mapping[str, Any], sections: Sequence[Section], studies: Sequence[str], budget: Budget) -> str:
    """Return the HTML of the page with the files that fit into the budget."""
    sections = [
        replace(section, items=tuple(replace(item, picture=budget.take(item.picture)) for item in section.items))
        for section in sections
    ]
    live = LIVE_PAGE.read_text(encoding="utf-8", errors="replace") if content["live"] else ""
    return TEMPLATE.render(
        content,
        yours=[section for section in sections if section.study in studies],
        ours=[section for section in sections if section.study not in studies],
        live_content=budget.take(live, escape),
        embed_file=lambda file: budget.take(encode_data(file)),
    )
