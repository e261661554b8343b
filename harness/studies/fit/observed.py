"""Choice of the observed outputs and of the inputs where the user names none."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ...errors import SceneError, option_text
from ...records.columns import Column, find_column, find_time_column, list_columns
from ...records.record import Record
from ...records.units import conversion_factor
from ...scenes.roles import ROLES, find_roles
from ...simulation.fmu_archive import read_description
from ...simulation.whole_run import real_variables
from .request import FitRequest


def choose_columns(request: FitRequest, records: Sequence[Record]) -> tuple[FitRequest, tuple[str, ...]]:
    """Return a request that observes outputs and names the inputs of the records, and a sentence on each choice.

    Raises
    ------
    SceneError
        If no output is named, and no column is that of an output.
    """
    request, driven = choose_inputs(request, records)
    request, observed = choose_observed(request, records[0])
    return request, tuple(filter(None, (observed, driven)))


def choose_inputs(request: FitRequest, records: Sequence[Record]) -> tuple[FitRequest, str]:
    """Return a request with the columns that are named like inputs of all FMUs, and a sentence; empty without any.

    All records must have the column, because the same headings apply to all.
    """
    if request.inputs:
        return request, ""
    inputs = set.intersection(
        *(
            {name for name, variable in real_variables(read_description(fmu)).items() if variable.causality == "input"}
            for fmu in (request.run.fmu, *request.against)
        )
    )
    headings = [
        {column.name: column.heading for column in list_columns(record.table) if column.name in inputs}
        for record in records
    ]
    named = {name: heading for name, heading in headings[0].items() if all(name in others for others in headings[1:])}
    if not named:
        return request, ""
    names = ", ".join(named)
    columns = "the record has columns of these names" if len(named) > 1 else "a column has its name"
    sentence = f"the runs are driven by {names}, because {columns}; {option_text('inputs')} selects others."
    return replace(request, inputs=named), sentence


def choose_observed(request: FitRequest, record: Record) -> tuple[FitRequest, str]:
    """Return a request that observes outputs, and a sentence on the choice; empty if the request names outputs.

    A column that is named like an output is taken: of several, the position, the velocity, the acceleration or the
    first. Otherwise it is the only column whose unit fits one output only.

    Raises
    ------
    SceneError
        If there is no such column.
    """
    if request.observe:
        return request, ""
    table, options = record.table, record.options
    candidates = list_columns(table)
    time_column = find_time_column(table, candidates, options)
    if options.column is not None:  # the record names its signal
        column = find_column(options.column, table, candidates)
        candidates = [replace(column, unit=options.unit or column.unit)]
    driven = {heading.lower() for heading in request.inputs.values()}
    columns = [
        column
        for column in candidates
        if column is not time_column and not {column.name.lower(), column.heading.lower()} & driven
    ]
    description = read_description(request.run.fmu)
    outputs = {
        name: variable.unit for name, variable in real_variables(description).items() if variable.causality == "output"
    }
    named = {column.name: column for column in columns if column.name in outputs}
    if named:
        roles = find_roles({variable.name: variable for variable in description.modelVariables})
        output = next((roles[role] for role in ROLES if roles.get(role) in named), next(iter(named)))
        others = ", ".join(name for name in named if name != output)
        return replace(request, observe={output: named[output].heading}), (
            f"{output} is observed, because a column has its name{f', and {others} not' if others else ''}; "
            f"{option_text('observe')} selects other outputs."
        )
    fits = list(fit_units(columns, outputs))
    if len(fits) != 1:
        headings = ", ".join(column.heading for column in columns if column.heading)
        example = {fits[0][0] if fits else next(iter(outputs), "x"): (headings or "position").split(",")[0]}
        raise SceneError(
            f"nothing is observed: {table.name} has no column with the name of an output ({', '.join(outputs)}), and "
            f"{'several units fit' if fits else 'no unit fits'}; name an output and its column, as in "
            f"{option_text('observe', example)}"
        )
    ((output, column),) = fits
    return replace(request, observe={output: column.heading}), (
        f"{output} is observed in {column.heading}, the only column with a unit of this output; "
        f"{option_text('observe')} selects another."
    )


def fit_units(columns: list[Column], outputs: dict[str, str]) -> Iterator[tuple[str, Column]]:
    """Yield each output and column whose units measure the same quantity."""
    for output, unit in outputs.items():
        for column in columns:
            if column.unit and unit and conversion_factor(column.unit, unit) is not None:
                yield output, column
