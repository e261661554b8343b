"""A trajectory from a file: results of this harness, of fmpy, of OpenModelica and Dymola (.csv, .mat), and any table
whose first column is the time."""

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import SceneError, first_line, format_value
from ...records.columns import read_numeric, split_heading
from ...records.table_files import read_content
from ...records.units import TIMES
from ...running.external.sample_rows import element_names
from ...running.signals import Signals

LATEST = 1e100  # s, either way
ELEMENT = re.compile(r".*\[\d+(,\d+)*\]")  # of an array; its brackets hold no unit
BOOLEANS = {"True": 1.0, "False": 0.0, "true": 1.0, "false": 0.0}

Columns = dict[str, np.ndarray]


def read_trajectory(path: Path) -> Signals:
    """The trajectory in a file or a result folder; SceneError in one sentence if there is none."""
    file = path / "trajectory.csv" if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        raise SceneError(f"{path} is no result folder: it has no trajectory.csv")
    (clock, time), *others = (read_modelica(file) or read_csv(file) or table(file)).items()
    unit = parse_heading(clock)[1] or "s"
    if unit not in TIMES:
        raise SceneError(f"{file.name}: the first column must be the time, and its unit is '{unit}'")
    if time.dtype.kind == "U":
        raise SceneError(f"{file.name}: the first column must be the time, and it holds {format_value(str(time[0]))}")
    time = time * TIMES[unit]
    if not ((np.abs(time) < LATEST).all() and (np.diff(time) >= 0).all()):
        raise SceneError(f"{file.name}: the time in its first column must rise, within {LATEST:g} s")
    columns, units = Columns(), dict[str, str]()
    for head, column in others:
        name, unit = parse_heading(head)
        if name in columns or name == parse_heading(clock)[0]:
            raise SceneError(f"{file.name}: two columns are named {format_value(name)}")
        columns[name], units[name] = column, unit
    return Signals(path.stem, time, columns, units, events(path), file=file)


def events(path: Path) -> np.ndarray | None:
    """The events in a result folder, if they are known."""
    file = path / "events.csv"
    if not path.is_dir() or not file.is_file():
        return None
    known = read_numeric(file)[1]
    if known.shape[1] != 2 or not np.isfinite(known).all():
        raise SceneError(f"{file} holds no times and modes")
    return known


def parse_heading(head: str) -> tuple[str, str]:
    """Name and unit of a heading."""
    if ELEMENT.fullmatch(head):
        return head, ""
    name, unit = split_heading(head)
    return name, unit or ""


def table(file: Path) -> Columns:
    """What instruments, spreadsheets and MATLAB write; SceneError if it is no table."""
    heads, numbers = read_numeric(file)
    twice = [head for i, head in enumerate(heads) if head in heads[:i]]
    if twice:
        raise SceneError(f"{file.name}: two columns are named {format_value(twice[0])}")
    return dict(zip(heads, numbers.T, strict=True))


def read_csv(file: Path) -> Columns | None:
    """The columns by heading of a CSV file with commas, a heading and nothing but rows of its width; numbers, truths,
    texts, and, as fmpy writes them, arrays with blanks between; None if it is something else."""
    try:
        heads, *rows = csv.reader(io.StringIO(read_content(file).decode("utf-8-sig"), newline=""))
    except (UnicodeDecodeError, ValueError, csv.Error):
        return None
    names = [head.strip() for head in heads]
    if not rows or not all(names) or len(set(names)) < len(names) or {len(row) for row in rows} != {len(names)}:
        return None
    if len(names) < 2 or numbers([row[0] for row in rows]) is None:
        return None
    found = Columns()
    for head, cells in zip(names, zip(*rows, strict=True), strict=True):
        found |= column(head, [cell.strip() for cell in cells])
    return found


def column(head: str, cells: list[str]) -> Columns:
    """One column, or one for each element of an array."""
    whole = numbers(cells)
    widths = {len(cell.split()) for cell in cells}
    if whole is None and len(widths) == 1:
        parts = [numbers(part) for part in zip(*map(str.split, cells), strict=True)]
        known = [part for part in parts if part is not None]
        if len(known) == len(parts):
            return dict(zip(element_names(head, (len(parts),)), known, strict=True))
    return {head: np.array(cells) if whole is None else whole}


def numbers(cells: Sequence[str]) -> np.ndarray | None:
    """The numbers that the cells hold, None where one holds something else."""
    try:
        return np.array([BOOLEANS[cell] if cell in BOOLEANS else float(cell or "nan") for cell in cells])
    except ValueError:
        return None


def read_modelica(file: Path) -> Columns | None:
    """The columns of a result of OpenModelica or Dymola, which is a MATLAB file of version 4, also where it was saved
    anew as 5; None if it is none."""
    data = read_content(file)
    sure = b"Aclass" in data[:40]
    if not sure and not data.startswith(b"MATLAB 5.0"):
        return None
    from scipy.io import loadmat

    try:
        found: dict[str, Any] = loadmat(io.BytesIO(data), chars_as_strings=False)
        if "Aclass" not in found:
            return None
        turned = {"binTrans": True, "binNormal": False}[line(found["Aclass"][3])]
        name, description, info, values = (
            found[key].T if turned else found[key] for key in ("name", "description", "dataInfo", "data_2")
        )
        columns = Columns()
        for text, about, (place, signed, *_) in zip(map(line, name), map(line, description), info, strict=True):
            if place in (0, 2):  # what changes, and the time
                unit = re.search(r"\[([^][|:]+)[^][]*\]\s*$", about)
                head = f"{text} [{unit[1]}]" if unit else text
                columns[head] = np.sign(signed) * values[:, abs(int(signed)) - 1]
        return columns
    except Exception as error:  # scipy raises what it meets in a damaged file
        if not sure:
            return None
        raise SceneError(f"{file.name} is no whole result of OpenModelica or Dymola: {first_line(error)}") from None


def line(letters: np.ndarray) -> str:
    return "".join(letters).rstrip("\0 ")
