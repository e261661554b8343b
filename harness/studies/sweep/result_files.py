"""A sweep from what is asked to its files: one labelled file that xarray opens, the same as a table for pandas, and the
figure.  The files are written block by block; sweep.nc holds

    <parameter>     the values varied: a dimension of its own on a grid, over `run` in a sample; units, long_name, scale
    <measure>       one number of each run, NaN where it failed or has none; units, long_name
    error           why a run failed; empty if it did not
    title, model    what was swept, and the FMU, whose digest is fmu_sha256
    parameters      the values of all parameters that were not varied, as JSON, in the units of the FMU
    stop_time       at which every run ended, in s
    sample          the grid, or the kind of sample and its seed
"""

import csv
import json
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import HarnessError, SceneError, check_names
from ...results.files import column_heading
from ...results.folder import replace_folder
from ...results.netcdf import NetCDFVariable, NetCDFWriter
from ...results.provenance import describe_sources, write_provenance
from ...running.description import read_description
from ...running.variable_values import REAL_TYPES, variable_unit
from ...scenes.assignments import parse_assignment
from ...scenes.fmu_files import check_built, find_fmu
from .boundaries import Boundary, read_boundaries
from .journal import Block, Journal
from .measures import MeasureColumn
from .runner import SweepSpec, open_runner, run_spec_of
from .sampling import SweepPoints, parse_axis
from .study import Sweep, perform

FOLDER = "sweep"
FILES = ("sweep.nc", "sweep.csv", "figure.svg")
NOT_NUMBERS = ("String", "Binary", "Clock")
NUMBER = re.compile(r"-?\b\d+\.?\d*(e[-+]?\d+)?")


@dataclass(frozen=True)
class SweepRequest:
    """What the user asks for; `vary` and `values` as texts like m=1:2:11 and k=100, `options` of a Specification."""

    model: str
    vary: tuple[str, ...]
    values: tuple[str, ...]
    random: int | None
    seed: int
    measures: tuple[str, ...]
    name: str | None
    options: dict[str, Any]


@dataclass(frozen=True)
class FailureGroup:
    """Runs that failed alike, but for the numbers in the `sentence` of the first of them."""

    runs: int
    sentence: str
    where: dict[str, float]


@dataclass(frozen=True)
class SweepResult:
    """The finished sweep: its runs, where its files are, how many runs were done before, how many lines about them
    were damaged, how the others failed, the most frequent first, and the seconds that the new ones took."""

    runs: int
    folder: Path
    n_resumed: int
    damaged: int
    failures: tuple[FailureGroup, ...]
    seconds: float

    @property
    def failed(self) -> int:
        return sum(each.runs for each in self.failures)


@dataclass(frozen=True)
class SweepDescription:
    """What an FMU says of a sweep: unit and sentence of what is varied, the columns, value and unit of the parameters
    that are not, the stop time in s, and the known boundaries."""

    varied: dict[str, tuple[str, str]]
    columns: tuple[MeasureColumn, ...]
    constants: dict[str, tuple[object, str]]
    stop: float
    boundaries: tuple[Boundary, ...]


def run_sweep(
    asked: SweepRequest, out: Path, scheduler: str | None, workers: int | None, report: Callable[[float], None]
) -> SweepResult:
    """Run the sweep and write its files to out/sweep/<name>; HarnessError in one sentence."""
    check_built(file := find_fmu(asked.model))
    axes = tuple(parse_axis(text, asked.random is not None) for text in asked.vary)
    names = tuple(each.name for each in axes)
    if len(set(names)) < len(names):
        raise SceneError("--vary names a parameter twice")
    points = SweepPoints(axes, asked.random, asked.seed)
    values, options = map(parse_assignment, asked.values), sorted(asked.options.items())
    runs = SweepSpec(file.stem, names, tuple(values), asked.measures, tuple(options))
    about = describe(runs, points, file)
    sweep = Sweep(runs, points, file.read_bytes(), len(about.columns))
    kept = sweep.journal(out / FOLDER)
    before = kept.n_done
    folder = out / FOLDER / (asked.name or "-".join((runs.model, *names, sweep.key[:8])))
    source = describe_sources(str(file))
    with replace_folder(folder, FILES, source) as fresh:  # from before the runs on: what is in the way is told at once
        seconds = perform(sweep, kept, scheduler, workers, report)
        failures = save(sweep, kept, about, fresh)
        write_provenance(fresh, [file], about.constants, asked, source=source)
    kept.delete()
    return SweepResult(len(points), folder, before, kept.damaged, failures, seconds)


