"""A table from a text file as instruments, spreadsheets and phones write it.

Python's own csv module splits the lines.  What stands between the cells, where the numbers begin and which line heads
them is found by looking at the lines: the numbers begin where two lines of one width are mostly numbers, and the last
lines of that width before them are names and units.
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
SAMPLE_LINES = 200  # lines that tell how the file is written
BEFORE_UNIT = re.compile(r"(?<=[^\s\])])\s+(?=[\[(])")  # the blank in `t [s]`
MAX_LINE_LENGTH = 10_000  # characters of a line: beyond, it is no table


def decode_text(data: bytes, name: str) -> str:
    """The text of a file: by its byte order mark, as UTF-8, or as Windows writes western Europe (cp1252)."""
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
    text = text.replace("\u2212", "-")  # the minus of typesetters, and of spreadsheets in the north
    if "\0" in text:
        raise SceneError(f"{name} is no text, and none of the tables known here (.xlsx, .ods, .mat, .npz)")
    return text


def parse_text_table(data: bytes, name: str) -> tuple[list[str], list[list[str]], int]:
    """Headings, rows of cells, and the number of the line before the first row; SceneError where there is no table.

    Headings are empty where the file has none.
    """
    lines = decode_text(data, name).splitlines()
    kept = [(number, line) for number, line in enumerate(lines, 1) if line.strip(" \t;,\r\n") and not is_comment(line)]
    texts = [line for _, line in kept]
    if any(len(line) > MAX_LINE_LENGTH for line in texts[:SAMPLE_LINES]):
        raise SceneError(f"{name} is no table: its lines have more than {MAX_LINE_LENGTH} characters")
    mark = find_delimiter(texts)
    rows = split_cells(texts, mark, name)
    first = find_first_number_row(rows)
    if first is None:
        raise SceneError(f"{name} has no table: a heading and rows of numbers are needed")
    heads = find_headings(rows[:first], len(rows[first]))
    if not heads:
        heads = find_commented_headings(lines[: kept[first][0] - 1], mark, len(rows[first]), name)
    return heads, rows[first:], kept[first][0] - 1


def is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "%", "//"))


def split_cells(lines: list[str], mark: str, name: str) -> list[list[str]]:
    """The cells of each line."""
    if mark == " ":
        return [BEFORE_UNIT.sub("", line).split() for line in lines]
    try:
        return [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=mark)]
    except csv.Error as error:
        raise SceneError(f"{name} is no table: {error}") from None


def find_delimiter(lines: list[str]) -> str:
    """What stands between the cells: what makes the most numbers of the lines in the middle of the file."""
    middle = lines[len(lines) // 2 :][:SAMPLE_LINES] or lines
    return max(DELIMITERS, key=lambda mark: sum(map(count_numbers, split_cells(middle, mark, "the file"))))


def count_numbers(row: list[str]) -> int:
    """How many cells are numbers, nothing for a row of one cell or of mostly words."""
    filled = [cell for cell in row if cell]
    count = sum(map(is_number, filled))
    return count if len(row) > 1 and 2 * count > len(filled) - 1 else 0


def is_number(cell: str) -> bool:
    """Whether a cell holds a number or a time."""
    return bool(NUMBER.match(cell) or (":" in cell and TIMESTAMP.match(cell)) or GROUPED_NUMBER.match(cell))


def find_first_number_row(rows: list[list[str]]) -> int | None:
    """The first of two rows of the file's usual width that are mostly numbers, from the first column on that usually
    is one; a last row may be alone."""
    for some in (rows[len(rows) // 2 :][:SAMPLE_LINES], rows):
        usual = Counter((len(row), [*map(is_number, row)].index(True)) for row in some if count_numbers(row))
        if usual:
            width, column = usual.most_common(1)[0][0]
            good = (
                len(row) == width and count_numbers(row) > 0 and is_number(row[column])
                for row in chain(rows, rows[-1:])
            )
            return next((i for i, both in enumerate(pairwise(good)) if all(both)), None)
    return None


def find_headings(above: list[list[str]], width: int) -> list[str]:
    """The headings from the rows above the numbers: the last of that width, or two of which the second has units."""
    while above and all(cell.lower() in MISSING for cell in above[-1]):
        above = above[:-1]  # rows of nothing begin the numbers
    wide = [row for row in above[-3:] if abs(len(row) - width) <= (len(row) > 1)]
    wide = [[*row, ""][:width] for row in wide if not all(is_number(cell) for cell in row if cell)]
    if not wide or wide[-1] != [*above[-1], ""][:width]:
        return []
    last = wide[-1]
    if len(wide) > 1 and all(map(looks_like_unit, last)) and not all(map(looks_like_unit, wide[-2])):
        names = zip(wide[-2], (cell.strip("[]() ") for cell in last), strict=True)
        return [f"{name} [{unit}]" if unit else name for name, unit in names]
    return last


def looks_like_unit(cell: str) -> bool:
    """Whether a cell under a heading is a unit: in brackets, known, short or empty."""
    bracketed = cell.strip("[]() ") != cell
    measures = find_unit(cell) is not None or time_unit_size(cell) is not None
    return bracketed or not cell or measures or cell in (*COUNT_NAMES, "V", "mV", "N", "A", "1")


def find_commented_headings(above: list[str], mark: str, width: int, name: str) -> list[str]:
    """Headings in the last comment before the numbers, where it has one for each column."""
    comments = [line.lstrip().lstrip("#%/ ").rstrip() for line in above if is_comment(line)]
    row = split_cells(comments[-1:], mark, name) if comments else []
    return row[0] if row and len(row[0]) == width and not any(map(is_number, row[0])) else []
