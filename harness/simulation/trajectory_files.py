"""Reader of trajectories in result folders, in files of fmpy, OpenModelica and Dymola (.csv, .mat), and in any table
whose first column is time."""

import csv
import io
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HarnessError, SceneError, first_line, format_value
from ..records.child_reader import read_in_child
from ..records.columns import read_numeric
from ..records.table_files import read_content
from ..records.units import TIMES, split_heading
from ..results.loading import load_summary
from ..results.provenance import load_provenance
from ..scenes.run_spec import RunSpec
from .fmu_archive import read_description
from .model_data import read_model_data
from .recorder import element_names
from .signals import ModeChanges, Signals
from .trajectory import SolverSteps, Trajectory

MAX_TIME = 1e100  # s; largest absolute time
ELEMENT = re.compile(r".*\[\d+(,\d+)*\]")  # name of an array element; its brackets do not contain a unit
UNIT_IN_BRACKETS = re.compile(r" \[.+\]$")
BOOLEANS = {"True": 1.0, "False": 0.0, "true": 1.0, "false": 0.0}
INTEGER = re.compile(r"[-+]?\d{1,18}")  # fits into 64 bits
INTEGER_TYPE = re.compile(r"#\(type=(Boolean|Integer|Enumeration)\b", re.I)  # in the comment of a Modelica variable
FMPY_TIME = '"time"'  # how a file of fmpy begins

Columns = dict[str, np.ndarray]


def read_signals(path: Path) -> Signals:
    """Read the signals in a file or a result folder.

    Raises
    ------
    SceneError
        If it contains no valid signals.
    """
    file = path / "trajectory.csv" if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        raise SceneError(f"{path} is not a result folder: trajectory.csv is missing")
    modelica = read_modelica(file)
    # of this project, fmpy, OpenModelica or Dymola: headings are names of variables, as h_ft, and units are in brackets
    is_exact = bool(modelica) or path.is_dir() or read_content(file).startswith(FMPY_TIME.encode())
    (time_heading, time), *others = (modelica or read_csv(file, path.is_dir()) or read_table(file)).items()
    unit = parse_heading(time_heading)[1] or "s"
    if unit not in TIMES:
        raise SceneError(f"{file.name}: the first column must be time, but its unit is '{unit}'")
    if time.dtype.kind == "U":
        raise SceneError(f"{file.name}: the first column must be time, but it contains {format_value(str(time[0]))}")
    time = time * TIMES[unit]
    if not ((np.abs(time) < MAX_TIME).all() and (np.diff(time) >= 0).all()):
        raise SceneError(f"{file.name}: the time in the first column must increase and stay below {MAX_TIME:g} s")
    columns, units = Columns(), dict[str, str]()
    for heading, column in others:
        name, unit = parse_heading(heading, is_exact)
        if name in columns or name == parse_heading(time_heading)[0]:
            raise SceneError(f"{file.name}: two columns are named {format_value(name)}")
        columns[name], units[name] = column, unit
    return Signals(time, columns, units, events=read_events(path), label=path.stem, file=file)


def read_events(path: Path) -> ModeChanges | None:
    """Read the events in a result folder, or return None."""
    file = path / "events.csv"
    if not path.is_dir() or not file.is_file():
        return None
    (_, *contacts), rows = read_numeric(file)
    if not contacts or not np.isfinite(rows).all():
        raise SceneError(f"{file} does not contain times and modes")
    return ModeChanges(rows[:, 0], dict(zip(contacts, rows[:, 1:].T.astype(int), strict=True)))


def parse_heading(heading: str, is_exact: bool = False) -> tuple[str, str]:
    """Split a heading into name and unit. If `is_exact`, only brackets contain a unit."""
    if ELEMENT.fullmatch(heading) or (is_exact and not UNIT_IN_BRACKETS.search(heading)):
        return heading, ""
    name, unit = split_heading(heading)
    return name, unit or ""


def read_table(file: Path) -> Columns:
    """Read a table of an instrument, a spreadsheet or MATLAB; SceneError if there is none."""
    headings, values = read_numeric(file)
    duplicates = [heading for i, heading in enumerate(headings) if heading in headings[:i]]
    if duplicates:
        raise SceneError(f"{file.name}: two columns are named {format_value(duplicates[0])}")
    return dict(zip(headings, values.T, strict=True))


def read_csv(file: Path, is_result: bool) -> Columns | None:
    """Read a CSV file with commas and one heading row, or return None if the file has another form.

    Cells are numbers, Booleans, strings, or arrays separated by blanks, as fmpy writes them. Results of this project
    (`is_result`) and of fmpy have a decimal point or an exponent in every Real, so other numbers are integers there. In
    any other file, whole numbers may be rounded Reals.
    """
    try:
        text = read_content(file).decode("utf-8-sig")
        headings, *rows = csv.reader(io.StringIO(text, newline=""))
    except (UnicodeDecodeError, ValueError, csv.Error):
        return None
    names = [heading.strip() for heading in headings]
    if not rows or not all(names) or len(set(names)) < len(names) or {len(row) for row in rows} != {len(names)}:
        return None
    if len(names) < 2 or parse_numbers([row[0] for row in rows]) is None:
        return None
    columns = Columns()
    is_typed = (is_result or text.startswith(FMPY_TIME)) and not any(INTEGER.fullmatch(row[0].strip()) for row in rows)
    for name, cells in zip(names, zip(*rows, strict=True), strict=True):
        columns |= parse_column(name, [cell.strip() for cell in cells], is_typed)
    return columns


