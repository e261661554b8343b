"""Study that runs a sweep and writes its files: sweep.nc for xarray, sweep.csv with the same content, and the figure.

Values are read from the checkpoint and written in parts, so that memory does not grow with the number of runs.
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
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import HarnessError, SceneError, check_names
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

if TYPE_CHECKING:
    import dask.array
    import xarray

CHUNK_SIZE = "8 MiB"  # of the values read and written at a time
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
    checkpoint = sweep.checkpoint(out / STUDY.name)
    n_resumed = checkpoint.n_done
    folder = out / STUDY.name / (name or "-".join((runs.run.model, *runs.varied, sweep.key[:8])))
    source = describe_sources(str(file))
    options = runs.run.options | {
        "vary": {axis.name: str(axis) for axis in points.axes},
        "random": points.random,
        "seed": points.seed,
        "measures": runs.measures,
    }
    # opened before the runs, so that conflicts are reported at once
    with replace_folder(folder, STUDY.files, source) as new_folder:
        seconds = run_pending(sweep, checkpoint, scheduler, workers, report)
        failures = write_files(sweep, checkpoint, about, new_folder)
        units = {name: unit for name, (unit, _) in about.varied.items()}
        units |= {column.name: column.unit for column in about.columns}
        columns = ", ".join(column_heading(name, "" if unit == "1" else unit) for name, unit in units.items())
        result = SweepResult(
            folder.name,
            len(points),
            new_folder,
            n_resumed,
            checkpoint.damaged,
            failures,
            seconds,
            about.boundaries,
            columns,
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
    import dask

    failures, longest = group_failures(sweep, checkpoint)
    with dask.config.set({"scheduler": "synchronous", "array.chunk-size": CHUNK_SIZE}):
        dataset = build_dataset(sweep, checkpoint, about, longest)
        dataset.to_netcdf(folder / DATASET_FILE, engine="netcdf4", format="NETCDF3_64BIT")
    with (folder / TABLE_FILE).open("w", encoding="utf-8", newline="") as text:
        table = csv.writer(text, lineterminator="\n")
        units = {name: str(variable.attrs.get("units", "1")) for name, variable in dataset.variables.items()}
        names = [*sweep.runs.varied, *(column.name for column in about.columns), "error"]
        table.writerow([column_heading(name, "" if units[name] == "1" else units[name]) for name in names])
        for block in checkpoint.blocks():
            table.writerows(csv_rows(sweep.points.coordinates(block.first, block.last), block))
    return failures


class ArrayOnDisk:
    """A mapped array for Dask, which copies arrays that can be copied."""

    def __init__(self, values: np.ndarray) -> None:
        self.values, self.shape, self.dtype, self.ndim = values, values.shape, values.dtype, values.ndim

    def __getitem__(self, index: Any) -> np.ndarray:
        return np.array(self.values[index])


def build_dataset(sweep: Sweep, checkpoint: Checkpoint, about: SweepDescription, longest: int) -> "xarray.Dataset":
    """Return the results as an xarray.Dataset, whose values stay on the disk.

    `longest` is the length in bytes of the longest error message.
    """
    import dask.array
    import xarray

    points, names = sweep.points, sweep.runs.varied
    is_grid = points.random is None
    dimensions = names if is_grid else ("run",)
    shape = tuple(len(axis.values) for axis in points.axes) if is_grid else (len(points),)

    def lazy(values: np.ndarray) -> "dask.array.Array":
        on_disk = ArrayOnDisk(values.reshape(shape))
        return dask.array.from_array(on_disk, chunks="auto", name=False)  # type: ignore[no-untyped-call]

    def encode_messages(status: np.ndarray) -> np.ndarray:
        sentences = [sentence.encode() for sentence in checkpoint.messages(status.ravel())]
        return np.array(sentences, f"S{longest}").reshape(status.shape)

    values, status = checkpoint.array["values"], lazy(checkpoint.array["status"])
    attributes_of = axis_attributes(sweep, about)
    coordinates = {}
    for i, axis in enumerate(points.axes):
        dimension, coordinate = (axis.name, np.array(axis.values)) if is_grid else ("run", points.sample[:, i])
        coordinates[axis.name] = dimension, coordinate, attributes_of[axis.name]
    variables = {
        column.name: (dimensions, lazy(values[:, i]), {"units": column.unit or "1", "long_name": column.text})
        for i, column in enumerate(about.columns)
    }
    variables["error"] = (
        dimensions,
        dask.array.map_blocks(  # type: ignore[no-untyped-call]
            encode_messages, status, dtype=f"S{longest}"
        ),
        {"long_name": "error message of a failed run, otherwise empty", "_Encoding": "utf-8"},
    )
    attributes = {
        "title": f"{sweep.runs.run.model} over {', '.join(names)}",
        "model": sweep.runs.run.model,
        "fmu_sha256": sweep.digest,
        "stop_time": about.stop,
        "parameters": json.dumps({name: value for name, (value, _) in about.constants.items()}, sort_keys=True),
        "sample": "grid" if is_grid else f"Latin hypercube, seed {points.seed}",
    }
    if about.tables:
        attributes["tables"] = json.dumps([vars(table) for table in about.tables])
    dataset = xarray.Dataset(variables, coordinates, attributes)
    for name in (*names, *(column.name for column in about.columns)):
        dataset[name].encoding["_FillValue"] = None  # a failed run has NaN, which needs no declaration
    return dataset


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
