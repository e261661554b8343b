"""One run of somebody's FMU, from this side: what is asked of the process that holds it, and what comes of it."""

import json
import signal
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from math import inf
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from ...errors import MAX_VALUE_LENGTH, HarnessError, SceneError, check_names
from ...process.interrupt import check_interrupt
from ...process.subprocess_runner import run_module
from ...process.temporary_directory import temporary_directory
from ..description import resolve_time_span
from ..inputs import check_inputs
from ..run_spec import RunSpec
from ..trajectory import Trajectory
from ..unpacking import unpack
from ..variable_values import convert_value, effective_value, variable_unit
from .request import (
    COARSEST_STEPS,
    OUTPUT_FILE,
    PROGRESS_FILE,
    RESULT_FILE,
    ROWS_PREFIX,
    STRINGS_FILE,
    TIMEOUT_FILE,
    ExternalRunRequest,
    RefinementResult,
)
from .sample_rows import ROW_FORMATS, SampleRows, ShapedVariable, element_names, read_rows
from .step_refinement import MAX_STEPS

Values = dict[str, Any]  # by the name of the variable

SETTABLE = ("parameter", "structuralParameter", "input")


def simulate(spec: RunSpec, found: Any, report: Callable[[float], None]) -> Trajectory:
    """The run that is wanted of the FMU so described; what it lacks, and why, is in `failed`.

    HarnessError in one sentence if there is none at all, SceneError if the FMU has not got what is wanted.
    """
    variables = {variable.name: variable for variable in found.modelVariables}
    exchange = spec.exchange or found.coSimulation is None
    if exchange and found.modelExchange is None:
        offered = " and ".join(offered_interfaces(found)) or "no interface"
        lacks = "model exchange is not among them" if spec.exchange else "neither co-simulation nor model exchange"
        raise HarnessError(f"{spec.fmu.name} offers {offered}; {lacks}")
    values = convert_values(spec, variables)
    check_inputs(spec.inputs, variables)
    chosen = select_variables(spec, variables, values)
    start, stop = check_time_span(spec, found)
    with unpack(spec.fmu) as folder, temporary_directory("rows-") as place:
        check_library(spec.fmu, found, exchange, folder)
        request = ExternalRunRequest(
            folder=str(folder),
            directory=str(place),
            exchange=exchange,
            start=start,
            stop=stop,
            tolerance=spec.tolerance,
            timeout=spec.timeout,
            grid=None if spec.follow else spec.grid,
            coarsest=round((stop - start) / spec.grid) if spec.grid else COARSEST_STEPS,
            values=values,
            outputs={variable.name: list(shape) for variable, shape in chosen},
            inputs={name: np.asarray(column, dtype=float).tolist() for name, column in spec.inputs.items()},
        )
        answer = run_fmu_process(request, place, report)
        rows = read_longest_rows(place, answer.run_number, chosen)
        texts = [json.loads(line) for line in read_lines(place / STRINGS_FILE)]
        said = read_lines(place / OUTPUT_FILE)
    failed = f"{spec.fmu.name}: {answer.failure}" if answer.failure else ""
    if failed and len(rows.time) and " at t = " not in failed:
        failed += f", after t = {rows.time[-1]:.9g} s"
    if len(rows.time) < 2:
        raise HarnessError(failed or f"{spec.fmu.name} gives nothing to record")
    prints = f"it prints: {said[-1][:MAX_VALUE_LENGTH]}" if said else ""
    note = "; ".join(filter(None, (answer.note, prints)))
    return replace(build_trajectory(spec, variables, values, chosen, rows, texts), note=note, failure=failed)


def offered_interfaces(found: Any) -> list[str]:
    """The interfaces that an FMU without model exchange offers."""
    offered = {"co-simulation": found.coSimulation, "scheduled execution": found.scheduledExecution}
    return [way for way, interface in offered.items() if interface]


def check_time_span(spec: RunSpec, found: Any) -> tuple[float, float]:
    """Start and stop in s, between which a clock can be counted on."""
    start, stop = resolve_time_span(spec, found)
    if not np.spacing(max(abs(start), abs(stop))) * MAX_STEPS <= stop - start < inf:
        between = f"between start = {start!r} s and stop = {stop!r} s"
        raise SceneError(f"{spec.fmu.name}: {between} are no times to step to; name another --stop")
    return start, stop


def convert_values(spec: RunSpec, variables: Values) -> Values:
    """What is set, as it is set; lists for arrays."""
    settable = [
        name
        for name, one in variables.items()
        if one.causality in SETTABLE or (one.initial in ("exact", "approx") and one.variability != "constant")
    ]
    check_names("variable to set", spec.values, settable)
    values: Values = {}
    for name in sorted(spec.values, key=lambda name: bool(variables[name].dimensions)):
        values[name] = convert_value(variables[name], spec.values[name], array_shape(variables[name], values))
    return values


