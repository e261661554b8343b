"""An identified decay in the terminal and in its summary: a table of three methods, and remarks."""

import numpy as np
from rich.table import Table

from ...analyses.decay.identification import DecayIdentification
from ...analyses.estimation.estimate import Estimate
from ...results.quantity import format_interval
from ...results.summary import Summary, make_table, make_terminal_table, read_cells


def decay_table(identification: DecayIdentification) -> Table:
    """Return the table of values with 95 % intervals from the whole signal, turning points, and two peaks."""
    result = make_terminal_table(identification.record.name)
    result.add_column("", min_width=14)
    for heading in ("whole signal", "turning points", "two peaks"):
        result.add_column(heading, justify="right")
    result.add_column("", no_wrap=True)
    by_extrema = {estimate.name: estimate for estimate in identification.extrema_estimates}
    by_peaks = {estimate.name: estimate for estimate in identification.two_peak_estimates}
    for estimate in identification.estimates:
        cells = [
            format_estimate(source[estimate.name]) if estimate.name in source else ""
            for source in (by_extrema, by_peaks)
        ]
        unit = "" if estimate.unit == "1" else estimate.unit
        result.add_row(f"{estimate.text}, {estimate.name}", format_estimate(estimate), *cells, unit)
    return result


def summarize_decay(identification: DecayIdentification) -> Summary:
    """Return the summary, with a table of the combinations of losses, best first."""
    sentence, ranked, _ = identification.sentence.partition(" (BIC ")
    sentence += "." if ranked else ""
    (values,) = read_cells(decay_table(identification))
    headings = ("", "whole signal", "turning points", "first and last peak, if this loss acted alone", "unit")
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
            *make_table(headings, values.rows),
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
            "The two-peak values attribute the whole loss to one mechanism; with combined mechanisms each is too large."
        )
    t, record = identification.t, identification.record
    n_excluded = len(record.t) - len(t)
    if n_excluded:
        lines.append(
            f"Fitted to {record.quantity} from t = {record.format_time(t[0])} to {record.format_time(t[-1])} s; "
            f"{n_excluded} of {len(record.t)} samples are excluded (before release, after the last reliable cycle, or "
            "outliers)."
        )
    return [*lines, *identification.remarks]
