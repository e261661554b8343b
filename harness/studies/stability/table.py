"""Tables of the stiff and extreme cases, and their summary: finished runs and rejected runs."""

from collections import Counter
from collections.abc import Iterable
from itertools import groupby

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from ...results.summary import Outcome, Summary, make_table
from .outcomes import REFUSED, WRONG, CaseOutcome, StabilityRegion


def error_table(rows: Iterable[CaseOutcome]) -> Table:
    """Return the table of largest error and internal steps of all runs that should finish."""
    table = empty_table("largest relative error, and internal steps below")
    rows = [row for row in rows if row.case.max_error is not None]
    method_numbers = {row.case.method: row.case.run.values["solver.method"] for row in rows}
    methods = sorted(method_numbers, key=lambda method: method_numbers[method])
    for method in methods:
        table.add_column(method, justify="right", no_wrap=True)
    for model, of_model in groupby(sorted(rows, key=lambda row: row.case.name), lambda row: row.case.name):
        table.add_section()
        table.add_row(Text(model, style="bold"))
        for title, group in groupby(of_model, lambda row: row.case.title):
            cells = {row.case.method: format_cell(row) for row in group}
            table.add_row(f"  {title}", *(cells.get(method, Text("")) for method in methods))
    return table


def empty_table(title: str) -> Table:
    """Return an empty table with a column for the scene."""
    table = Table(title=title, box=SIMPLE_HEAD, show_edge=False, title_justify="left", expand=True)
    table.add_column("scene", ratio=1)
    return table


def format_cell(row: CaseOutcome) -> Text:
    """Format the outcome of one run."""
    if row.has_passed and row.ended == REFUSED:
        return Text("refused")
    if not row.has_passed or row.motion is None:
        return Text("wrong", style="bold red")
    return Text(f"{f'{row.error:.0e}' if row.error else '0'}\n{row.steps}")


def refusal_table(rows: Iterable[CaseOutcome]) -> Table:
    """Return the table of messages of all runs that should be rejected, one per scene."""
    table = empty_table("refused with a message")
    table.add_column("models")
    table.add_column("message", ratio=3)
    groups: dict[str, list[CaseOutcome]] = {}
    for row in rows:
        if row.case.max_error is None:
            groups.setdefault(row.case.title, []).append(row)
    for title, group in groups.items():
        models = ", ".join(dict.fromkeys(row.case.name for row in group))
        failed = [row for row in group if not row.has_passed]
        table.add_row(title, models, Text((failed or group)[0].text, style="red" if failed else ""))
    return table


def summary(rows: list[CaseOutcome], regions: Iterable[StabilityRegion]) -> str:
    """Return a summary of outcomes, energy, and steps bounded by stability."""
    n_passed = sum(row.has_passed for row in rows)
    lines = [f"{n_passed} of {len(rows)} ended as expected."]
    exact = [row.energy_rise for row in rows if row.case.method == "exact" and row.energy_rise >= 0.0]
    others = [row.energy_rise / row.case.rtol for row in rows if row.case.method != "exact" and row.energy_rise >= 0.0]
    if exact and others:
        values = f"at most {max(exact):.1g} of its largest value with exact, {max(others):.2g} rtol with other methods"
        lines.append(f"Spurious increase of energy: {values}.")
    for region in regions:
        bound = "bounded by stability" if region.slope < -0.5 else "not bounded by stability"
        growth = f"steps grow as x_m^{region.slope:+.2f} at x_m = {region.stiffness[-1]:g} m/s"
        lines.append(f"{region.method}: {growth}, {bound}.")
    return "\n".join(lines)


def summarize_outcomes(rows: list[CaseOutcome]) -> Summary:
    """Return the summary: the failed cases with their reasons, and the number of outcomes by model and method."""
    failed = [row for row in rows if row.ended == WRONG]
    counts = Counter((row.case.name, row.case.method, row.ended) for row in rows)
    endings = sorted({ending for _, _, ending in counts})
    pairs = sorted({(model, method) for model, method, _ in counts})
    headings = ("model", "method", *("failed" if ending == WRONG else ending for ending in endings))
    cells = ((*pair, *(counts[(*pair, ending)] for ending in endings)) for pair in pairs)
    reasons = ((row.case.name, row.case.title, row.case.method, row.text) for row in failed)
    failures = make_table(("model", "case", "method", "reason"), reasons)
    value = f"{len(rows) - len(failed)} of {len(rows)}"
    sentences = (f"{value} stiff and extreme cases ended as expected.", *["The other cases:"][: len(failed)])
    return Summary(
        "stability",
        "Outcomes",
        sentences,
        failures + make_table(headings, cells, "Number of outcomes by model and method" if failed else ""),
        "Internal steps of each method over x_m, the speed of maximum friction",
        Outcome(value, f"{len(failed)} failed" if failed else "none hangs, none ends with a wrong result", not failed),
    )
