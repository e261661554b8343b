"""The page itself; the only home of HTML in the harness."""

import os
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
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
LIVE_PAGE = Path("fmus/web/index.html")  # the page that runs, where it has been built
ADVICE = (
    "Dry friction that must hold: the law hybrid. Stick and slip are modes, what is stuck does not creep, and every "
    "change of mode is an event at its own time.",
    "Where the model is linear between events: the method exact. It costs least, and is right to rounding.",
    "The laws sign and threshold are there to show what the usual shortcuts cost: they chatter.",
    "The magic formula where a smooth curve is wanted: the method rodas, since it is stiff.",
)


@dataclass(frozen=True)
class ReportPage:
    """Where the page was written, and what it could not show: name and command of each."""

    path: Path
    missing: tuple[tuple[str, str], ...]


def write_report(results: Path, scenes: Sequence[PublishedScene]) -> ReportPage:
    """Write the page of all results below a folder into it; HarnessError if there are none."""
    found = build_sections(results, scenes)
    if not any(part.grid or part.pictures or part.unreadable for section in found for part in section.parts):
        raise HarnessError(
            f"there are no results in {results}: make some with `python -m harness`, or name another --out"
        )
    path = results / FILE
    fresh = path.with_suffix(".new")
    try:
        fresh.write_text(
            render_page(found, build_gallery(scenes, results), results), encoding="utf-8", errors="replace"
        )
        fresh.replace(path)
    except OSError as error:
        raise HarnessError(f"cannot write {path}: {error.strerror}") from None
    return ReportPage(path, tuple(gap for section in found for gap in section.missing))


def render_page(found: list[Section], sketches: tuple[GalleryEntry, ...], results: Path) -> str:
    """The HTML text of a page that lies in the folder of the results."""
    measured = [part.sentences for section in found if section.name == "precision" for part in section.parts]
    return TEMPLATE.render(
        beside=lambda file: quote(os.fsencode(Path(os.path.relpath(file, results)).as_posix())),
        sections=found,
        sketches=sketches,
        advice=ADVICE,
        measured=[split_clauses(sentence) for sentences in measured for sentence in sentences],
        live=LIVE_PAGE if LIVE_PAGE.is_file() else None,
        bench=LIVE_PAGE.read_text(encoding="utf-8", errors="replace") if LIVE_PAGE.is_file() else "",
        made=f"{date.today()}, {HARNESS} {package_version(HARNESS)}, {platform.platform()}",
    )


def split_clauses(sentence: str) -> tuple[str, list[str]]:
    """A long piece of advice: the model that it is about, and its clauses, each of which may hold brackets.

    >>> clauses("smd: use exact (1e-15; ode45 2 times); no more.")
    ('smd', ['use exact (1e-15; ode45 2 times)', 'no more'])
    """
    model, _, rest = sentence.rstrip(".").partition(": ")
    return (model, re.split(r"; (?![^()]*\))", rest)) if rest else ("", [sentence])
