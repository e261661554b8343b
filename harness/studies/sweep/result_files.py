"""Study that runs a sweep and writes its files: sweep.nc for xarray, sweep.csv with the same content, and the figure.

Values are read from the checkpoint and written block by block, so that memory does not grow with the number of runs.
Contents of sweep.nc:

    <parameter>     values of a varied parameter: a dimension on a grid, over `run` in a sample; units, long_name, scale
    <measure>       one number per run, NaN if the run failed or has no such value; units, long_name
    error           error message of a failed run, otherwise empty
    title, model    title and FMU; fmu_sha256 is its digest
    parameters      JSON with the values of all other parameters, in the units of the FMU
    stop_time       stop time of every run in s
    sample          grid, or kind of sample and seed
    tables          JSON of the lookup tables with varied values; only if there are some
"""

import csv
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import HarnessError, SceneError, check_names, import_optional
from ...results.files import column_heading
from ...results.folder import replace_folder
from ...results.provenance import describe_sources, write_provenance
from ...results.summary import write_summary
from ...running.fmu_archive import read_description
from ...running.fmu_tables import LookupTable, read_tables_with
from ...running.variable_values import REAL_TYPES, variable_unit
from ...scenes.fmu_files import check_built
from .boundaries import Boundary, read_boundaries
from .checkpoint import Checkpoint, RunBlock
from .labels import describe_labels
from .measures import MeasureColumn
from .result import DATASET_FILE, STUDY, TABLE_FILE, FailureGroup, SweepResult
from .runner import SweepSpec, open_runner
from .sampling import SweepPoints
from .study import Sweep, run_pending

NOT_NUMBERS = ("String", "Binary", "Clock")
NUMBER = re.compile(r"-?\b\d+\.?\d*(e[-+]?\d+)?")


@dataclass(frozen=True)
class SweepDescription:
    """Data of the FMU for a sweep.

    Attributes
    ----------
    varied : dict
        Unit and description of each varied parameter.
    columns : tuple of MeasureColumn
        Measured columns.
    constants : dict
        Value and unit of the other parameters.
    stop : float
        Stop time in s.
    boundaries : tuple of Boundary
        Known boundaries in the parameter space.
    tables : tuple of LookupTable
        Lookup tables with varied values; the others are those of the runs.
    """

    varied: dict[str, tuple[str, str]]
    columns: tuple[MeasureColumn, ...]
    constants: dict[str, tuple[object, str]]
    stop: float
    boundaries: tuple[Boundary, ...]
    tables: tuple[LookupTable, ...] = ()

    @property
    def headings(self) -> list[str]:
        """Return the headings of the varied parameters and of the columns, with units."""
        units = {name: unit for name, (unit, _) in self.varied.items()}
        units |= {column.name: column.unit for column in self.columns}
        return [column_heading(name, "" if unit == "1" else unit) for name, unit in units.items()]


def run_sweep(
    runs: SweepSpec,
    points: SweepPoints,
    name: str | None,
    out: Path,
    scheduler: str | None,
    workers: int | None,
    report: Callable[[float], None],
) -> SweepResult:
    """Run the sweep and write its files to out/sweep/<name>."""
    file = runs.run.fmu
    check_built(file)
    about = describe(runs, points)
    sweep = Sweep(runs, points, file.read_bytes(), len(about.columns))
    folder = out / STUDY.name / (name or "-".join((runs.run.model, *runs.varied, sweep.key[:8])))
    source = describe_sources(str(file))
    options = runs.run.options | {
        "vary": {axis.name: str(axis) for axis in points.axes},
        "random": points.random,
        "seed": points.seed,
        "measures": runs.measures,
    }
    checkpoint = sweep.checkpoint(out / STUDY.name)
    # opened before the runs, so that conflicts are reported at once
    with checkpoint.open(), replace_folder(folder, STUDY.files, source) as new_folder:
        n_resumed = checkpoint.n_done
        seconds = run_pending(sweep, checkpoint, scheduler, workers, report)
        failures = write_files(sweep, checkpoint, about, new_folder)
        result = SweepResult(
            folder.name,
            len(points),
            new_folder,
            n_resumed,
            checkpoint.damaged,
            failures,
            seconds,
            about.boundaries,
            ", ".join(about.headings),
        )
        result.write(new_folder)
        write_provenance(new_folder, [file], about.constants, options, source=source)
        write_summary(new_folder, result.summary())
    checkpoint.delete()
    result.folder = folder
    return result


