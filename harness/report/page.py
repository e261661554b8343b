"""Writes the HTML page. All HTML of the harness is in page.html."""

import os
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from ..errors import HarnessError
from ..results.provenance import HARNESS, package_version
from .gallery import build_gallery
from .method_choice import ACCURACIES, read_method_choices
from .sections import PublishedScene, Section, build_sections
from .typeset import typeset
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
ENVIRONMENT.filters["typeset"] = typeset
TEMPLATE = ENVIRONMENT.get_template("page.html")


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
    if not any(part.has_results or part.unreadable for section in page_sections for part in section.parts):
        raise HarnessError(f"no results in {results}: run `python -m harness`, or choose another --out")
    path = results / FILE
    temporary = path.with_suffix(".new")
    try:
        temporary.write_text(render_page(page_sections, scenes, results), encoding="utf-8", errors="replace")
        temporary.replace(path)
    except OSError as error:
        raise HarnessError(f"cannot write {path}: {error.strerror}") from None
    return ReportPage(path, tuple(gap for section in page_sections for gap in section.missing))


def render_page(page_sections: list[Section], scenes: Sequence[PublishedScene], results: Path) -> str:
    """Return the HTML of the page. It refers to no other file, so that a copy of it is complete."""
    sketches = build_gallery(scenes, results)
    choices = read_method_choices(results)
    # without results of the shipped models, the page begins with the runs of the user's models
    runs = [section for section in page_sections if section.name == "runs" and section.parts]
    leading = [] if sketches else [replace(section, title="Runs") for section in runs]
    following = [section for section in page_sections if section.parts and (sketches or section not in runs)]
    has_live_page = LIVE_PAGE.is_file()
    return TEMPLATE.render(
        relative_path=lambda file: Path(os.path.relpath(file, results)).as_posix(),
        embed_file=embed_file,
        leading=leading,
        sections=following,
        missing=[gap for section in page_sections for gap in section.missing],
        sketches=sketches,
        verdicts=build_verdicts(results, scenes, choices),
        advice=ADVICE,
        accuracies=ACCURACIES,
        choices=choices,
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
