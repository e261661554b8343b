"""Writes the HTML page. All HTML of the harness is in page.html."""

import os
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined

from ..errors import HarnessError
from ..results.provenance import HARNESS, package_version
from .gallery import GalleryEntry, build_gallery
from .sections import PublishedScene, Section, build_sections

FILE = "report.html"
TEMPLATE = Environment(
    loader=PackageLoader(__package__, "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
).get_template("page.html")
LIVE_PAGE = Path("fmus/web/index.html")  # the interactive page, if it has been built
ADVICE = (
    "For dry friction with sticking use the law hybrid: stick and slip are modes, a stuck body does not creep, and "
    "every change of mode is located as an event.",
    "If the model is linear between events, use the method exact: it is the fastest and accurate to rounding.",
    "The laws sign and threshold show the cost of common approximations: they chatter.",
    "For a smooth friction curve use the magic formula with the method rodas, because it is stiff.",
)


@dataclass(frozen=True)
class ReportPage:
    """Path of the written page, and the missing results: name and command of each."""

    path: Path
    missing: tuple[tuple[str, str], ...]


def write_report(results: Path, scenes: Sequence[PublishedScene]) -> ReportPage:
    """Write the page of all results in a folder to that folder.

    Raises
    ------
    HarnessError
        If there are no results or the page cannot be written.
    """
    page_sections = build_sections(results, scenes)
    if not any(part.grid or part.pictures or part.unreadable for section in page_sections for part in section.parts):
        raise HarnessError(f"no results in {results}: run `python -m harness`, or choose another --out")
    path = results / FILE
    temporary = path.with_suffix(".new")
    try:
        temporary.write_text(
            render_page(page_sections, build_gallery(scenes, results), results), encoding="utf-8", errors="replace"
        )
        temporary.replace(path)
    except OSError as error:
        raise HarnessError(f"cannot write {path}: {error.strerror}") from None
    return ReportPage(path, tuple(gap for section in page_sections for gap in section.missing))


def render_page(page_sections: list[Section], sketches: tuple[GalleryEntry, ...], results: Path) -> str:
    """Return the HTML of the page; its links are relative to the results folder."""
    measured = [part.sentences for section in page_sections if section.name == "precision" for part in section.parts]
    # without results of the shipped models, the page begins with the runs of the user's models
    runs = [section for section in page_sections if section.name == "runs" and section.parts]
    leading = [] if sketches else [replace(section, title="Runs") for section in runs]
    return TEMPLATE.render(
        relative_link=lambda file: quote(os.fsencode(Path(os.path.relpath(file, results)).as_posix())),
        leading=leading,
        sections=[section for section in page_sections if sketches or section not in runs],
        sketches=sketches,
        advice=ADVICE,
        measured=[split_clauses(sentence) for sentences in measured for sentence in sentences],
        live=LIVE_PAGE if LIVE_PAGE.is_file() else None,
        bench=LIVE_PAGE.read_text(encoding="utf-8", errors="replace") if LIVE_PAGE.is_file() else "",
        made=f"{date.today()}, {HARNESS} {package_version(HARNESS)}, {platform.platform()}",
    )


def split_clauses(sentence: str) -> tuple[str, list[str]]:
    """Split a long recommendation into the model and its clauses; semicolons in parentheses do not separate clauses.

    >>> clauses("smd: use exact (1e-15; ode45 2 times); no more.")
    ('smd', ['use exact (1e-15; ode45 2 times)', 'no more'])
    """
    model, _, rest = sentence.rstrip(".").partition(": ")
    return (model, re.split(r"; (?![^()]*\))", rest)) if rest else ("", [sentence])
