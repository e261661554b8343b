"""A sweep's results: one labelled file that xarray opens, the same as a table for pandas, and the figure."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from ...errors import SceneError, unknown
from ...results.files import heading
from ...results.folder import replacing
from ...results.provenance import record
from ...running.values import unit
from ...scenes.assigned import assigned
from ...scenes.fmus import check_built, fmu_of
from .measures import columns
from .rerun import Runs, ready
from .space import Axis, axis, points
from .study import Sweep, forget, perform

FOLDER = "sweep"
FILES = ("sweep.nc", "sweep.csv", "figure.png")


@dataclass(frozen=True)
class Asked:
    """What the user asks for; `vary` and `values` as texts like m=1:2:11 and k=100."""

    model: str
    vary: tuple[str, ...]
    values: tuple[str, ...]
    random: int | None
    seed: int
    measures: tuple[str, ...]
    stop: float | None
    name: str | None


@dataclass(frozen=True)
class Swept:
    """The finished sweep: its `data`, where its files are, how many runs were done before, how many lines about them
    were damaged, how many of all failed, and the seconds that the new ones took without the start of the workers."""

    data: xarray.Dataset
    folder: Path
    before: int
    damaged: int
    failed: int
    seconds: float


def carry_out(asked: Asked, out: Path, scheduler: str | None, workers: int, report: Callable[[float], None]) -> Swept:
    """Run the sweep and write its files to out/sweep/<name>; HarnessError in one sentence."""
    file = fmu_file(asked.model)
    axes = tuple(axis(text, asked.random is not None) for text in asked.vary)
    names = tuple(each.name for each in axes)
    if len(set(names)) < len(names):
        raise SceneError("--vary names a parameter twice")
    runs = Runs(file.stem, names, dict(map(assigned, asked.values)), asked.stop, asked.measures)
    described = describe(runs, axes, file)
    places = points(axes, asked.random, asked.seed)
    sweep = Sweep(runs, axes, places, asked.random, asked.seed, file.read_bytes(), len(described["columns"]))
    folder = out / FOLDER / (asked.name or "-".join((runs.model, *names)))
    with replacing(folder, FILES) as fresh:  # from before the runs on: a place that cannot be written is told at once
        rows, before, damaged, seconds = perform(sweep, out / FOLDER, scheduler, workers, report)
        data = dataset(sweep, rows, described)
        save(data, fresh)
        record(fresh, [file], described["constants"], asked)
    forget(sweep, out / FOLDER)
    return Swept(data, folder, before, damaged, sum(1 for _, error in rows if error), seconds)


def fmu_file(model: str) -> Path:
    """The FMU of a model's name, or of a path."""
    file = Path(model) if model.endswith(".fmu") else fmu_of(model)
    check_built(file)
    return file


def describe(runs: Runs, axes: tuple[Axis, ...], file: Path) -> dict[str, Any]:
    """Units and sentences of what is varied and measured and the values of the rest, from the FMU itself.

    A first run from the FMU's own values shows what is wrong with the sweep before workers are started.
    """
    with ready(replace(runs, varied=(), measures=()), file) as rerun:
        variables = {variable.name: variable for variable in rerun.description.modelVariables}
        settable = [name for name, variable in variables.items() if variable.causality in ("parameter", "input")]
        for name in runs.varied:
            if name not in settable:
                raise SceneError(unknown("parameter to vary", name, settable))
            if name in runs.values:
                raise SceneError(f"{name} is both varied and set")
        for each in axes:
            if variables[each.name].type != "Real" and any(value % 1 for value in each.values):
                raise SceneError(f"{each.name} is a choice: vary it over whole numbers, as in {each.name}=1,2")
        measured = columns(runs.measures, variables)
        constants, names = rerun.constants(), runs.varied
        stop = rerun.plan.stop
    return {
        "varied": {name: (unit(variables[name]), variables[name].description) for name in runs.varied},
        "columns": measured,
        "constants": {name: (value, unit(variables[name])) for name, value in constants.items() if name not in names},
        "stop": stop,
    }


def dataset(sweep: Sweep, rows: list[Any], about: dict[str, Any]) -> xarray.Dataset:
    """The results with their labels: a dimension for each axis of a grid, or the dimension `run` of a sample."""
    names = sweep.runs.varied
    if sweep.random is None:
        dims, shape = names, tuple(len(each.values) for each in sweep.axes)
        coordinates = {each.name: ((each.name,), np.array(each.values)) for each in sweep.axes}
    else:
        dims, shape = ("run",), (len(rows),)
        coordinates = {name: (("run",), sweep.points[:, i]) for i, name in enumerate(names)}
    width = len(about["columns"])
    table = np.array([values or [np.nan] * width for values, _ in rows]).reshape(*shape, width)
    data = {column.name: (dims, table[..., i]) for i, column in enumerate(about["columns"])}
    data["error"] = (dims, np.array([error for _, error in rows], dtype=str).reshape(shape))
    found = xarray.Dataset(data, coordinates)
    for column in about["columns"]:
        found[column.name].attrs = {"units": column.unit or "1", "long_name": column.text}
    for name, (size, text) in about["varied"].items():
        spread = "log" if next(each for each in sweep.axes if each.name == name).log else "linear"
        found[name].attrs = {"units": size or "1", "long_name": text or name, "scale": spread}
    found["error"].attrs = {"long_name": "why a run failed; empty if it did not"}
    found.attrs = {
        "title": f"{sweep.runs.model} over {', '.join(names)}",
        "model": sweep.runs.model,
        "fmu_sha256": sweep.digest,
        "stop_time": about["stop"],
        "parameters": json.dumps({name: value for name, (value, _) in about["constants"].items()}, sort_keys=True),
        "sample": "grid" if sweep.random is None else f"Latin hypercube, seed {sweep.seed}",
    }
    return found


def save(data: xarray.Dataset, folder: Path) -> None:
    """Write the netCDF file, the table and the figure."""
    from .figure import draw

    data.to_netcdf(folder / "sweep.nc", engine="scipy")
    table = data.to_dataframe().reset_index()
    if "run" in table.columns:
        table = table[[*(name for name in data.coords if name != "run"), *data.data_vars]]
    units = {name: data[name].attrs.get("units", "1") for name in table.columns}
    table.columns = [heading(name, "" if units[name] == "1" else units[name]) for name in table.columns]
    table.to_csv(folder / "sweep.csv", index=False, lineterminator="\n")
    draw(data, folder / "figure.png")
