"""A fit in the terminal and in its summary: a table of values, and remarks."""

from math import isfinite

from rich.table import Table

from ...analyses.estimation.estimate import ColumnResiduals, Estimate
from ...analyses.fit.parameter_fit import ParameterFit
from ...results.quantity import format_interval
from ...results.summary import Summary, limit_remarks, make_terminal_table, read_cells


def fit_table(fit: ParameterFit) -> Table:
    """Return the table of values with 95 % intervals."""
    names = ", ".join(record.name for record in fit.records)
    result = make_terminal_table(f"{fit.fmu}: {names}")
    result.add_column("parameter")
    result.add_column("value, 95 % interval", justify="right")
    result.add_column("unit", no_wrap=True)
    for estimate in (*fit.estimates, *fit.combinations):
        result.add_row(estimate.name, format_estimate(estimate), estimate.unit)
    return result


def format_estimate(estimate: Estimate) -> str:
    """Format value and interval; an interval with one end is written as a limit."""
    if isfinite(estimate.error) or not (isfinite(estimate.low) or isfinite(estimate.high)):
        has_interval = isfinite(estimate.low) and isfinite(estimate.high)
        return format_interval(estimate.value, estimate.low, estimate.high) if has_interval else "not determined"
    if isfinite(estimate.low) and isfinite(estimate.high):
        return f"{estimate.low:.3g} to {estimate.high:.3g}"
    return f"> {estimate.low:.3g}" if isfinite(estimate.low) else f"< {estimate.high:.3g}"


def comparison_table(fit: ParameterFit) -> Table:
    """Return the table of the compared laws, best first."""
    assert fit.comparison
    result = make_terminal_table()
    result.add_column("law")
    for heading in ("unknowns", "residual/noise", "BIC", "above the best"):
        result.add_column(heading, justify="right")
    for law in fit.comparison.laws:
        numbers = (f"{law.residual:.3f}", f"{law.bic:.1f}", f"{law.difference:.1f}")
        result.add_row(law.fmu, str(law.unknowns), *numbers)
    return result


def result_parts(fit: ParameterFit) -> list[Table | str]:
    """Return the tables and sentences of a fit, and of the fits that it is compared with."""
    parts: list[Table | str] = [fit_table(fit), "", *summary_lines(fit)]
    for law in fit.against:
        parts += ["", fit_table(law), "", *summary_lines(law)]
    if fit.comparison:
        parts += ["", comparison_table(fit), ""]
        parts += [] if fit.comparison.verdict in fit.remarks else [fit.comparison.verdict]
    return parts


def summary_lines(fit: ParameterFit) -> list[str]:
    """Return the sentences below the table."""
    lines = [describe_residuals(column, column.record) for column in fit.columns]
    lines += [
        describe_residuals(column, f"{column.record} (validation)")
        for column in (fit.validation.columns if fit.validation else ())
    ]
    return [*lines, *limit_remarks(fit.remarks), *fit.notes]


def describe_residuals(column: ColumnResiduals, record: str) -> str:
    """Return a sentence on the residuals of a column."""
    return (
        f"Residuals of {column.name} in {record}: {column.residual:.3g} {column.unit}".rstrip()
        + f" (noise {column.noise:.3g}, range {column.range:.3g})."
    )


def summarize_fit(fit: ParameterFit) -> Summary:
    """Return the summary, with a table for each law and one of their comparison."""
    name = ", ".join(record.name for record in fit.records)
    tables = read_cells(fit_table(fit))
    for law in fit.against:
        tables += read_cells(fit_table(law), f"Fit of {law.fmu}")
    if fit.comparison:
        tables += read_cells(comparison_table(fit), "Compared laws, best first")
    text = f"Fit of {fit.fmu} to {name}: record, fitted signal, residuals, and profiles of the values"
    return Summary("fit", f"{fit.fmu}: {name}", tuple(summary_lines(fit)), tables, text)
