"""Reader of tables in text files of instruments, spreadsheets and phones.

Delimiter, headings and first row are detected. The numbers begin at two consecutive lines of the usual width that are
mostly numeric; the last lines of that width before them are names and units, also in comments. Python's csv module
splits the lines.
"""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from itertools import chain, pairwise
from typing import Any, NamedTuple

import numpy as np

from ..errors import SceneError
from . import size_limits
from .units import COUNT_NAMES, TIME_NAME, is_unit, order_from_name, split_heading, time_unit_size, unit_size

DELIMITERS = ("\t", ";", ",", "|", " ")
MISSING = {"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "---", "inf", "-inf", "+inf", "\u221e", "-\u221e"}
NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][-+]?\d+)?$")
GROUPED_NUMBER = re.compile(r"[-+]?\d{1,3}([,.'])\d{3}(\1\d{3})*((?!\1)[.,]\d+)?$")  # 1,234.5 or 1.234,5
DAY_PATTERN = r"(\d{4}-?\d\d-?\d\d[T ]?|\d{1,4}[./]\d{1,2}[./]\d{1,4}[T ]\s*)"
TIMESTAMP = re.compile(DAY_PATTERN + r"?(\d{1,2}:)?\d{1,2}:\d{1,2}([.,:]\d+)?\s*([AP]M|Z|[-+]\d\d:?\d\d)?$", re.I)
NUMBER_WITH_UNIT = re.compile(r"([-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\W\d_]\S{0,14}|°\S{0,4})$")
PREFIX = re.compile(r"\s*(\d{1,2}:\d\d:\d\d(?:[.,]\d+)?)\s*->\s*")  # of each line, as serial monitors print it
UNITS_LINE = re.compile(r"[\s#%/]*(?:units?|einheiten)\s*[:=]\s*(\S.*)$", re.I)
UNITS_ROW = "y_unit_label"  # LabVIEW: the row with the units of all columns but the first
END_OF_HEADER = "***End_of_Header***"
INTERVAL_ROW = "delta_x"  # LabVIEW: the row with the sampling interval, where the file has no times
SAMPLE_LINES = 200  # lines examined to detect the layout
BEFORE_UNIT = re.compile(r"(?<=[^\s\])])\s+(?=[\[(])")  # the space in `t [s]`
LONG_TABLE = 20_000  # lines above which numbers are read by numpy, if all cells are numbers
MAX_LINE_LENGTH = 10_000  # characters; longer lines are not a table


class TextTable(NamedTuple):
    """Table of a text file.

    Attributes
    ----------
    headings : list of str
        Headings; empty if the file has none.
    rows : list of list of str, or numpy.ndarray
        Cells of each row; numbers (n, columns) of a long table that has nothing else.
    line : int
        Number of the line before the first row.
    interval : float or None
        Sampling interval in s, if the file has one.
    delimiter : str
        Character between the cells.
    """

    headings: list[str]
    rows: list[list[str]] | np.ndarray
    line: int
    interval: float | None = None
    delimiter: str = ""


