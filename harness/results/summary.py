"""Tables and summaries of results: terminal, notebooks, report, JSON, CSV and pandas follow from one table.

Every study writes summary.json in one schema, and the report reads nothing else.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass, replace
from html import escape
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import HarnessError, SceneError, by_interface
from ..scenes.schema import parse_table
from . import provenance
from .files import column_heading, to_json, write_csv_rows

if TYPE_CHECKING:
    import rich.console
    import rich.table


SUMMARY_FILE, PICTURE_FILE = "summary.json", "figure.svg"
VERSION = 1  # of the schema
STEPS_TABLE, METHODS_TABLE = "Internal steps of the solver", "Fastest methods"
MAX_DEVIATION = 5.0  # percent; a result agrees with its known values up to this difference
MAX_REMARKS = 5  # that are printed; the first ones have the largest effect on the answer


def limit_remarks(remarks: Sequence[str]) -> list[str]:
    """Return the remarks to print, and a sentence on where the others are."""
    hint = by_interface("--json prints them", "`remarks` has them")
    count = len(remarks) - MAX_REMARKS
    return [*remarks[:MAX_REMARKS], *([f"{count} more remark{'s' * (count > 1)}: {hint}."] if count > 0 else [])]


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


@dataclass(frozen=True)
class ResultColumn:
    """Column of a table.

    Attributes
    ----------
    heading : str
        Heading.
    text : str or callable
        Text of an item: a format such as "{0.rms:.3e}", or a function.
    is_text : bool
        Whether the cells are words, which are flush left, and not numbers.
    """

    heading: str
    text: str | Callable[[Any], str]
    is_text: bool = False

    def cell(self, item: Any) -> str:
        """Return the text of an item; nothing for a NaN."""
        text = self.text.format(item) if isinstance(self.text, str) else self.text(item)
        return "" if text == "nan" else text


@dataclass(frozen=True)
class ResultTable:
    """Items of a result, a row for each.

    Attributes
    ----------
    items : sequence
        Dataclasses or mappings; their fields are the columns of JSON, CSV and pandas.
    columns : sequence of ResultColumn
        Columns of the terminal, of notebooks and of the report.
    title : str
        Title; empty for none.
    units : mapping
        Units of fields by name, for CSV.
    group : callable, optional
        Returns the first cells of the line above the items that have them in common.
    note : str
        Note below the table in the terminal.
    padding : int
        Blanks between columns in the terminal.
    """

    items: Sequence[Any]
    columns: Sequence[ResultColumn]
    title: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    group: Callable[[Any], tuple[str, ...]] | None = None
    note: str = ""
    padding: int = 1

    @property
    def headings(self) -> tuple[str, ...]:
        return tuple(column.heading for column in self.columns)

    def rows(self) -> list[tuple[str, ...]]:
        """Return the texts of each item."""
        return [tuple(column.cell(item) for column in self.columns) for item in self.items]

    def groups(self) -> list[tuple[tuple[str, ...], list[tuple[str, ...]]]]:
        """Return the line above each group of items, which is empty without groups, and the texts of these items."""
        rows = iter(self.rows())
        keys = groupby(self.items, self.group or (lambda item: ()))
        blanks = ("",) * len(self.columns)
        return [((*key, *blanks[len(key) :]) if key else (), [next(rows) for _ in items]) for key, items in keys]

    def records(self) -> list[dict[str, Any]]:
        """Return the fields of each item by name, for JSON and pandas."""
        return [asdict(item) if is_dataclass(item) and not isinstance(item, type) else {**item} for item in self.items]

    def summarize(self) -> tuple[SummaryTable, ...]:
        """Return the table as the summary of a result stores it, as the only item; nothing if it has no rows."""
        rows = tuple(row for line, texts in self.groups() for row in (*[line] * bool(line), *texts))
        return (SummaryTable(self.headings, rows, self.title),) if rows else ()

    def for_terminal(self, width: int) -> "rich.console.Group":
        """Return the table for lines of a number of characters, in the style of all results.

        If its columns do not fit, even with each unit below its heading, they are in several tables, one below the
        other, which all begin with the first column.
        """
        from rich.console import Group

        gap, headings = self.padding + 1, list(self.headings)
        widths = self._column_widths(headings)
        if sum(widths) + gap * (len(widths) - 1) > width:
            headings = [
                name if column.is_text else name.replace(" [", "\n[")
                for name, column in zip(headings, self.columns, strict=True)
            ]
            widths = self._column_widths(headings)
        parts = [[0]]
        for i in range(1, len(widths)):
            if parts[-1] != [0] and sum(widths[j] + gap for j in parts[-1]) + widths[i] > width:
                parts.append([0])
            parts[-1].append(i)
        tables = [self._terminal_table(headings, part) for part in parts]
        tables[0].title, tables[0].min_width = self.title or None, len(self.title)
        tables[-1].caption = self.note or None
        return Group(*tables)

    def _column_widths(self, headings: Sequence[str]) -> list[int]:
        """Return the least width of each column; each word of a column of words may be in a line of its own."""
        cells = zip(headings, *self.rows(), strict=True)
        return [
            max(len(line) for cell in column for line in (cell.split() or [""] if is_text else cell.split("\n")))
            for column, is_text in zip(cells, (column.is_text for column in self.columns), strict=True)
        ]

    def _terminal_table(self, headings: Sequence[str], part: Sequence[int]) -> "rich.table.Table":
        """Return the table for the terminal with some of the columns."""
        from rich.box import SIMPLE_HEAD
        from rich.table import Table as RichTable
        from rich.text import Text

        table = RichTable(title_justify="left", caption_justify="left", box=SIMPLE_HEAD, show_edge=False)
        table.padding = (0, self.padding, 0, 0)
        for i in part:
            is_text = self.columns[i].is_text
            justify = {"no_wrap": headings[i] == "unit"} if is_text else {"justify": "right", "no_wrap": True}
            table.add_column(headings[i], overflow="fold", **justify)
        for line, rows in self.groups():
            if line:
                table.add_section()
                table.add_row(Text(line[0], style="bold"), *(line[i] for i in part[1:]))
            for row in rows:
                table.add_row(f"  {row[0]}" if line else row[0], *(row[i] for i in part[1:]))
        return table

    def as_html(self) -> str:
        """Return the table as HTML for notebooks; empty if it has no rows."""
        lines = []
        for table in self.summarize():
            caption = f"<caption>{escape(table.title)}</caption>" if table.title else ""
            cells = [("th", table.headings), *(("td", row) for row in table.rows)]
            rows = (f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in row)}</tr>" for tag, row in cells)
            lines.append(f"<table>{caption}{''.join(rows)}</table>")
        return "".join(lines)

    def write_csv(self, path: Path) -> None:
        """Write the fields of all items, with their units in the headings; None and NaN are empty cells."""
        records = self.records()
        headings = [column_heading(name, self.units.get(name, "")) for name in records[0]]
        rows = ([None if value != value else value for value in record.values()] for record in records)
        write_csv_rows(path, headings, rows)


def format_blocks(blocks: Iterable[ResultTable | str], width: int) -> str:
    """Return tables and sentences as text."""
    from rich.console import Console

    console = Console(width=width, markup=False, highlight=False)
    with console.capture() as text:
        for block in blocks:
            console.print(block.for_terminal(width) if isinstance(block, ResultTable) else block)
    return text.get().rstrip("\n")


def format_html(blocks: Iterable[ResultTable | str]) -> str:
    """Return tables and sentences as HTML."""
    nonempty_blocks = (block for block in blocks if block != "")
    return "".join(
        block.as_html() if isinstance(block, ResultTable) else f"<p>{escape(block)}</p>" for block in nonempty_blocks
    )
