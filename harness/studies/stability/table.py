"""The tables of the stiff and extreme scenes: those that end, and those that are refused."""

from collections.abc import Iterable
from itertools import groupby

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from .outcomes import REFUSED, CaseOutcome, StabilityRegion


def error_table(rows: Iterable[CaseOutcome]) -> Table:
    """Largest error and, below it, internal steps of every run that should end."""
    table = scenes("largest error, as a share of the largest value, and below it internal steps")
    rows = [row for row in rows if row.case.max_error is not None]
    number = {row.case.method: row.case.setting.values["solver.method"] for row in rows}
    methods = sorted(number, key=lambda method: number[method])
    for method in methods:
        table.add_column(method, justify="right", no_wrap=True)
    for model, of_model in groupby(sorted(rows, key=lambda row: row.case.name), lambda row: row.case.name):
        table.add_section()
        table.add_row(Text(model, style="bold"))
        for title, group in groupby(of_model, lambda row: row.case.title):
            cells = {row.case.method: cell(row) for row in group}
            table.add_row(f"  {title}", *(cells.get(method, Text("")) for method in methods))
    return table


def scenes(title: str) -> Table:
    """A table that begins with the scene, and breaks its lines rather than cut them off."""
    table = Table(title=title, box=SIMPLE_HEAD, show_edge=False, title_justify="left", expand=True)
    table.add_column("scene", ratio=1)
    return table


def cell(row: CaseOutcome) -> Text:
    """The end of one run."""
    if row.passed and row.ended == REFUSED:
        return Text("refused")
    if not row.passed or row.motion is None:
        return Text("wrong", style="bold red")
    return Text(f"{f'{row.error:.0e}' if row.error else '0'}\n{row.motion.counts.steps}")


def refusal_table(rows: Iterable[CaseOutcome]) -> Table:
    """The sentence of every run that should be refused; where the models say the same, that of one."""
    table = scenes("refused, each with its sentence")
    table.add_column("models")
    table.add_column("sentence", ratio=3)
    found: dict[str, list[CaseOutcome]] = {}
    for row in rows:
        if row.case.max_error is None:
            found.setdefault(row.case.title, []).append(row)
    for title, group in found.items():
        models = ", ".join(dict.fromkeys(row.case.name for row in group))
        wrong = [row for row in group if not row.passed]
        table.add_row(title, models, Text((wrong or group)[0].text, style="red" if wrong else ""))
    return table


def summary(rows: list[CaseOutcome], found: Iterable[StabilityRegion]) -> str:
    """How many ended as they should, what energy did, and where stability bounds the steps."""
    well = sum(row.passed for row in rows)
    lines = [f"{well} of {len(rows)} ended as they should."]
    exact = [row.energy_rise for row in rows if row.case.method == "exact" and row.energy_rise >= 0.0]
    others = [row.energy_rise / row.case.rtol for row in rows if row.case.method != "exact" and row.energy_rise >= 0.0]
    if exact and others:
        words = f"by {max(exact):.1g} of the largest with exact, by {max(others):.2g} rtol with the other methods"
        lines.append(f"Energy that nobody puts in rises {words}, at most.")
    for region in found:
        bound = "bounded by stability" if region.slope < -0.5 else "not bounded by stability"
        growth = f"steps grow as x_m^{region.slope:+.2f} at x_m = {region.stiffness[-1]:g} m/s"
        lines.append(f"{region.method}: {growth}, {bound}.")
    return "\n".join(lines)
