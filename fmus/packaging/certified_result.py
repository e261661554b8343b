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
from .fmi_variables import Variables, integrated_states
from .xml_output import xml_bytes

RESULT_FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
STANDARD = {
    "name": "org.fmi-standard.fmi-ls-ref",
    "version": "1.0.0-alpha.1",
    "description": "Layered Standard providing information on related files included in an FMU.",
}


@dataclass(frozen=True)
class CertifiedResult:
    """Rows of time (s) and the states, as they stand in the file; how they were got, and how well that agrees."""

    rows: list[list[str]]
    provenance: str

    @property
    def caption(self) -> str:
        """Where the numbers come from, in one sentence."""
        return f"Certified result of the default experiment: {self.provenance}."


def find_certified_result(path: Path, declared: Variables) -> CertifiedResult | None:
    """The reference of the model in a file, if it has one that holds for what is declared: with true sticking, where it
    sticks."""
    laws: Any = next((meaning.items for variable, meaning in declared if variable == "friction"), ())
    if laws and "hybrid" not in [label for label, _, _ in laws]:
        return None
    beside = path.with_suffix(".csv")
    return _read_table(beside, len(integrated_states(declared))) if beside.is_file() else None


def _read_table(file: Path, states: int) -> CertifiedResult:
    """That in a file; BuildError where it is no such table."""
    text = file.read_text(encoding="utf-8", errors="replace")
    provenance, _, table = text.partition("\n")
    rows = list(csv.reader(table.splitlines()))[1:]
    if (
        provenance[:1] != "#"
        or not provenance[1:].strip()
        or len(rows) < 2
        or not all(_is_row(row, states) for row in rows)
    ):
        raise BuildError(
            f"{file} is no certified result: its first line tells after a # how the numbers were got, the second what "
            f"each column is, and the others hold the time in s, from 0 on, and {states} states, all finite numbers."
        )
    return CertifiedResult(rows, provenance[1:].strip().rstrip("."))


def _is_row(row: list[str], states: int) -> bool:
    try:
        return len(row) == 1 + states and all(isfinite(float(word)) for word in row)
    except ValueError:
        return False


def result_files(name: str, found: CertifiedResult, declared: Variables) -> dict[str, bytes]:
    """The result and its manifest, by their paths in the FMU."""
    lines = [["time", *(variable for variable, _ in integrated_states(declared))], *found.rows]
    result = "".join(",".join(line) + "\n" for line in lines)
    root = Element("fmiReferences", {"xmlns:fmi-ls": NAMESPACE})
    for key, text in STANDARD.items():
        root.set(f"fmi-ls:fmi-ls-{key}", text)
    related = {"source": f"{name}_out.csv", "role": "result", "type": "text/csv", "description": found.caption}
    SubElement(root, "Related", related)
    return {f"{RESULT_FOLDER}/{name}_out.csv": result.encode(), f"{RESULT_FOLDER}/fmi-ls-manifest.xml": xml_bytes(root)}
