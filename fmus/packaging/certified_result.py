"""Embeds the certified result of the default experiment as in the layered standard FMI-LS-REF 1.0.0-alpha.1.

    extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml
    extra/org.fmi-standard.fmi-ls-ref/<name>_out.csv          columns: time and the states

The result stands next to the model file, for example `belt.csv`.  Its first line states after a # how the numbers were
computed and how well two methods agree, the second line names the columns.
"""

import csv
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from ..compiler import BuildError
from ..compiler.text_output import xml_bytes
from .fmi_variables import Variables, friction_laws, integrated_states

RESULT_FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
STANDARD = {
    "name": "org.fmi-standard.fmi-ls-ref",
    "version": "1.0.0-alpha.1",
    "description": "Layered Standard providing information on related files included in an FMU.",
}


@dataclass(frozen=True)
class CertifiedResult:
    """Rows of time in s and states, as text, and a sentence on how they were computed and how well methods agree."""

    rows: list[list[str]]
    provenance: str

    @property
    def caption(self) -> str:
        """Describe the origin of the numbers in one sentence."""
        return f"Certified result of the default experiment: {self.provenance}."


def find_certified_result(path: Path, model: Any, declarations: Variables) -> CertifiedResult | None:
    """Return the certified result of the model file, or None.

    The result is valid only for FMUs that include the hybrid law, where the model has friction laws.
    """
    laws = friction_laws(model)
    if laws and "hybrid" not in laws:
        return None
    file = path.with_suffix(".csv")
    return _read_table(file, len(integrated_states(declarations))) if file.is_file() else None


def _read_table(file: Path, states: int) -> CertifiedResult:
    """Read and check the file; raise BuildError if it is not a valid table."""
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
            f"{file} is not a certified result: line 1 must state after a # how the numbers were computed, line 2 must "
            f"name the columns, and each other line must hold the time in s and {states} states, all finite numbers."
        )
    return CertifiedResult(rows, provenance[1:].strip().rstrip("."))


def _is_row(row: list[str], states: int) -> bool:
    try:
        return len(row) == 1 + states and all(isfinite(float(word)) for word in row)
    except ValueError:
        return False


def result_files(name: str, certified_result: CertifiedResult, declarations: Variables) -> dict[str, bytes]:
    """Return the result and its manifest by path in the FMU."""
    lines = [["time", *(variable for variable, _ in integrated_states(declarations))], *certified_result.rows]
    result = "".join(",".join(line) + "\n" for line in lines)
    root = Element("fmiReferences", {"xmlns:fmi-ls": NAMESPACE})
    for key, text in STANDARD.items():
        root.set(f"fmi-ls:fmi-ls-{key}", text)
    attributes = {
        "source": f"{name}_out.csv",
        "role": "result",
        "type": "text/csv",
        "description": certified_result.caption,
    }
    SubElement(root, "Related", attributes)
    return {f"{RESULT_FOLDER}/{name}_out.csv": result.encode(), f"{RESULT_FOLDER}/fmi-ls-manifest.xml": xml_bytes(root)}
