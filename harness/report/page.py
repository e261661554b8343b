"""The page itself; the only home of HTML in the harness."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from ..errors import HarnessError
from .sections import Published, Section, sections

FILE = "report.html"
ADVICE = (
    "Dry friction that must hold: the law hybrid. Stick and slip are modes, what is stuck does not creep, and every "
    "change of mode is an event at its own time.",
    "Where the model is linear between events: the method exact. It costs least, and is right to rounding.",
    "The laws sign and threshold are there to show what the usual shortcuts cost: they chatter.",
    "The magic formula where a smooth curve is wanted: the method rodas, since it is stiff.",
)


@dataclass(frozen=True)
class Page:
    """Where the page was written, and what it could not show: name and command of each."""

    path: Path
    missing: tuple[tuple[str, str], ...]


def write(results: Path, scenes: Sequence[Published]) -> Page:
    """Write the page of all results below a folder into it; HarnessError if there are none."""
    found = sections(results, scenes)
    if not any(part.grid or part.pictures or part.lost for section in found for part in section.parts):
        raise HarnessError(
            f"there are no results in {results}: make some with `python -m harness`, or name another --out"
        )
    path = results / FILE
    fresh = path.with_suffix(".new")
    try:
        fresh.write_text(page(found), encoding="utf-8", errors="replace")
        fresh.replace(path)
    except OSError as error:
        raise HarnessError(f"cannot write {path}: {error.strerror}") from None
    return Page(path, tuple(gap for section in found for gap in section.missing))


def page(found: list[Section]) -> str:
    """The HTML text."""
    environment = Environment(
        loader=PackageLoader(__package__, "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    measured = [part.sentences for section in found if section.name == "precision" for part in section.parts]
    advice = [*ADVICE, *(sentence for sentences in measured for sentence in sentences)]
    return environment.get_template("page.html").render(sections=found, advice=advice)