def parse_column(name: str, cells: list[str], is_typed: bool) -> Columns:
    """Parse one column; an array gives one column per element. If `is_typed`, only integers lack a decimal point."""
    values = parse_numbers(cells)
    widths = {len(cell.split()) for cell in cells}
    if values is None and len(widths) == 1:
        parts = [parse_numbers(part) for part in zip(*map(str.split, cells), strict=True)]
        elements = [part for part in parts if part is not None]
        if len(elements) == len(parts):
            return dict(zip(element_names(name, (len(parts),)), elements, strict=True))
    if values is None:
        return {name: np.array(cells)}
    is_integer = all(cell in BOOLEANS or (is_typed and INTEGER.fullmatch(cell)) for cell in cells)
    return {name: values.astype(np.int64) if is_integer else values}


def parse_numbers(cells: Sequence[str]) -> np.ndarray | None:
    """Parse cells as numbers; None if one is not a number."""
    try:
        return np.array([BOOLEANS[cell] if cell in BOOLEANS else float(cell or "nan") for cell in cells])
    except ValueError:
        return None


def read_modelica(file: Path) -> Columns | None:
    """Read a result file of OpenModelica or Dymola (MATLAB version 4 or 5); return None for other files."""
    data = read_content(file)
    is_modelica = b"Aclass" in data[:40]
    if not is_modelica and not data.startswith(b"MATLAB 5.0"):
        return None
    from scipy.io import loadmat

    if not is_modelica:
        read_in_child(data, file.name, "mat")  # loadmat ends this process for some damaged files
    try:
        contents: dict[str, Any] = loadmat(io.BytesIO(data), chars_as_strings=False)
        if "Aclass" not in contents:
            return None
        is_transposed = {"binTrans": True, "binNormal": False}[characters_to_text(contents["Aclass"][3])]
        name, description, info, values = (
            contents[key].T if is_transposed else contents[key] for key in ("name", "description", "dataInfo", "data_2")
        )
        columns = Columns()
        for text, comment, (matrix, signed_index, *_) in zip(
            map(characters_to_text, name), map(characters_to_text, description), info, strict=True
        ):
            if matrix in (0, 2):  # trajectories and time
                unit = re.search(r"\[([^][|:]+)[^][]*\]\s*$", comment)
                heading = f"{text} [{unit[1]}]" if unit else text
                column = np.sign(signed_index) * values[:, abs(int(signed_index)) - 1]
                is_integer = INTEGER_TYPE.search(comment) and (column == np.rint(column)).all()
                columns[heading] = column.astype(np.int64) if is_integer else column
        return columns
    except Exception as error:  # scipy raises various exceptions for a damaged file
        if not is_modelica:
            return None
        raise SceneError(
            f"{file.name} is not a complete result file of OpenModelica or Dymola: {first_line(error)}"
        ) from None


def characters_to_text(letters: np.ndarray) -> str:
    return "".join(letters).rstrip("\0 ")


def read_run(folder: Path) -> Trajectory:
    """Read the run in a result folder, with its steps, parameters and settings."""
    signals, origin = read_signals(folder), load_provenance(folder)
    parameters = {name: parameter["value"] for name, parameter in origin.get("parameters", {}).items()}
    units = signals.units | {name: parameter["unit"] for name, parameter in origin.get("parameters", {}).items()}
    try:
        spec = RunSpec.from_json(origin.get("run") or {})
    except SceneError:  # a folder of another tool
        fmus = (file for file in origin.get("files", {}) if file.endswith(".fmu"))
        spec = RunSpec(Path(next(fmus, f"{folder.name}.fmu")), outputs=tuple(signals.columns))
    steps = None
    if (folder / "steps.csv").is_file():
        ends, sizes, rejected_steps = read_numeric(folder / "steps.csv")[1].T
        steps = SolverSteps(np.append(signals.time[0], ends), sizes, rejected_steps.astype(int))
    names, events = {name: name for name in signals.columns}, signals.events
    if spec.fmu.is_file():  # it describes the variables, and names the contact of a column `mode`
        with suppress(HarnessError):
            variables = {item.name: item for item in read_description(spec.fmu, lenient=True).modelVariables}
            names |= {name: variables[name].description or name for name in names if name in variables}
            contacts = read_model_data(spec.fmu).contacts
            if events and len(events.modes) == len(contacts):
                modes = events.modes if len(contacts) > 1 else dict.fromkeys(contacts, events.mode)
                events = ModeChanges(events.t, modes, contacts)
    summary = load_summary(folder)
    note = " ".join(summary.sentences) if summary and origin.get("scene") is None else ""  # a scene has other sentences
    return Trajectory(
        signals.time, signals.columns, units, names, events, spec=spec, parameters=parameters, steps=steps, note=note
    )
