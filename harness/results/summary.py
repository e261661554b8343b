"""Summaries of results: every study writes summary.json in one schema, and the report reads nothing else."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import HarnessError, SceneError, by_interface
from ..scenes.schema import parse_table
from . import provenance
from .files import to_json

SUMMARY_FILE, PICTURE_FILE = "summary.json", "figure.svg"
VERSION = 1  # of the schema
STEPS_TABLE, METHODS_TABLE = "Internal steps of the solver", "Fastest methods"
MAX_DEVIATION = 5.0  # percent; a result agrees with its known values up to this difference
MAX_REMARKS = 5  # that are printed; the first ones have the largest effect on the answer


def limit_remarks(remarks: Sequence[str]) -> list[str]:
    """Return the remarks to print, and a sentence on where the others are."""
    others = by_interface("--json prints them", "`remarks` has them")
    count = len(remarks) - MAX_REMARKS
    return [*remarks[:MAX_REMARKS], *([f"{count} more remark{'s' * (count > 1)}: {others}."] if count > 0 else [])]


@dataclass(frozen=True)
class SummaryTable:
    """A table: headings with units, and rows of texts as they are shown. The main table of a result has no title."""

    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    title: str = ""

    def __post_init__(self) -> None:
        if any(len(row) != len(self.headings) for row in self.rows):
            raise ValueError("a row is not as long as the headings")
        if not all(self.headings):  # which a reader of the report could not interpret
            raise ValueError(f"a heading is empty in {self.headings}")


@dataclass(frozen=True)
class Outcome:
    """Conclusion of a study: a value, and a text.

    Attributes
    ----------
    value, text : str
        Number or word, and its meaning.
    is_good : bool
        Whether the result is as expected.
    deviation : float or None
        Largest deviation from known values in percent; None without known values.
    kind, source : str
        Kind of the known values, "published", "reference" or "parameter", and their source; empty without any.
    """

    value: str
    text: str
    is_good: bool
    deviation: float | None = None
    kind: str = ""
    source: str = ""


@dataclass(frozen=True)
class Summary:
    """Summary of a result.

    Attributes
    ----------
    study : str
        Name of the study, as in `SECTIONS` of the report.
    title : str
        Title of the result.
    sentences : tuple of str
        Findings and remarks.
    tables : tuple of SummaryTable
        Tables; the main table has no title.
    picture : str
        Text alternative of figure.svg in the folder; empty without one.
    outcome : Outcome or None
        Conclusion of the study; None if it judges nothing.
    origin : tuple of str
        Sentences on the origin: files, versions, date, command, parameters.
    files : tuple of str
        Names of the CSV files in the folder.
    version : int
        Version of the schema.
    """

    study: str
    title: str
    sentences: tuple[str, ...] = ()
    tables: tuple[SummaryTable, ...] = ()
    picture: str = ""
    outcome: Outcome | None = None
    origin: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    version: int = VERSION

    def __post_init__(self) -> None:
        outside = [name for name in self.files if Path(name).name != name]
        if outside:
            raise ValueError(f"{outside[0]} is not the name of a file in the folder")


def write_summary(folder: Path, summary: Summary) -> None:
    """Add origin and files to the summary of a result, and write it; the other files must be complete."""
    content = json.loads((folder / provenance.FILE).read_text(encoding="utf-8"))
    complete = replace(
        summary,
        picture=summary.picture if (folder / PICTURE_FILE).is_file() else "",
        origin=provenance.describe_origin(content),
        files=tuple(sorted(file.name for file in folder.glob("*.csv"))),
    )
    (folder / SUMMARY_FILE).write_text(to_json(complete) + "\n", encoding="utf-8")


def read_summary(folder: Path) -> Summary:
    """Read the summary of a result.

    Raises
    ------
    HarnessError
        If it is missing, damaged, or of another program or version.
    """
    try:
        content: Any = json.loads((folder / SUMMARY_FILE).read_text(encoding="utf-8"))
        if not isinstance(content, dict) or "version" not in content:
            reason = "is not the summary of a result"
        elif content["version"] != VERSION:
            reason = f"is of version {content['version']}, and this program reads version {VERSION}"
        else:
            return parse_table(content, Summary)
    except FileNotFoundError:
        reason = "is missing"
    except (OSError, ValueError, RecursionError):
        reason = "is not complete"
    except SceneError as error:
        reason = f"is not valid ({error})"
    command = provenance.load_provenance(folder).get("command", "the command that wrote it")
    raise HarnessError(f"{SUMMARY_FILE} {reason}: run `{command}` again")