def describe(runs: SweepSpec, points: SweepPoints, file: Path) -> SweepDescription:
    """What the FMU says of the sweep; SceneError where it cannot be done.

    Some first runs show what is wrong with it before workers are started.
    """
    said = read_description(file, run_spec_of(runs, file).lenient)
    variables = {variable.name: variable for variable in said.modelVariables}
    settable = [name for name, variable in variables.items() if is_settable(variable)]
    check_names("parameter to vary", runs.varied, settable)
    for each in points.axes:
        if each.name in dict(runs.values):
            raise SceneError(f"{each.name} is both varied and set: leave one out")
        if variables[each.name].type not in REAL_TYPES and any(value % 1 for value in each.values):
            raise SceneError(f"{each.name} is a choice: vary it over whole numbers, as in {each.name}=1,2")
    with open_runner(runs, file) as runner:
        for number in (len(points) - 1, len(points) // 2, 0):
            (spot,) = points.coordinates(number, number + 1).tolist()
            measured = runner.run(spot)
            if not isinstance(measured, str):
                break
        else:
            raise HarnessError(f"none of three runs of the sweep comes to its end: {measured}")
        constants = {name: value for name, value in runner.constants().items() if name not in runs.varied}
        varied = {name: (variable_unit(variables[name]), variables[name].description or name) for name in runs.varied}
        numbers = {name: value for name, (value, _) in constants.items() if isinstance(value, float)}
        return SweepDescription(
            varied, runner.columns, constants, runner.stop, read_boundaries(file, runs.varied, numbers)
        )


def is_settable(variable: Any) -> bool:
    """Whether a variable takes a number before a run."""
    return variable.causality in ("parameter", "input") and variable.type not in NOT_NUMBERS and not variable.dimensions


def save(sweep: Sweep, kept: Journal, about: SweepDescription, folder: Path) -> tuple[FailureGroup, ...]:
    """Write the netCDF file, the table and the figure; returns how runs failed."""
    from .figure import draw

    failures, longest = counted(sweep, kept)
    grid, names, length = sweep.points.random is None, sweep.runs.varied, len(sweep.points)
    dimensions = names if grid else ("run",)
    sizes = {each.name: len(each.values) for each in sweep.points.axes} if grid else {"run": length}
    letters = f"string{longest}"
    variables = [
        NetCDFVariable(name, (name,) if grid else ("run",), said) for name, said in labels(sweep, about).items()
    ]
    where: dict[str, str] = {} if grid else {"coordinates": " ".join(names)}
    for column in about.columns:
        said = {"units": column.unit or "1", "long_name": column.text}
        variables.append(NetCDFVariable(column.name, dimensions, said | where))
    said = {"long_name": "why a run failed; empty if it did not", "_Encoding": "utf-8"}
    variables.append(NetCDFVariable("error", (*dimensions, letters), said | where, longest))
    attributes: dict[str, str | float] = {
        "title": f"{sweep.runs.model} over {', '.join(names)}",
        "model": sweep.runs.model,
        "fmu_sha256": sweep.digest,
        "stop_time": about.stop,
        "parameters": json.dumps({name: value for name, (value, _) in about.constants.items()}, sort_keys=True),
        "sample": "grid" if grid else f"Latin hypercube, seed {sweep.points.seed}",
    }
    with (
        (folder / "sweep.nc").open("wb") as file,
        (folder / "sweep.csv").open("w", encoding="utf-8", newline="") as text,
    ):
        data = NetCDFWriter(file, sizes | {letters: longest}, variables, attributes)
        table = csv.writer(text, lineterminator="\n")
        heads = [(each.name, str(each.attributes.get("units", "1"))) for each in variables]
        table.writerow([column_heading(name, "" if size == "1" else size) for name, size in heads])
        for each in sweep.points.axes if grid else ():
            data.write_values(each.name, 0, np.array(each.values))
        for block in kept.blocks():
            spots = sweep.points.coordinates(block.first, block.last)
            for name, column in zip(names, () if grid else spots.T, strict=not grid):
                data.write_values(name, block.first, column)
            for column, values in zip(about.columns, block.values.T, strict=True):
                data.write_values(column.name, block.first, values)
            data.write_values("error", block.first, np.array([sentence.encode() for sentence in messages(block)]))
            table.writerows(rows(spots, block))
    draw(folder / "sweep.nc", folder / "figure.svg", about.boundaries, sum(each.runs for each in failures))
    return failures


def labels(sweep: Sweep, about: SweepDescription) -> dict[str, dict[str, str]]:
    """The attributes of what is varied."""
    found = {}
    for each in sweep.points.axes:
        size, text = about.varied[each.name]
        found[each.name] = {"units": size or "1", "long_name": text, "scale": "log" if each.log else "linear"}
    return found


def messages(block: Block) -> list[str]:
    """Why each run of a block failed."""
    return [block.messages.get(i, "") for i in range(len(block.values))]


def rows(spots: np.ndarray, block: Block) -> Any:
    """The rows of a block in the table; what there is not is empty."""
    values = np.column_stack([spots, block.values]).astype(object)
    values[values != values] = None
    return ([*row, sentence] for row, sentence in zip(values, messages(block), strict=True))


def counted(sweep: Sweep, kept: Journal) -> tuple[tuple[FailureGroup, ...], int]:
    """How runs failed, the most frequent first, and the bytes of the longest sentence, one at least."""
    runs: Counter[str] = Counter()
    first: dict[str, FailureGroup] = {}
    longest = 1
    for block in kept.blocks():
        for place, sentence in block.messages.items():
            kind = NUMBER.sub("#", sentence)
            runs[kind] += 1
            longest = max(longest, len(sentence.encode()))
            if kind not in first:
                (spot,) = sweep.points.coordinates(block.first + place, block.first + place + 1)
                first[kind] = FailureGroup(0, sentence, dict(zip(sweep.runs.varied, spot.tolist(), strict=True)))
    return tuple(replace(first[kind], runs=count) for kind, count in runs.most_common()), longest
