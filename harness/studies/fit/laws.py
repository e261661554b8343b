"""Tasks of a comparison of laws: each FMU frees and fixes those names that it has."""

from dataclasses import replace
from itertools import chain
from pathlib import Path

from ...errors import SceneError, check_names, option_text
from ...simulation.fmu_archive import read_description
from .request import (
    READABLE,
    FitRequest,
    FitTask,
    check_starts,
    is_unknown,
    make_task,
    parameter_names,
    settable_names,
    variable_names,
)


def make_tasks(request: FitRequest, own_notes: tuple[str, ...] = ()) -> tuple[FitTask, ...]:
    """Return the fit of each FMU of a request, the FMU of the request first, which has these notes.

    Raises
    ------
    SceneError
        If a name is unknown in all FMUs, if an FMU has none of the free parameters or lacks an observed output or an
        input, or if two FMUs are the same.
    """
    fmus = [request.run.fmu, *request.against]
    names = law_names(fmus)
    if len(fmus) == 1:
        return (replace(make_task(request), notes=own_notes),)
    descriptions = [read_description(fmu) for fmu in fmus]
    free = [parameter_names(description, request.observe) for description in descriptions]
    settable = [settable_names(description) for description in descriptions]
    check_names("parameter", request.free, {*chain.from_iterable(free)})
    check_names("parameter", request.run.values, {*chain.from_iterable(settable)})
    check_names("free parameter", request.each, [*request.free])
    check_starts(request)
    tasks: list[FitTask] = []
    for fmu, name, description, available, fixable in zip(fmus, names, descriptions, free, settable, strict=True):
        law = replace(
            request,
            run=replace(
                request.run,
                fmu=fmu,
                values={parameter: value for parameter, value in request.run.values.items() if parameter in fixable},
            ),
            name=name,
            against=(),
            free={parameter: limits for parameter, limits in request.free.items() if parameter in available},
            start={
                parameter: value
                for parameter, value in request.start.items()
                if is_unknown(parameter, available, available)
            },
            each=tuple(parameter for parameter in request.each if parameter in available),
        )
        for kind, causalities, requested in (
            ("output", READABLE, request.observe),
            ("input", ("input",), request.inputs),
        ):
            check_names(f"{kind} of {name}", requested, variable_names(description, causalities))
        if request.free and not law.free:
            raise SceneError(
                f"{name} has none of the free parameters {', '.join(request.free)}: free some of its own as well, as "
                f"in {option_text('free', [*request.free, *available[:1]])}"
            )
        missing = [
            parameter
            for parameter in (*request.free, *request.run.values)
            if parameter not in available and parameter not in fixable
        ]
        notes = (f"{name} has no {', '.join(missing)}: its fit leaves them out.",) if missing else ()
        try:
            tasks.append(replace(make_task(law), notes=notes if tasks else own_notes + notes))
        except SceneError as error:
            raise SceneError(f"{name}: {error}") from None
    for name in request.sigma:
        units = {task.variables[name].unit or "1" for task in tasks}
        if len(units) > 1:
            where = f"{option_text('sigma')} of {name} has no single unit"
            raise SceneError(f"{where}: it is in {' and '.join(sorted(units))}; leave it out")
    return tuple(tasks)


def law_names(fmus: list[Path]) -> list[str]:
    """Return a distinct name for each FMU; raise SceneError if one occurs twice."""
    paths = [fmu.resolve() for fmu in fmus]
    for i, path in enumerate(paths):
        if path in paths[:i]:
            raise SceneError(f"{fmus[i].stem} is to be compared with itself: give another FMU")
    stems = [fmu.stem for fmu in fmus]
    names = [
        stem if stems.count(stem) == 1 else f"{path.parent.name}/{stem}"
        for stem, path in zip(stems, paths, strict=True)
    ]
    return [
        name if names.count(name) == 1 else str(path.with_suffix("")) for name, path in zip(names, paths, strict=True)
    ]
