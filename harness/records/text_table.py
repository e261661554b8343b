"""Reads tables from text files of instruments, spreadsheets and phones.

Delimiter, headings and first row are detected. The numbers begin at two consecutive lines of the usual width that are
mostly numeric; the last lines of that width before them are names and units. Python's csv module splits the lines.
"""

import codecs
import csv
import re
from collections import Counter
from itertools import chain, pairwise

from ..errors import SceneError
from .units import COUNT_NAMES, find_unit, time_unit_size

DELIMITERS = ("\t", ";", ",", "|", " ")
MISSING = {"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "---", "inf", "-inf", "+inf", "\u221e", "-\u221e"}
NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][-+]?\d+)?$")
GROUPED_NUMBER = re.compile(r"[-+]?\d{1,3}([,.'])\d{3}(\1\d{3})*((?!\1)[.,]\d+)?$")  # 1,234.5 or 1.234,5
DAY_PATTERN = r"(\d{4}-?\d\d-?\d\d[T ]?|\d{1,4}[./]\d{1,2}[./]\d{1,4}[T ]\s*)"
TIMESTAMP = re.compile(DAY_PATTERN + r"?(\d{1,2}:)?\d{1,2}:\d{1,2}([.,:]\d+)?\s*([AP]M|Z|[-+]\d\d:?\d\d)?$", re.I)
SAMPLE_LINES = 200  # lines examined to detect the layout
BEFORE_UNIT = re.compile(r"(?<=[^\s\])])\s+(?=[\[(])")  # the space in `t [s]`
MAX_LINE_LENGTH = 10_000  # characters; longer lines are not a table


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


def parse_text_table(data: bytes, name: str) -> tuple[list[str], list[list[str]], int]:
    """Parse a text file.

    Returns
    -------
    headings : list of str
        Empty if the file has none.
    rows : list of list of str
        Cells of each row.
    line : int
        Number of the line before the first row.

    Raises
    ------
    SceneError
        If there is no table.
    """
    lines = decode_text(data, name).splitlines()
    numbered_lines = [
        (number, line) for number, line in enumerate(lines, 1) if line.strip(" \t;,\r\n") and not is_comment(line)
    ]
    texts = [line for _, line in numbered_lines]
    if any(len(line) > MAX_LINE_LENGTH for line in texts[:SAMPLE_LINES]):
        raise SceneError(f"{name} is not a table: its lines have more than {MAX_LINE_LENGTH} characters")
    delimiter = find_delimiter(texts)
    rows = split_cells(texts, delimiter, name)
    first_row = find_first_number_row(rows)
    if first_row is None:
        raise SceneError(f"{name} contains no table: a heading and rows of numbers are required")
    headings = find_headings(rows[:first_row], len(rows[first_row]))
    if not headings:
        headings = find_commented_headings(
            lines[: numbered_lines[first_row][0] - 1], delimiter, len(rows[first_row]), name
        )
    return headings, rows[first_row:], numbered_lines[first_row][0] - 1


def is_comment(line: str) -> bool:
    """Return whether a line is a comment."""
    return line.lstrip().startswith(("#", "%", "//"))


def split_cells(lines: list[str], separator: str, name: str) -> list[list[str]]:
    """Return the cells of each line."""
    if separator == " ":
        return [BEFORE_UNIT.sub("", line).split() for line in lines]
    try:
        return [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator)]
    except csv.Error as error:
        raise SceneError(f"{name} is not a table: {error}") from None


def find_delimiter(lines: list[str]) -> str:
    """Return the delimiter that gives the most numbers in the middle of the file."""
    sample = lines[len(lines) // 2 :][:SAMPLE_LINES] or lines
    return max(DELIMITERS, key=lambda candidate: sum(map(count_numbers, split_cells(sample, candidate, "the file"))))


def count_numbers(row: list[str]) -> int:
    """Return the number of numeric cells, 0 for a row with a single cell or mostly words."""
    nonempty = [cell for cell in row if cell]
    count = sum(map(is_number, nonempty))
    return count if len(row) > 1 and 2 * count > len(nonempty) - 1 else 0


def is_number(cell: str) -> bool:
    """Return whether a cell contains a number or a time."""
    return bool(NUMBER.match(cell) or (":" in cell and TIMESTAMP.match(cell)) or GROUPED_NUMBER.match(cell))


def find_first_number_row(rows: list[list[str]]) -> int | None:
    """Return the index of the first of two consecutive numeric rows of the usual layout; the last row may be alone."""
    for sample in (rows[len(rows) // 2 :][:SAMPLE_LINES], rows):
        layouts = Counter((len(row), [*map(is_number, row)].index(True)) for row in sample if count_numbers(row))
        if layouts:
            width, column = layouts.most_common(1)[0][0]
            is_numeric = (
                len(row) == width and count_numbers(row) > 0 and is_number(row[column])
                for row in chain(rows, rows[-1:])
            )
            return next((i for i, both in enumerate(pairwise(is_numeric)) if all(both)), None)
    return None


def find_headings(preceding: list[list[str]], width: int) -> list[str]:
    """Return the headings above the numbers: the last row of that width, or two rows if the second has units."""
    while preceding and all(cell.lower() in MISSING for cell in preceding[-1]):
        preceding = preceding[:-1]  # empty rows belong to the numbers
    candidates = [row for row in preceding[-3:] if abs(len(row) - width) <= (len(row) > 1)]
    candidates = [[*row, ""][:width] for row in candidates if not all(is_number(cell) for cell in row if cell)]
    if not candidates or candidates[-1] != [*preceding[-1], ""][:width]:
        return []
    last = candidates[-1]
    if len(candidates) > 1 and all(map(looks_like_unit, last)) and not all(map(looks_like_unit, candidates[-2])):
        names = zip(candidates[-2], (cell.strip("[]() ") for cell in last), strict=True)
        return [f"{name} [{unit}]" if unit else name for name, unit in names]
    return last


def looks_like_unit(cell: str) -> bool:
    """Return whether a cell below a heading is a unit: in brackets, known, or empty."""
    bracketed = cell.strip("[]() ") != cell
    is_known = find_unit(cell) is not None or time_unit_size(cell) is not None
    return bracketed or not cell or is_known or cell in (*COUNT_NAMES, "V", "mV", "N", "A", "1")


def find_commented_headings(preceding: list[str], delimiter: str, width: int, name: str) -> list[str]:
    """Return the headings in the last comment before the numbers, if it has one for each column."""
    comments = [line.lstrip().lstrip("#%/ ").rstrip() for line in preceding if is_comment(line)]
    row = split_cells(comments[-1:], delimiter, name) if comments else []
    return row[0] if row and len(row[0]) == width and not any(map(is_number, row[0])) else []