def decode_text(data: bytes, name: str) -> str:
    """Decode a file by its byte order mark, as UTF-8, or as cp1252 (Western European Windows)."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    elif data[1:2] == b"\0" or data[:1] == b"\0":
        encoding = "utf-16-le" if data[1:2] == b"\0" else "utf-16-be"
    else:
        encoding = "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    text = text.replace("\u2212", "-")  # typographic minus sign, as written by Nordic locales
    if "\0" in text:
        raise SceneError(f"{name} is neither text nor a supported table format (.xlsx, .ods, .mat, .npz)")
    return text


def parse_text_table(data: bytes, name: str) -> TextTable:
    """Parse a text file.

    Raises
    ------
    SceneError
        If there is no table.
    """
    lines = decode_text(data, name).splitlines()
    if len(lines) > size_limits.MAX_LINES:
        limit = f"a record at most {size_limits.MAX_LINES}: leave out every second one"
        raise SceneError(f"{name} has {len(lines)} lines, and {limit}")
    return parse_long_table(lines, name) or parse_lines(lines, name)


def parse_long_table(lines: list[str], name: str) -> TextTable | None:
    """Parse a long table that has only numbers below its headings; None if it has other cells, or is short.

    The layout follows from its first lines, those in the middle and the last ones. This takes a tenth of the time.
    """
    if len(lines) <= LONG_TABLE:
        return None
    middle = len(lines) // 2
    parts = lines[: 2 * SAMPLE_LINES], lines[middle : middle + 2 * SAMPLE_LINES], lines[-2 * SAMPLE_LINES :]
    try:
        sample = parse_lines([line for part in parts for line in part], name)
        if sample.line > SAMPLE_LINES:
            return None
        delimiter, rows = None if sample.delimiter == " " else sample.delimiter, lines[sample.line :]
        if delimiter != "," and all(map(has_decimal_comma, zip(*sample.rows, strict=False))):
            rows = [line.replace(",", ".") for line in rows]
        numbers = np.loadtxt(rows, delimiter=delimiter, comments=None, ndmin=2)
    except (SceneError, ValueError):
        return None
    if numbers.shape[1] != len(sample.rows[0]):
        return None
    return sample._replace(rows=numbers)


def has_decimal_comma(cells: Sequence[str]) -> bool:
    """Return whether a cell of a column has a comma that separates no thousands, so that none in the column does."""
    return any("," in cell and (not GROUPED_NUMBER.match(cell) or cell.lstrip("+-")[0] == "0") for cell in cells)


def parse_lines(lines: list[str], name: str) -> TextTable:
    """Parse the lines of a file; raise SceneError if they contain no table."""
    numbered_lines = [
        (number, line)
        for number, line in enumerate(lines, 1)
        if line.strip(" \t;,\r\n") and not is_comment(line) and not UNITS_LINE.match(line)
    ]
    texts = [line for _, line in numbered_lines]
    if any(len(line) > MAX_LINE_LENGTH for line in texts[:SAMPLE_LINES]):
        raise SceneError(f"{name} is not a table: its lines have more than {MAX_LINE_LENGTH} characters")
    delimiter, rows = split_lines(texts, name)
    start = find_end_of_header(rows)
    first_row = find_first_number_row(rows[start:])
    first_row = None if first_row is None else start + first_row
    if len(rows) == len(texts) and (first_row is None or is_decimal_comma(texts, delimiter, first_row)):
        rows = [[line.strip()] for line in texts]
        first_row = find_first_number_row(rows, min_width=1)
    if first_row is None:
        raise SceneError(f"{name} contains no table: a heading and rows of numbers are required")
    width, line = len(rows[first_row]), numbered_lines[first_row][0] - 1
    headings = find_headings(rows[:first_row], width)
    if not headings:
        headings = find_commented_headings(lines[:line], delimiter, width)
    headings = add_units(headings, find_units_line(lines[:line], delimiter, width))
    return TextTable(headings, rows[first_row:], line, find_interval(rows[:first_row]), delimiter)


def split_lines(texts: list[str], name: str) -> tuple[str, list[list[str]]]:
    """Return the delimiter and the cells of each line; a time before an arrow becomes the first cell."""
    middle = texts[len(texts) // 2 :][:SAMPLE_LINES]
    if not middle or 2 * sum(PREFIX.match(line) is not None for line in middle) < len(middle):
        delimiter = find_delimiter(texts)
        return delimiter, split_cells(texts, delimiter, name)
    prefixes = [PREFIX.match(line) for line in texts]
    others = [line[prefix.end() :] if prefix else line for line, prefix in zip(texts, prefixes, strict=True)]
    delimiter = find_delimiter(others)
    rows = [cells for line in others for cells in split_cells([line], delimiter, name) or [[""]]]
    return delimiter, [
        [prefix[1] if prefix and any(map(is_number, row)) else "time", *row]
        for prefix, row in zip(prefixes, rows, strict=True)
    ]


def find_end_of_header(rows: list[list[str]]) -> int:
    """Return the index of the row after the headers of LabVIEW, one of the file and one of its first segment."""
    ends = [i for i, row in enumerate(rows[:SAMPLE_LINES], 1) if row[:1] == [END_OF_HEADER]]
    return ends[:2][-1] if ends else 0


def is_decimal_comma(texts: list[str], delimiter: str, first_row: int) -> bool:
    """Return whether the commas that seem to separate two columns are those of the numbers in a single one."""
    if delimiter != "," or not all(NUMBER.match(line.strip()) for line in texts[first_row:][:SAMPLE_LINES]):
        return False
    return first_row > 0 and "," not in texts[first_row - 1]


def is_comment(line: str) -> bool:
    """Return whether a line is a comment."""
    return line.lstrip().startswith(("#", "%", "//"))


def split_cells(lines: list[str], separator: str, name: str) -> list[list[str]]:
    """Return the cells of each line."""
    if separator == " ":
        return [join_units(BEFORE_UNIT.sub("", line).split()) for line in lines]
    try:
        return [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator)]
    except csv.Error as error:
        raise SceneError(f"{name} is not a table: {error}") from None


def join_units(cells: list[str]) -> list[str]:
    """Return cells in which a number and the unit after it, as in 0.1 sec, are one cell."""
    if not any(cell[0].isalpha() for cell in cells) or not any(map(NUMBER.match, cells)):
        return cells
    joined_cells: list[str] = []
    for cell in cells:
        if joined_cells and cell[0].isalpha() and NUMBER.match(joined_cells[-1]) and is_unit(cell):
            joined_cells[-1] = f"{joined_cells[-1]} {cell}"
        else:
            joined_cells.append(cell)
    return joined_cells


def find_delimiter(lines: list[str]) -> str:
    """Return the delimiter that gives the most numbers in the middle of the file."""
    sample = lines[len(lines) // 2 :][:SAMPLE_LINES] or lines
    return max(DELIMITERS, key=lambda candidate: sum(map(count_numbers, split_cells(sample, candidate, "the file"))))


def count_numbers(row: list[str], min_width: int = 2) -> int:
    """Return the number of numeric cells, 0 for a row with fewer cells than `min_width` or mostly words."""
    nonempty = [cell for cell in row if cell]
    count = sum(map(is_number, nonempty))
    return count if len(row) >= min_width and 2 * count > len(nonempty) - 1 else 0


def is_number(cell: str) -> bool:
    """Return whether a cell contains a number or a time."""
    return bool(
        NUMBER.match(cell)
        or (":" in cell and TIMESTAMP.match(cell))
        or GROUPED_NUMBER.match(cell)
        or split_quantity(cell)
    )


def split_quantity(cell: str) -> tuple[str, str] | None:
    """Return number and unit of a cell with both, as in 0.1 sec, or None."""
    match = NUMBER_WITH_UNIT.match(cell)
    return (match[1], match[2]) if match and is_unit(match[2]) else None


def separate_units(heading: str, cells: Sequence[Any]) -> tuple[str, list[Any]]:
    """Return heading and cells of a column whose cells have a unit: the unit moves to the heading."""
    cells = list(cells)
    quantities = [split_quantity(cell) for cell in cells[len(cells) // 2 :][:1]]
    if not quantities or quantities[0] is None:
        return heading, cells
    unit = quantities[0][1]
    numbers = [cell if cell.lower() in MISSING else split_quantity(cell) for cell in cells]
    if any(pair is None or (isinstance(pair, tuple) and pair[1] != unit) for pair in numbers):
        return heading, cells  # the first cell in another form is reported when the numbers are read
    heading = heading if split_heading(heading)[1] else f"{heading} [{unit}]"
    return heading, [pair[0] if isinstance(pair, tuple) else pair for pair in numbers]


def find_first_number_row(rows: list[list[str]], min_width: int = 2) -> int | None:
    """Return the index of the first of two consecutive numeric rows of the usual layout; the last row may be alone."""
    for sample in (rows[len(rows) // 2 :][:SAMPLE_LINES], rows):
        layouts = Counter(
            (len(row), [*map(is_number, row)].index(True)) for row in sample if count_numbers(row, min_width)
        )
        if layouts:
            width, column = layouts.most_common(1)[0][0]
            is_numeric = (
                len(row) == width and count_numbers(row, min_width) > 0 and is_number(row[column])
                for row in chain(rows, rows[-1:])
            )
            return next((i for i, pair in enumerate(pairwise(is_numeric)) if all(pair)), None)
    return None


def find_headings(preceding_rows: list[list[str]], width: int) -> list[str]:
    """Return the headings above the numbers: the last row of that width, or two rows if the second has units.

    A row with fewer names, one of them that of a time, names the first columns.
    """
    while preceding_rows and all(cell.lower() in MISSING for cell in preceding_rows[-1]):
        preceding_rows = preceding_rows[:-1]  # empty rows belong to the numbers
    candidates = [
        row for row in preceding_rows[-3:] if abs(len(row) - width) <= (len(row) > 1) or names_a_part(row, width)
    ]
    candidates = [pad(row, width) for row in candidates if not all(is_number(cell) for cell in row if cell)]
    if not candidates or candidates[-1] != pad(preceding_rows[-1], width):
        return []
    last = candidates[-1]
    if len(candidates) > 1 and all(map(looks_like_unit, last)) and not all(map(looks_like_unit, candidates[-2])):
        last = add_units(candidates[-2], last)
    labels = next((row[1:] for row in preceding_rows if row and row[0].lower() == UNITS_ROW), [])
    return add_units(last, ["", *labels, *[""] * width][:width])


def names_a_part(row: list[str], width: int) -> bool:
    """Return whether a row names the first of the columns, among them a time."""
    return 1 < len(row) < width and all(row) and any(map(is_time_heading, row))


def pad(row: list[str], width: int) -> list[str]:
    """Return a row with empty cells up to a width, or cut to it."""
    return [*row, *[""] * width][:width]


def add_units(names: list[str], units: Sequence[str]) -> list[str]:
    """Return headings with the units of another row; a heading with a known unit in brackets keeps its unit."""
    if not names or not units:
        return names
    cells = [cell.strip("[]() ") for cell in units]
    return [
        f"{name} [{unit}]" if unit and not has_bracketed_unit(name) else name
        for name, unit in zip(names, cells, strict=True)
    ]


def has_bracketed_unit(heading: str) -> bool:
    """Return whether a heading ends with a known unit in brackets."""
    return heading.endswith(("]", ")")) and is_unit(split_heading(heading)[1] or "")


def looks_like_unit(cell: str) -> bool:
    """Return whether a cell below a heading is a unit: in brackets, known, or empty."""
    is_bracketed = cell.startswith(("[", "(")) and cell.endswith(("]", ")"))
    return is_bracketed or not cell or is_unit(cell) or cell in (*COUNT_NAMES, "1") or unit_size(cell) is not None


def find_commented_headings(preceding_lines: list[str], delimiter: str, width: int) -> list[str]:
    """Return the headings in the comments before the numbers.

    These are the cells of the comment with one cell for each column, among them a time, and the most known names and
    units; otherwise those of the last comment.
    """
    comments = [strip_comment(line) for line in preceding_lines if is_comment(line) and not UNITS_LINE.match(line)]
    comments = [comment for comment in comments[-SAMPLE_LINES:] if len(comment) <= MAX_LINE_LENGTH]
    best: tuple[int, list[str]] = (0, [])
    for mark in dict.fromkeys((delimiter, *DELIMITERS)):
        rows = [row for comment in comments for row in split_cells([comment], mark, "the file")]
        for last in range(len(rows), 0, -1):
            headings = find_headings(rows[:last], width)
            if any(map(is_time_heading, headings)):
                best = max(best, (sum(map(count_known_parts, headings)), headings), key=lambda candidate: candidate[0])
    if best[1]:
        return best[1]
    row = split_cells(comments[-1:], delimiter, "the file")
    return row[0] if row and len(row[0]) == width and not any(map(is_number, row[0])) else []


def is_time_heading(heading: str) -> bool:
    """Return whether a heading has the name or the unit of a time."""
    name, unit = split_heading(heading)
    return bool(TIME_NAME.search(name) or (unit and time_unit_size(unit)))


def count_known_parts(heading: str) -> int:
    """Return the number of known parts of a heading, 0 to 2: its name and its unit, of a time or a motion."""
    name, unit = split_heading(heading)
    return int(bool(TIME_NAME.search(name)) or order_from_name(name) is not None) + int(is_unit(unit or ""))


def strip_comment(line: str) -> str:
    """Return a comment without the marks before it."""
    return line.lstrip().lstrip("#%/ ").rstrip()


def find_units_line(preceding_lines: list[str], delimiter: str, width: int) -> list[str]:
    """Return the units in a line such as `% Units: s, mm`, one for each column; none if there is no such line."""
    texts = [match[1] for match in map(UNITS_LINE.match, preceding_lines) if match and len(match[1]) <= MAX_LINE_LENGTH]
    for mark in dict.fromkeys((delimiter, *DELIMITERS)):
        for row in (row for text in reversed(texts) for row in split_cells([text], mark, "the file")):
            if len(row) == width:
                return row
    return []


def find_interval(preceding_rows: list[list[str]]) -> float | None:
    """Return the sampling interval in s in the rows before the numbers, or None."""
    for row in preceding_rows:
        if len(row) > 1 and row[0].lower() == INTERVAL_ROW and NUMBER.match(row[1]):
            return float(row[1].replace(",", "."))
    return None
