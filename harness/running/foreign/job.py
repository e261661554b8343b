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

from ...errors import LONGEST, HarnessError, SceneError, check_names
from ...process.child import ask_module
from ...process.interrupt import check
from ...process.room import room
from ..description import span
from ..run import Run
from ..specification import Specification
from ..unpacked import unpacked
from ..values import accepted, in_force, unit
from .agreement import FINEST
from .request import ANSWER, COARSEST, HUNG, ROWS, SAID, SHARE, TEXTS, Answer, Request
from .rows import RECORDED, Rows, Shaped, elements, read

Values = dict[str, Any]  # by the name of the variable

SETTABLE = ("parameter", "structuralParameter", "input")


def simulate(wanted: Specification, found: Any, report: Callable[[float], None]) -> Run:
    """The run that is wanted of the FMU so described; what it lacks, and why, is in `failed`.

    HarnessError in one sentence if there is none at all, SceneError if the FMU has not got what is wanted.
    """
    variables = {variable.name: variable for variable in found.modelVariables}
    exchange = wanted.exchange or found.coSimulation is None
    if exchange and found.modelExchange is None:
        offered = " and ".join(ways(found)) or "no interface"
        lacks = "model exchange is not among them" if wanted.exchange else "neither co-simulation nor model exchange"
        raise HarnessError(f"{wanted.fmu.name} offers {offered}; {lacks}")
    values = set_values(wanted, variables)
    chosen = recorded(wanted, variables, values)
    start, stop = even_span(wanted, found)
    with unpacked(wanted.fmu) as folder, room("rows-") as place:
        check_library(wanted.fmu, found, exchange, folder)
        request = Request(
            folder=str(folder),
            room=str(place),
            exchange=exchange,
            start=start,
            stop=stop,
            tolerance=wanted.tolerance,
            patience=wanted.patience,
            grid=None if wanted.follow else wanted.grid,
            coarsest=round((stop - start) / wanted.grid) if wanted.grid else COARSEST,
            values=values,
            outputs={variable.name: list(shape) for variable, shape in chosen},
        )
        answer = asked(request, place, report)
        rows = recording(place, answer.taken, chosen)
        texts = [json.loads(line) for line in lines(place / TEXTS)]
        said = lines(place / SAID)
    failed = f"{wanted.fmu.name}: {answer.failed}" if answer.failed else ""
    if failed and len(rows.time) and " at t = " not in failed:
        failed += f", after t = {rows.time[-1]:.9g} s"
    if len(rows.time) < 2:
        raise HarnessError(failed or f"{wanted.fmu.name} gives nothing to record")
    prints = f"it prints: {said[-1][:LONGEST]}" if said else ""
    note = "; ".join(filter(None, (answer.note, prints)))
    return replace(result(wanted, variables, values, chosen, rows, texts), note=note, failed=failed)


def ways(found: Any) -> list[str]:
    """The interfaces that an FMU without model exchange offers."""
    offered = {"co-simulation": found.coSimulation, "scheduled execution": found.scheduledExecution}
    return [way for way, interface in offered.items() if interface]


def even_span(wanted: Specification, found: Any) -> tuple[float, float]:
    """Start and stop in s, between which a clock can be counted on."""
    start, stop = span(wanted, found)
    if not np.spacing(max(abs(start), abs(stop))) * FINEST <= stop - start < inf:
        between = f"between start = {start!r} s and stop = {stop!r} s"
        raise SceneError(f"{wanted.fmu.name}: {between} are no times to step to; name another --stop")
    return start, stop


def set_values(wanted: Specification, variables: Values) -> Values:
    """What is set, as it is set; lists for arrays."""
    settable = [
        name
        for name, one in variables.items()
        if one.causality in SETTABLE or (one.initial in ("exact", "approx") and one.variability != "constant")
    ]
    check_names("variable to set", wanted.values, settable)
    values: Values = {}
    for name in sorted(wanted.values, key=lambda name: bool(variables[name].dimensions)):
        values[name] = accepted(variables[name], wanted.values[name], shape(variables[name], values))
    return values


def shape(variable: Any, values: Mapping[str, Any]) -> tuple[int, ...]:
    """The shape of an array, () of a scalar; a dimension may be a structural parameter, and that is set."""
    sizes = []
    for dimension in variable.dimensions:
        named = dimension.variable
        sizes.append(accepted(named, values.get(named.name, float(named.start))) if named else int(dimension.start))
    return tuple(sizes)


def recorded(wanted: Specification, variables: Values, values: Values) -> list[Shaped]:
    """The variables to record, whole, whether one names them or some of their elements."""
    shapes = {name: shape(one, values) for name, one in variables.items() if one.type in RECORDED}
    owner = {element: name for name, each in shapes.items() for element in (name, *elements(name, each))}
    check_names("output", wanted.outputs, owner)
    chosen = dict.fromkeys(owner[name] for name in wanted.outputs)
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


def asked(request: Request, place: Path, report: Callable[[float], None]) -> Answer:
    """What a process of its own answers, or why it does not."""

    def meanwhile() -> None:
        check()
        with suppress(OSError, ValueError):  # it is just being written
            report(float((place / SHARE).read_text()))

    done = ask_module(f"{__package__}.child", json.dumps(asdict(request)), meanwhile=meanwhile)
    if (place / ANSWER).is_file():
        return Answer(**json.loads((place / ANSWER).read_text(encoding="utf-8")))
    if lines(place / HUNG):
        sentence = f"a call of it has not come back within {request.patience:g} s (--patience waits longer)"
    elif done.returncode < 0:
        sentence = f"its binary has crashed ({signal.strsignal(-done.returncode)})"
    else:
        sentence = f"its binary has ended the process, with status {done.returncode}"
    return Answer(None, "", sentence)


def recording(place: Path, taken: int | None, chosen: list[Shaped]) -> Rows:
    """The rows of the pass that is taken, or, None, of the one that came farthest; empty if there are none."""
    files = [place / f"{ROWS}{taken}"] if taken is not None else place.glob(f"{ROWS}*")
    passes = [rows for file in files if len((rows := read(file, chosen)).time)]
    return max(passes, key=lambda rows: float(rows.time[-1]), default=Rows(np.zeros(0), {}))


def lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []


def result(
    wanted: Specification, variables: Values, values: Values, chosen: list[Shaped], rows: Rows, texts: list[str]
) -> Run:
    """The run that the rows show."""
    columns, units, descriptions = {}, {}, {}
    for variable, each in chosen:
        for name in elements(variable.name, each):
            if name in wanted.outputs or variable.name in wanted.outputs:
                column = rows.columns[name]
                columns[name] = np.array(texts)[column] if variable.type == "String" else column
                units[name], descriptions[name] = unit(variable), variable.description or name
    parameters: Values = {}
    chosen_values = {identity(variables[name]): value for name, value in values.items()}
    for name, one in variables.items():
        if one.causality in SETTABLE or name in values:
            parameters[name], units[name] = in_force(one, chosen_values.get(identity(one), one.start)), unit(one)
    return Run(replace(wanted, outputs=tuple(columns)), rows.time, columns, units, descriptions, parameters)


def identity(variable: Any) -> tuple[str, int]:
    """What variables share that are one under several names."""
    return "Integer" if variable.type == "Enumeration" else variable.type, variable.valueReference
