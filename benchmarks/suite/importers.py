"""Runs of the suite in fmpy, in the importers of benchmarks.importers, and in importers that are wrong on purpose."""

import csv
from collections.abc import Callable
from ctypes import c_double
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Model

from harness.scenes.run_spec import RunSpec
from harness.simulation.fmu_archive import read_description, unpack_once

from ..importers.checks import IMPORTERS, Importer, run_request, unavailable_reason
from ..importers.request import ImporterRequest
from .check import check_case, read_columns

Columns = dict[str, np.ndarray]
Runner = Callable[["CaseFolder"], Columns]
JOINED_STEPS = 2  # communication steps that an importer joins, between which it interpolates
EULER_STEPS = 10  # in a communication step


class CannotRunError(Exception):
    """The importer has no way to run the case."""


class CaseFolder:
    """The files of a case that a tool reads."""

    def __init__(self, folder: Path) -> None:
        self.name = folder.name
        (self.fmu,) = (folder / "fmi2").glob("*.fmu")
        options = dict(csv.reader((folder / f"{self.name}_ref.opt").read_text(encoding="utf-8").splitlines()))
        self.start, self.stop, self.step, self.rtol = map(float, options.values())
        rows = csv.reader((folder / f"{self.name}_start.csv").read_text(encoding="utf-8").splitlines()[1:])
        self.values = {name: float(value) for name, value in rows}
        file = folder / f"{self.name}_in.csv"
        self.input = read_columns(file) if file.is_file() else {}
        reference = read_columns(folder / f"{self.name}_ref.csv")
        self.outputs = [name for name in reference if name != "time"]


def run_fmpy(case: CaseFolder, step: float | None = None, **options: object) -> Columns:
    """Run a case by fmpy.simulate_fmu, by default for co-simulation."""
    signals = None
    if case.input:
        signals = np.array([*zip(*case.input.values(), strict=True)], dtype=[(name, float) for name in case.input])
    arguments = {
        "start_time": case.start,
        "stop_time": case.stop,
        "output_interval": step or case.step,
        "relative_tolerance": case.rtol,
        "start_values": case.values,
        "input": signals,
        "output": case.outputs,
        "fmi_type": "CoSimulation",
    }
    rows = fmpy.simulate_fmu(case.fmu, **(arguments | options))
    return {name: np.asarray(rows[name], dtype=float) for name in ("time", *case.outputs)}


def run_model_exchange(case: CaseFolder) -> Columns:
    """Run a case by fmpy's model exchange with CVode."""
    if read_description(case.fmu).modelExchange is None:
        raise CannotRunError
    return run_fmpy(case, fmi_type="ModelExchange")


def run_adapter(importer: Importer, case: CaseFolder) -> Columns:
    """Run a case by the adapter of an importer, which has neither inputs nor a start time, and passes no tolerance."""
    if case.input or case.start:
        raise CannotRunError
    references = {v.name: v.valueReference for v in read_description(case.fmu).modelVariables}
    reals = [name for name in case.outputs if name != "mode"]
    values = case.values | {"solver.rtol": case.rtol}
    run = RunSpec(case.fmu, tuple(reals), values=values, stop=case.stop, grid=case.step)
    result = run_request(importer, ImporterRequest(run, references))
    rows = np.array(result.reply.rows[1:])  # libcosim records nothing before the first step
    return {"time": case.step * np.arange(1, len(rows) + 1), **dict(zip(reals, rows.T, strict=True))}


def interpolate_across_events(case: CaseFolder) -> Columns:
    """Wrong on purpose: longer communication steps, and linear interpolation between them."""
    coarse = run_fmpy(case, JOINED_STEPS * case.step)
    time = case.start + case.step * np.arange(round((case.stop - case.start) / case.step) + 1)
    columns = {name: np.interp(time, coarse["time"], coarse[name]) for name in case.outputs}
    return {"time": time, **{name: np.round(y) if name == "mode" else y for name, y in columns.items()}}


def ignore_event_mode(case: CaseFolder) -> Columns:
    """Wrong on purpose: model exchange by Euler's method that enters event mode only at the start."""
    description = read_description(case.fmu)
    if description.modelExchange is None:
        raise CannotRunError
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    model = FMU2Model(
        guid=description.guid,
        modelIdentifier=description.modelExchange.modelIdentifier,
        unzipDirectory=str(unpack_once(case.fmu)),
        instanceName="a",
    )
    model.instantiate()
    model.setReal([references[name] for name in case.values], [*case.values.values()])
    model.setupExperiment(startTime=case.start)
    model.enterInitializationMode()
    model.exitInitializationMode()
    model.newDiscreteStates()
    model.enterContinuousTimeMode()
    size = description.numberOfContinuousStates
    states, rates = (c_double * size)(), (c_double * size)()
    rows, steps = [], round((case.stop - case.start) / case.step)
    names = [name for name in case.outputs if name != "mode"]
    model.getContinuousStates(states, size)
    for i in range(steps + 1):
        rows.append([*model.getReal([references[name] for name in names])])
        for part in range(EULER_STEPS):
            model.getDerivatives(rates, size)
            for j in range(size):
                states[j] += rates[j] * case.step / EULER_STEPS
            model.setTime(case.start + case.step * (i + (part + 1) / EULER_STEPS))
            model.setContinuousStates(states, size)
    model.terminate()
    model.freeInstance()
    columns = dict(zip(names, np.array(rows).T, strict=True))
    return {"time": case.start + case.step * np.arange(steps + 1), **columns}


def ignore_start_time(case: CaseFolder) -> Columns:
    """Wrong on purpose: every run starts at 0 s, and its times are shifted afterwards."""
    columns = run_fmpy(case, start_time=0.0, stop_time=case.stop - case.start)
    return columns | {"time": columns["time"] + case.start}


RUNNERS: dict[str, Runner] = {"fmpy": run_fmpy, "fmpy, model exchange": run_model_exchange}
WRONG_RUNNERS: dict[str, Runner] = {
    "wrong: interpolates across events": interpolate_across_events,
    "wrong: ignores event mode": ignore_event_mode,
    "wrong: ignores the start time": ignore_start_time,
}


def available_runners() -> dict[str, Runner]:
    """Return the runner of each importer that is installed, by name, and of the wrong ones."""
    runners = dict(RUNNERS)
    for importer in IMPORTERS[1:]:
        if not unavailable_reason(importer):
            runners[importer.name] = lambda case, importer=importer: run_adapter(importer, case)  # type: ignore[misc]
    return runners | WRONG_RUNNERS


def run_case(run: Runner, folder: Path, results: Path, index: dict[str, Any]) -> str:
    """Run a case, write its results, and return its verdict: passed, failed with the reason, or not run.

    `index` is the entry of the case in cases.json.
    """
    case = CaseFolder(folder)
    try:
        columns = run(case)
    except CannotRunError:
        return "not run"
    except Exception as error:  # tools raise arbitrary exceptions
        return f"failed: {str(error).splitlines()[0] if str(error) else type(error).__name__}"
    results.mkdir(parents=True, exist_ok=True)
    with (results / f"{case.name}_out.csv").open("w", newline="", encoding="utf-8") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    verdicts = check_case(folder.parent, results, case.name, index)
    if "mode" not in columns:  # an adapter reads Reals only
        verdicts.pop("events", None)
    failures = [verdict.removeprefix("- ") for verdict in verdicts.values() if verdict.startswith("-")]
    return f"failed: {'; '.join(failures)}" if failures else "passed"
