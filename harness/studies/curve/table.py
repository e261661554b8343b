"""Identified friction in the terminal and in its summary: constants, laws, values for models, and remarks."""

from math import isfinite

from rich.table import Table

from ...analyses.curve.identification import CurveIdentification
from ...analyses.curve.law_fit import LawFit
from ...analyses.estimation.estimate import Estimate
from ...errors import option_text
from ...results.quantity import format_interval
from ...results.summary import Summary, limit_remarks, make_terminal_table, read_cells
from .model_file import LAW_MODEL
from .model_values import LINEAR_FORCE, assignments, law_of_models, model_values


def constants_table(fit: LawFit, title: str) -> Table:
    """Return the table of the constants of a law with 95 % intervals."""
    result = make_terminal_table(title)
    result.add_column("constant")
    result.add_column("value, 95 % interval", justify="right")
    result.add_column("unit", no_wrap=True)
    for estimate in fit.estimates:
        result.add_row(f"{estimate.text}, {estimate.name}", format_estimate(estimate), estimate.unit)
    return result


def laws_table(identification: CurveIdentification) -> Table:
    """Return the table of the laws, best first."""
    result = make_terminal_table("Laws, best first")
    result.add_column("law")
    unit = identification.points.force_unit
    for heading in ("constants", f"residual [{unit}]", "BIC", "above the best"):
        result.add_column(heading, justify="right")
    best = identification.best.bic
    for fit in identification.laws:
        numbers = (f"{fit.residual:.3g}", f"{fit.bic:.1f}", f"{fit.bic - best:.1f}")
        result.add_row(fit.name, str(len(fit.estimates)), *numbers)
    return result


def models_table(identification: CurveIdentification) -> Table:
    """Return the table of the values for models, as options of `run`, `sweep` and `fit`."""
    result = make_terminal_table("Values for models")
    result.add_column("model")
    result.add_column("options", overflow="fold")
    for model, values in model_values(identification).items():
        result.add_row(model, assignments(values))
    return result


def format_estimate(estimate: Estimate) -> str:
    """Format value and interval; an interval with one end is written as a limit."""
    if isfinite(estimate.high) or not isfinite(estimate.low):
        return format_interval(estimate.value, estimate.low, estimate.high)
    return f"{estimate.value:.3g} (> {estimate.low:.3g})"


def sentences(identification: CurveIdentification) -> list[str]:
    """Return the sentences below the tables."""
    used, count = int(identification.used.sum()), len(identification.points.v)
    fit, unit = identification.best, identification.points.force_unit
    lines = [identification.sentence, f"Residual of {used} of {count} points: {fit.residual:.3g} {unit}."]
    for reason in dict.fromkeys(identification.unavailable.values()):
        laws = [name for name, text in identification.unavailable.items() if text == reason]
        lines.append(f"Not fitted: {', '.join(laws)}; {reason}.")
    return [
        *lines,
        *describe_models(identification),
        *limit_remarks(identification.remarks),
        *identification.points.notes,
    ]


def describe_models(identification: CurveIdentification) -> list[str]:
    """Return the sentences on the values for models."""
    fit, best = law_of_models(identification), identification.best
    if identification.points.force_unit != LINEAR_FORCE:
        return [f"The models of this project with such friction move along a line; {LAW_MODEL} rotates."]
    if fit is None:
        return [f"No model of this project has this friction; {LAW_MODEL} has it."]
    lines = []
    if fit.name != best.name:
        lines.append(
            f"The models have the law {fit.name}, whose BIC is larger by {fit.bic - best.bic:.1f}; {LAW_MODEL} has "
            "the best law."
        )
    if identification.mass is None:
        lines.append(f"stickslip needs the mass for its coefficients of friction: give it by {option_text('mass')}.")
    return lines


def summarize_curve(identification: CurveIdentification) -> Summary:
    """Return the summary, with tables of the constants, the laws and the values for models."""
    tables = read_cells(constants_table(identification.best, ""))
    tables += read_cells(laws_table(identification), "Laws, best first")
    tables += read_cells(models_table(identification), "Values for models")
    return Summary(
        "curve",
        identification.points.name,
        tuple(sentences(identification)),
        tables,
        f"Friction of {identification.points.name} over velocity: points of both directions, laws and residuals. "
        f"{identification.sentence}",
    )