def array_shape(variable: Any, values: Mapping[str, Any]) -> tuple[int, ...]:
    """The shape of an array, () of a scalar; a dimension may be a structural parameter, and that is set."""
    sizes = []
    for dimension in variable.dimensions:
        named = dimension.variable
        sizes.append(
            convert_value(named, values.get(named.name, float(named.start))) if named else int(dimension.start)
        )
    return tuple(sizes)


def select_variables(spec: RunSpec, variables: Values, values: Values) -> list[ShapedVariable]:
    """The variables to record, whole, whether one names them or some of their elements."""
    shapes = {name: array_shape(one, values) for name, one in variables.items() if one.type in ROW_FORMATS}
    owner = {element: name for name, each in shapes.items() for element in (name, *element_names(name, each))}
    check_names("output", spec.outputs, owner)
    chosen = dict.fromkeys(owner[name] for name in spec.outputs)
    return [(variables[name], shapes[name]) for name in chosen]


def check_library(fmu: Path, found: Any, exchange: bool, folder: Path) -> None:
    """There is a binary for this machine."""
    identifier = (found.modelExchange if exchange else found.coSimulation).modelIdentifier
    here = fmpy.platform if found.fmiVersion == "2.0" else fmpy.platform_tuple
    if (folder / "binaries" / here / f"{identifier}{fmpy.sharedLibraryExtension}").is_file():
        return
    others = sorted(file.name for file in folder.glob("binaries/*"))
    has = f"it has {', '.join(others)}" if others else "it has no binaries at all"
    sources = "; it carries C sources: `fmpy compile` may make one" if any(folder.glob("sources/*.c")) else ""
    raise HarnessError(f"{fmu.name} has no binary {here}/{identifier} for this machine: {has}{sources}")


def run_fmu_process(request: ExternalRunRequest, place: Path, report: Callable[[float], None]) -> RefinementResult:
    """What a process of its own answers, or why it does not."""

    def meanwhile() -> None:
        check_interrupt()
        with suppress(OSError, ValueError):  # it is just being written
            report(float((place / PROGRESS_FILE).read_text()))

    done = run_module(f"{__package__}.fmu_process", json.dumps(asdict(request)), meanwhile=meanwhile)
    if (place / RESULT_FILE).is_file():
        return RefinementResult(**json.loads((place / RESULT_FILE).read_text(encoding="utf-8")))
    if read_lines(place / TIMEOUT_FILE):
        sentence = f"a call of it has not come back within {request.timeout:g} s (--timeout waits longer)"
    elif done.returncode < 0:
        sentence = f"its binary has crashed ({signal.strsignal(-done.returncode)})"
    else:
        sentence = f"its binary has ended the process, with status {done.returncode}"
    return RefinementResult(None, "", sentence)


def read_longest_rows(place: Path, taken: int | None, chosen: list[ShapedVariable]) -> SampleRows:
    """The rows of the pass that is taken, or, None, of the one that came farthest; empty if there are none."""
    files = [place / f"{ROWS_PREFIX}{taken}"] if taken is not None else place.glob(f"{ROWS_PREFIX}*")
    passes = [rows for file in files if len((rows := read_rows(file, chosen)).time)]
    return max(passes, key=lambda rows: float(rows.time[-1]), default=SampleRows(np.zeros(0), {}))


def read_lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []


def build_trajectory(
    spec: RunSpec, variables: Values, values: Values, chosen: list[ShapedVariable], rows: SampleRows, texts: list[str]
) -> Trajectory:
    """The run that the rows show."""
    columns, units, descriptions = {}, {}, {}
    for variable, each in chosen:
        for name in element_names(variable.name, each):
            if name in spec.outputs or variable.name in spec.outputs:
                column = rows.columns[name]
                columns[name] = np.array(texts)[column] if variable.type == "String" else column
                units[name], descriptions[name] = variable_unit(variable), variable.description or name
    parameters: Values = {}
    chosen_values = {alias_key(variables[name]): value for name, value in values.items()}
    for name, one in variables.items():
        if one.causality in SETTABLE or name in values:
            parameters[name], units[name] = (
                effective_value(one, chosen_values.get(alias_key(one), one.start)),
                variable_unit(one),
            )
    return Trajectory(replace(spec, outputs=tuple(columns)), rows.time, columns, units, descriptions, parameters)


def alias_key(variable: Any) -> tuple[str, int]:
    """What variables share that are one under several names."""
    return "Integer" if variable.type == "Enumeration" else variable.type, variable.valueReference
