"""The certified result of the default experiment, as the layered standard FMI-LS-REF 1.0.0-alpha.1 places it.

    extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml
    extra/org.fmi-standard.fmi-ls-ref/<name>_out.csv          time and the states, by their names

The numbers are those of harness/references, which stand there with the script that made them.
"""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from ..runtime.declare import Declared
from .document import document

FOLDER = Path(__file__).resolve().parents[2] / "harness" / "references"
INSIDE = "extra/org.fmi-standard.fmi-ls-ref"
VARIANTS = {"pacejka": "pacejka-0.01"}  # the file of the default values, where a model has several
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
STANDARD = {
    "name": "org.fmi-standard.fmi-ls-ref",
    "version": "1.0.0-alpha.1",
    "description": "Layered Standard providing information on related files included in an FMU.",
}


@dataclass(frozen=True)
class Reference:
    """Rows of time (s), position and speed, as they stand in the file; how they were got, and how well that agrees."""

    rows: list[list[str]]
    routes: str
    difference: str

    @property
    def told(self) -> str:
        """Where the numbers come from, in one sentence."""
        return f"Certified result of the default experiment: {self.routes}, relative difference {self.difference}."


def reference(name: str, declared: list[tuple[str, Declared]]) -> Reference | None:
    """The reference of a model, if it has one that holds for what is declared: with true sticking, where it sticks."""
    file = VARIANTS.get(name, name)
    laws: Any = next((meaning.items for variable, meaning in declared if variable == "friction"), ())
    if not (FOLDER / f"{file}.csv").is_file() or (laws and "hybrid" not in [label for label, _, _ in laws]):
        return None
    _, *rows = _read(file)
    routes, difference = next(rest for reference, *rest in _read("agreement") if reference == file)
    return Reference(rows, routes, difference)


def _read(file: str) -> list[list[str]]:
    with (FOLDER / f"{file}.csv").open(encoding="utf-8", newline="") as text:
        return list(csv.reader(text))


def integrated(declared: list[tuple[str, Declared]]) -> list[tuple[str, Declared]]:
    """The states that a solver integrates, in order."""
    return [(variable, meaning) for variable, meaning in declared if meaning.role == "state" and not meaning.rate]


def files(name: str, found: Reference, declared: list[tuple[str, Declared]]) -> dict[str, bytes]:
    """The result and its manifest, by their paths in the FMU."""
    lines = [["time", *(variable for variable, _ in integrated(declared))], *found.rows]
    result = "".join(",".join(line) + "\n" for line in lines)
    root = Element("fmiReferences", {"xmlns:fmi-ls": NAMESPACE})
    for key, text in STANDARD.items():
        root.set(f"fmi-ls:fmi-ls-{key}", text)
    related = {"source": f"{name}_out.csv", "role": "result", "type": "text/csv", "description": found.told}
    SubElement(root, "Related", related)
    return {f"{INSIDE}/{name}_out.csv": result.encode(), f"{INSIDE}/fmi-ls-manifest.xml": document(root)}
