"""An identified decay in the terminal and in its summary: the values to use, their checks, and remarks."""

import numpy as np
from rich.table import Table

from ...analyses.decay.identification import DecayIdentification
from ...analyses.decay.thresholds import LIMIT_SPEED
from ...analyses.estimation.estimate import Estimate
from ...results.quantity import format_interval
from ...results.summary import Summary, limit_remarks, make_table, make_terminal_table

CHECKS = ("turning points", "two peaks (rough)")  # values that check those of the whole signal


def decay_table(identification: DecayIdentification) -> Table:
    """Return the table of the values to use, from the whole signal, with 95 % intervals."""
    result = make_terminal_table(identification.record.name)
    result.add_column("quantity")
    result.add_column("value to use, 95 % interval", justify="right")
    result.add_column("unit", no_wrap=True)
    for estimate in identification.estimates:
        result.add_row(f"{estimate.text}, {estimate.name}", format_estimate(estimate), format_unit(estimate))
    return result


def check_table(identification: DecayIdentification) -> Table:
    """Return the table of the values from the turning points, and from two peaks as a rough check, by their symbols."""
    result = make_terminal_table()
    for heading in ("check", *CHECKS):
        result.add_column(heading, justify="left" if heading == "check" else "right")
    result.add_column("unit", no_wrap=True)
    for estimate in identification.estimates:
        cells = check_cells(identification, estimate.name)
        if any(cells):
            result.add_row(estimate.name, *cells, format_unit(estimate))
    return result


def check_cells(identification: DecayIdentification, name: str) -> list[str]:
    """Return the values of a quantity from the turning points and from two peaks, empty without one."""
    sources = (identification.extrema_estimates, identification.two_peak_estimates)
    by_name = ({estimate.name: estimate for estimate in source} for source in sources)
    return [format_estimate(source[name]) if name in source else "" for source in by_name]


def format_unit(estimate: Estimate) -> str:
    """Return the unit of an estimate; empty for a ratio."""
    return "" if estimate.unit == "1" else estimate.unit


def summarize_decay(identification: DecayIdentification) -> Summary:
    """Return the summary, with a table of the combinations of losses, best first."""
    sentence, ranked, _ = identification.sentence.partition(" (BIC ")
    sentence += "." if ranked else ""
    values = (
        (
            f"{estimate.text}, {estimate.name}",
            format_estimate(estimate),
            format_unit(estimate),
            *check_cells(identification, estimate.name),
        )
        for estimate in identification.estimates
    )
    headings = (
        "quantity",
        "value to use, 95 % interval",
        "unit",
        "check: turning points",
        "rough check: first and last peak, if this loss acted alone",
    )
    samples, scale = len(identification.t), identification.problem.scale
    laws = (
        (law.description, f"{law.bic:.1f}", f"{np.sqrt(law.sum_of_squares / samples) * scale:.3g}")
        for law in identification.laws
    )
    law_headings = ("losses", "BIC, smaller is better", f"rms residual [{identification.record.unit}]")
    return Summary(
        "decay",
        identification.record.name,
        (sentence, *identification.remarks),
        (
            *make_table(headings, values),
            *make_table(law_headings, laws, "Combinations of losses, best first"),
        ),
        f"Decay of {identification.record.name}: signal, turning points, envelope and fit, and residuals. {sentence}",
    )


def format_estimate(estimate: Estimate) -> str:
    """Format value and interval."""
    return format_interval(estimate.value, estimate.low, estimate.high)


def summary_lines(identification: DecayIdentification) -> list[str]:
    """Return the sentences below the table."""
    lines = [identification.sentence]
    lines += [f"No {name}: {reason}." for name, reason in identification.unavailable.items() if reason]
    if identification.two_peak_estimates and len(identification.best.terms) > 1:
        lines.append(
            "The values from two peaks are rough checks: each attributes the whole loss to one mechanism, and is too "
            "large if several act."
        )
    rise = identification.undetected_rise
    if np.isinf(rise):
        lines.append(
            "No friction that rises at low speed is excluded (Stribeck): the record departs from the law, and the part "
            "after that shows none. The losses of the part before may be those of such friction."
        )
    elif rise < 1.0:  # a larger limit says nothing
        lines.append(
            f"Friction that rises at low speed by less than {100 * rise:.2g} % of r is not excluded (Stribeck, falling "
            f"to 1/e of the rise at {LIMIT_SPEED:g} of the first peak speed)."
        )
    t, record = identification.t, identification.record
    n_excluded = len(record.t) - len(t)
    if n_excluded:
        lines.append(
            f"Fitted to {record.quantity} from t = {record.format_time(t[0])} to {record.format_time(t[-1])} s; "
            f"{n_excluded} of {len(record.t)} samples are excluded (before release, after the last reliable cycle, or "
            "outliers)."
        )
    return [*lines, *limit_remarks(identification.remarks)]
