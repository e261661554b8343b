"""Study that runs a sweep and writes its result folder.

The data are an xarray.Dataset, stored as sweep.nc and, with the same content, as sweep.csv:

    <parameter>     values of a varied parameter: a dimension on a grid, over `run` in a sample; units, long_name, scale
    <measure>       one number per run, NaN if the run failed or has no such value; units, long_name
    error           error message of a failed run, otherwise empty
    title, model    title and FMU; fmu_sha256 is its digest
    parameters      JSON with the values of all other parameters, in the units of the FMU
    stop_time       stop time of every run in s
    sample          grid, or kind of sample and seed
    tables          JSON of the lookup tables with varied values; only if there are some
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analyses.measured_runs import MeasureColumn, SweepSpec, open_runner
from ...errors import HarnessError, SceneError, check_varied, import_optional
from ...results.files import column_heading
from ...results.folder import replace_folder
from ...results.provenance import describe_sources, write_provenance
from ...results.summary import write_summary
from ...scenes.fmu_files import check_built
from ...scenes.run_spec import RunSpec
from ...simulation.fmu_archive import read_description
from ...simulation.model_data import LookupTable, read_tables_with
from ...simulation.variable_values import REAL_TYPES, variable_unit
from .dispatch import Checkpoint, Sweep, run_pending
from .result import STUDY, FailureGroup, SweepResult
from .sampling import SweepPoints, describe_labels, read_axis, read_labels

if TYPE_CHECKING:
    import xarray

NOT_NUMBERS = ("String", "Binary", "Clock")
ERROR_TEXT = "error message of a failed run, otherwise empty"
NUMBER = re.compile(r"-?\b\d+\.?\d*(e[-+]?\d+)?")


@dataclass(frozen=True)
class SweepDescription:
    """Data of the FMU for a sweep.

    Attributes
    ----------
    varied_parameters : dict
        Unit and description of each varied parameter.
    columns : tuple of MeasureColumn
        Measured columns.
    tables : tuple of LookupTable
        Lookup tables with varied values; the others are those of the runs.
    """

    varied_parameters: dict[str, tuple[str, str]]
    columns: tuple[MeasureColumn, ...]
    tables: tuple[LookupTable, ...] = ()

    @property
    def headings(self) -> list[str]:
        """Return the headings of the varied parameters and of the columns, with units."""
        units = {name: unit for name, (unit, _) in self.varied_parameters.items()}
        units |= {column.name: column.unit for column in self.columns}
        return [column_heading(name, "" if unit == "1" else unit) for name, unit in units.items()]


def run_sweep(
    run: RunSpec,
    grid: Mapping[str, Any],
    samples: int | None,
    seed: int,
    measures: Sequence[str],
    name: str | None,
    out: Path,
    workers: int | None,
    report: Callable[[float], None],
    resume: str,
) -> SweepResult:
    """Run the sweep and write its files to out/sweep/<name>; `resume` is as in `run_pending`."""
    file = run.fmu
    check_built(file)
    labels = read_labels(run)
    axes = tuple(read_axis(parameter, values, samples is not None, labels) for parameter, values in grid.items())
    points = SweepPoints(axes, samples, seed)
    runs = SweepSpec(run, points.names, tuple(measures))
    about = describe(runs, points)
    sweep = Sweep(runs, points, file.read_bytes(), len(about.columns))
    folder = out / STUDY.name / (name or "-".join((runs.run.model, *runs.varied_names, sweep.key[:8])))
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
        seconds = run_pending(sweep, checkpoint, workers, report, resume)
        failures = group_failures(sweep, checkpoint.messages)
        if len(checkpoint.messages) == len(points):
            checkpoint.clear()  # all runs are repeated
            raise HarnessError(f"all runs of the sweep failed: {failures[0]}")
        constants, stop = read_constants(sweep, checkpoint.messages)
        result = SweepResult(
            folder.name,
            len(points),
            new_folder,
            n_resumed,
            checkpoint.is_damaged,
            failures,
            seconds,
            ", ".join(about.headings),
        )
        result.dataset = build_dataset(sweep, checkpoint, about, constants, stop)
        result._write(new_folder)
        write_provenance(new_folder, [file], constants, options, source=source)
        write_summary(new_folder, result.summary())
    checkpoint.delete()
    result.folder = folder
    return result


def describe(runs: SweepSpec, points: SweepPoints) -> SweepDescription:
    """Return the data of the FMU for a sweep; SceneError if the sweep is invalid."""
    fmu_description = read_description(runs.run.fmu, runs.run.lenient)
    variables = {variable.name: variable for variable in fmu_description.modelVariables}
    settable = [name for name, variable in variables.items() if is_settable(variable)]
    check_varied("parameter to vary", runs.varied_names, settable, runs.run.values)
    for axis in points.axes:
        if variables[axis.name].type not in REAL_TYPES and any(value % 1 for value in axis.values):
            raise SceneError(f"{axis.name} is an enumeration; vary it over integers or labels, as in {axis.name}=1,2")
    with open_runner(runs) as runner:
        columns = runner.columns
    texts = {
        name: f"{variables[name].description or name}{describe_labels(variables[name])}" for name in runs.varied_names
    }
    varied_parameters = {name: (variable_unit(variables[name]), text) for name, text in texts.items()}
    return SweepDescription(
        varied_parameters, columns, read_tables_with(runs.run.fmu, runs.varied_names, runs.run.values)
    )


def read_constants(sweep: Sweep, messages: dict[int, str]) -> tuple[dict[str, tuple[object, str]], float]:
    """Return values and units of the parameters that are not varied, and the stop time in s, from a run without error.

    This run is repeated, because a worker returns measures only.
    """
    number = next(run for run in range(len(sweep.points)) if run not in messages)
    (point,) = sweep.points.coordinates(number, number + 1).tolist()
    with open_runner(sweep.runs) as runner:
        runner.run(point)
        constants = {name: value for name, value in runner.constants().items() if name not in sweep.runs.varied_names}
        return constants, runner.stop


def is_settable(variable: Any) -> bool:
    """Return whether a numeric start value of the variable can be set."""
    return variable.causality in ("parameter", "input") and variable.type not in NOT_NUMBERS and not variable.dimensions


def build_dataset(
    sweep: Sweep,
    checkpoint: Checkpoint,
    about: SweepDescription,
    constants: dict[str, tuple[object, str]],
    stop: float,
) -> "xarray.Dataset":
    """Return the values and error messages of all runs."""
    library = import_optional("xarray", "a sweep", "sweep")
    points, names = sweep.points, sweep.runs.varied_names
    is_grid = points.random is None
    dimensions = names if is_grid else ("run",)
    shape = tuple(len(axis.values) for axis in points.axes) if is_grid else (len(points),)
    coordinates = {}
    for i, axis in enumerate(points.axes):
        unit, text = about.varied_parameters[axis.name]
        attributes = {"units": unit or "1", "long_name": text, "scale": "log" if axis.log else "linear"}
        values = np.array(axis.values) if is_grid else points.sample[:, i]
        coordinates[axis.name] = (axis.name if is_grid else "run", values, attributes)
    errors = np.full(len(points), "", object)
    errors[[*checkpoint.messages]] = [*checkpoint.messages.values()]
    variables: dict[str, Any] = {
        column.name: (dimensions, values.reshape(shape), {"units": column.unit or "1", "long_name": column.text})
        for column, values in zip(about.columns, checkpoint.values.T, strict=True)
    }
    variables["error"] = (dimensions, errors.reshape(shape), {"long_name": ERROR_TEXT})
    about_sweep: dict[str, Any] = {
        "title": f"{sweep.runs.run.model} over {', '.join(names)}",
        "model": sweep.runs.run.model,
        "fmu_sha256": sweep.digest,
        "stop_time": stop,
        "parameters": json.dumps({name: value for name, (value, _) in constants.items()}, sort_keys=True),
        "sample": "grid" if is_grid else f"Latin hypercube, seed {points.seed}",
    }
    if about.tables:
        about_sweep["tables"] = json.dumps([vars(table) for table in about.tables])
    data: xarray.Dataset = library.Dataset(variables, coordinates, about_sweep)
    return data


def group_failures(sweep: Sweep, messages: dict[int, str]) -> tuple[FailureGroup, ...]:
    """Return the failures whose messages are equal except for numbers, most frequent first."""
    groups: dict[str, list[int]] = {}
    for run in sorted(messages):
        groups.setdefault(NUMBER.sub("#", messages[run]), []).append(run)
    failures = []
    for runs in sorted(groups.values(), key=len, reverse=True):
        (point,) = sweep.points.coordinates(runs[0], runs[0] + 1).tolist()
        failures.append(
            FailureGroup(len(runs), messages[runs[0]], dict(zip(sweep.runs.varied_names, point, strict=True)))
        )
    return tuple(failures)