def describe(runs: SweepSpec, points: SweepPoints) -> SweepDescription:
    """Return the data of the FMU for a sweep; SceneError if the sweep is invalid.

    Up to three test runs detect problems before workers are started.
    """
    fmu_description = read_description(runs.run.fmu, runs.run.lenient)
    variables = {variable.name: variable for variable in fmu_description.modelVariables}
    settable = [name for name, variable in variables.items() if is_settable(variable)]
    check_names("parameter to vary", runs.varied, settable)
    for axis in points.axes:
        if axis.name in runs.run.values:
            raise SceneError(f"{axis.name} is both varied and set; remove one of them")
        if variables[axis.name].type not in REAL_TYPES and any(value % 1 for value in axis.values):
            raise SceneError(f"{axis.name} is an enumeration; vary it over integers or labels, as in {axis.name}=1,2")
    with open_runner(runs) as runner:
        for number in (len(points) - 1, len(points) // 2, 0):
            (point,) = points.coordinates(number, number + 1).tolist()
            measures = runner.run(point)
            if not isinstance(measures, str):
                break
        else:
            raise HarnessError(f"three test runs of the sweep failed: {measures}")
        constants = {name: value for name, value in runner.constants().items() if name not in runs.varied}
        texts = {
            name: f"{variables[name].description or name}{describe_labels(variables[name])}" for name in runs.varied
        }
        varied = {name: (variable_unit(variables[name]), text) for name, text in texts.items()}
        numbers = {name: value for name, (value, _) in constants.items() if isinstance(value, float)}
        boundaries = read_boundaries(runs.run.fmu, runs.varied, numbers)
        tables = read_tables_with(runs.run.fmu, runs.varied, runs.run.values)
        return SweepDescription(varied, runner.columns, constants, runner.stop, boundaries, tables)


def is_settable(variable: Any) -> bool:
    """Return whether a numeric start value of the variable can be set."""
    return variable.causality in ("parameter", "input") and variable.type not in NOT_NUMBERS and not variable.dimensions


def write_files(
    sweep: Sweep, checkpoint: Checkpoint, about: SweepDescription, folder: Path
) -> tuple[FailureGroup, ...]:
    """Write the netCDF file and the table; return the failures."""
    failures, longest = group_failures(sweep, checkpoint)
    write_dataset(sweep, checkpoint, about, longest, folder / DATASET_FILE)
    with (folder / TABLE_FILE).open("w", encoding="utf-8", newline="") as text:
        table = csv.writer(text, lineterminator="\n")
        table.writerow([*about.headings, "error"])
        for block in checkpoint.blocks():
            table.writerows(csv_rows(sweep.points.coordinates(block.first, block.last), block))
    return failures


def write_dataset(sweep: Sweep, checkpoint: Checkpoint, about: SweepDescription, longest: int, path: Path) -> None:
    """Write the netCDF file, block by block.

    `longest` is the length in bytes of the longest error message.
    """
    netcdf = import_optional("netCDF4", "to write a sweep", "sweep")
    points = sweep.points
    shape = tuple(len(axis.values) for axis in points.axes) if points.random is None else (len(points),)
    with netcdf.Dataset(path, "w", format="NETCDF3_64BIT_OFFSET") as file:
        columns, errors = declare_variables(file, sweep, about, longest)
        for block in checkpoint.blocks():
            messages = np.zeros(len(block.values), f"S{longest}")
            for i, message in block.messages.items():
                messages[i] = message.encode()
            letters = messages.view("S1").reshape(-1, longest)
            for index, part in split_by_rows(shape, block.first, block.last):
                for variable, values in zip(columns, block.values.T, strict=True):
                    variable[index] = values[part]
                errors[index] = letters[part]


def declare_variables(file: Any, sweep: Sweep, about: SweepDescription, longest: int) -> tuple[list[Any], Any]:
    """Declare the content of the netCDF file and write the parameters; return the variables of values and errors."""
    points, names = sweep.points, sweep.runs.varied
    is_grid = points.random is None
    dimensions = {axis.name: len(axis.values) for axis in points.axes} if is_grid else {"run": len(points)}
    file.set_fill_off()  # every value is written
    file.setncatts(
        {
            "title": f"{sweep.runs.run.model} over {', '.join(names)}",
            "model": sweep.runs.run.model,
            "fmu_sha256": sweep.digest,
            "stop_time": about.stop,
            "parameters": json.dumps({name: value for name, (value, _) in about.constants.items()}, sort_keys=True),
            "sample": "grid" if is_grid else f"Latin hypercube, seed {points.seed}",
        }
    )
    if about.tables:
        file.tables = json.dumps([vars(table) for table in about.tables])
    text_dimension = f"string{longest}"
    for name, size in (dimensions | {text_dimension: longest}).items():
        file.createDimension(name, size)

    def declare(name: str, kind: str, shape: tuple[str, ...], attributes: dict[str, str]) -> Any:
        variable = file.createVariable(name, kind, shape)
        variable.set_auto_maskandscale(False)
        variable.set_auto_chartostring(False)
        variable.setncatts(attributes)
        return variable

    attributes_of = axis_attributes(sweep, about)
    for i, axis in enumerate(points.axes):
        variable = declare(axis.name, "f8", (axis.name if is_grid else "run",), attributes_of[axis.name])
        variable[:] = axis.values if is_grid else points.sample[:, i]
    shared = {} if is_grid else {"coordinates": " ".join(names)}
    columns = [
        declare(column.name, "f8", (*dimensions,), {"units": column.unit or "1", "long_name": column.text} | shared)
        for column in about.columns
    ]
    about_errors = {"long_name": "error message of a failed run, otherwise empty", "_Encoding": "utf-8"}
    return columns, declare("error", "S1", (*dimensions, text_dimension), about_errors | shared)


def split_by_rows(
    shape: tuple[int, ...], first: int, last: int
) -> Iterator[tuple[tuple[int | slice, ...], np.ndarray]]:
    """Split the elements from number `first` to before `last` of an array into parts that are of one row or whole rows.

    Yields the index of each part, and the numbers of its elements counted from `first`, in the shape of the part.
    """
    row, start = shape[-1], first
    while start < last:
        *outer, column = (int(i) for i in np.unravel_index(start, shape))
        n_rows = min((last - start) // row, shape[-2] - outer[-1]) if outer and column == 0 else 0
        end = start + (n_rows * row or min(row - column, last - start))
        numbers, columns = np.arange(start - first, end - first), slice(column, column + end - start)
        if n_rows:
            yield (*outer[:-1], slice(outer[-1], outer[-1] + n_rows), slice(row)), numbers.reshape(n_rows, row)
        else:
            yield (*outer, columns), numbers
        start = end


def axis_attributes(sweep: Sweep, about: SweepDescription) -> dict[str, dict[str, str]]:
    """Return the netCDF attributes of the varied parameters."""
    attributes = {}
    for axis in sweep.points.axes:
        size, text = about.varied[axis.name]
        attributes[axis.name] = {"units": size or "1", "long_name": text, "scale": "log" if axis.log else "linear"}
    return attributes


def csv_rows(points: np.ndarray, block: RunBlock) -> Any:
    """Return the CSV rows of a block; missing values are empty."""
    values = np.column_stack([points, block.values]).astype(object)
    values[values != values] = None
    return ([*row, block.messages.get(i, "")] for i, row in enumerate(values))


def group_failures(sweep: Sweep, checkpoint: Checkpoint) -> tuple[tuple[FailureGroup, ...], int]:
    """Return the failures, most frequent first, and the length in bytes of the longest message (at least 1)."""
    runs: Counter[str] = Counter()
    examples: dict[str, FailureGroup] = {}
    longest = 1
    for block in checkpoint.blocks():
        for offset, sentence in block.messages.items():
            pattern = NUMBER.sub("#", sentence)
            runs[pattern] += 1
            longest = max(longest, len(sentence.encode()))
            if pattern not in examples:
                (point,) = sweep.points.coordinates(block.first + offset, block.first + offset + 1)
                examples[pattern] = FailureGroup(0, sentence, dict(zip(sweep.runs.varied, point.tolist(), strict=True)))
    return tuple(replace(examples[pattern], runs=count) for pattern, count in runs.most_common()), longest
