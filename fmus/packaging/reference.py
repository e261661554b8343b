"""The certified result of the default experiment, as the layered standard FMI-LS-REF 1.0.0-alpha.1 places it.

    extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml
    extra/org.fmi-standard.fmi-ls-ref/<name>_out.csv          time and the states, by their names

The numbers lie beside the file of the model, under its name: `belt.csv`, whose first line tells after a # how they were
got and how well that agrees, the second what each column is.
"""

import csv
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from . import BuildError
from .document import document
from .further import Variables, integrated

INSIDE = "extra/org.fmi-standard.fmi-ls-ref"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
STANDARD = {
    "name": "org.fmi-standard.fmi-ls-ref",
    "version": "1.0.0-alpha.1",
    "description": "Layered Standard providing information on related files included in an FMU.",
}


@dataclass(frozen=True)
class Reference:
    """Rows of time (s) and the states, as they stand in the file; how they were got, and how well that agrees."""

    rows: list[list[str]]
    how: str

    @property
    def told(self) -> str:
        """Where the numbers come from, in one sentence."""
        return f"Certified result of the default experiment: {self.how}."


def reference(path: Path, declared: Variables) -> Reference | None:
    """The reference of the model in a file, if it has one that holds for what is declared: with true sticking, where it
    sticks."""
    laws: Any = next((meaning.items for variable, meaning in declared if variable == "friction"), ())
    if laws and "hybrid" not in [label for label, _, _ in laws]:
        return None
    beside = path.with_suffix(".csv")
    return _checked(beside, len(integrated(declared))) if beside.is_file() else None


def _checked(file: Path, states: int) -> Reference:
    """That in a file; BuildError where it is no such table."""
    text = file.read_text(encoding="utf-8", errors="replace")
    how, _, table = text.partition("\n")
    rows = list(csv.reader(table.splitlines()))[1:]
    if how[:1] != "#" or not how[1:].strip() or len(rows) < 2 or not all(_is_row(row, states) for row in rows):
        raise BuildError(
            f"{file} is no certified result: its first line tells after a # how the numbers were got, the second what "
            f"each column is, and the others hold the time in s, from 0 on, and {states} states, all finite numbers."
        )
    return Reference(rows, how[1:].strip().rstrip("."))


def _is_row(row: list[str], states: int) -> bool:
    try:
        return len(row) == 1 + states and all(isfinite(float(word)) for word in row)
    except ValueError:
        return False


def files(name: str, found: Reference, declared: Variables) -> dict[str, bytes]:
    """The result and its manifest, by their paths in the FMU."""
    lines = [["time", *(variable for variable, _ in integrated(declared))], *found.rows]
    result = "".join(",".join(line) + "\n" for line in lines)
    root = Element("fmiReferences", {"xmlns:fmi-ls": NAMESPACE})
    for key, text in STANDARD.items():
        root.set(f"fmi-ls:fmi-ls-{key}", text)
    related = {"source": f"{name}_out.csv", "role": "result", "type": "text/csv", "description": found.told}
    SubElement(root, "Related", related)
    return {f"{INSIDE}/{name}_out.csv": result.encode(), f"{INSIDE}/fmi-ls-manifest.xml": document(root)}
