"""Table of measured quantities and published values."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from ...results.files import write_csv_rows
from ...results.quantity import Quantity, format_number
from ...results.summary import MAX_DEVIATION, STEPS_TABLE, Outcome, Summary, make_table
from ...running.trajectory import Trajectory
from ...scenes.scene import Scene

OTHER_MACHINE = "other CPU: the published run time was measured on another machine"
RUN_TIME = "run time"
CHATTERING_LAWS = ("sign", "threshold")
STEP_QUANTITIES = ("steps (time points)", "mean step")
ALWAYS_SHOWN = ("steps", "mean_step", "run_time")  # shown for all published scenes, even without a published value


@dataclass(frozen=True)
class SceneOutcome:
    """Result of a scene: the measured quantities, or the error message."""

    name: str
    scene: Scene | None
    run: Trajectory | None
    quantities: tuple[Quantity, ...]
    error: str | None


def results_table(outcomes: Iterable[SceneOutcome], everything: bool) -> Table:
    """Return one table for all outcomes; if `everything`, include quantities without a published value."""
    outcomes = list(outcomes)
    width = 5 if any(outcome.scene and outcome.scene.published for outcome in outcomes) else 3  # columns
    table = Table(box=SIMPLE_HEAD, show_edge=False, padding=0, caption_justify="left")
    table.add_column("", no_wrap=True)
    table.add_column("measured", justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    if width == 5:
        table.add_column("published", justify="right", min_width=15)
        table.add_column("difference", justify="right", no_wrap=True)
    for outcome in outcomes:
        table.add_section()
        if outcome.scene is None or outcome.run is None:
            table.add_row(Text(outcome.name, style="bold red"), Text("failed", style="red"))
            continue
        published = outcome.scene.published
        title = Text.assemble((outcome.name, "bold"), f"\n  {outcome.run.settings_label}")
        table.add_row(title, *("", "", Text("\n" + published.get("source", ""), style="italic"))[: width - 1])
        for quantity in outcome.quantities:
            if everything or quantity.name in published or quantity.name in ALWAYS_SHOWN:
                cells = quantity_row(quantity, published.get(quantity.name))
                table.add_row(*map(Text, cells[:width]))
                table.caption = OTHER_MACHINE if cells[-1] == "other CPU" else table.caption
    return table


def quantity_row(quantity: Quantity, published_value: object) -> tuple[str, str, str, str, str]:
    """Return description, measured value, unit, published value and difference, in the unit of the published value."""
    text, value, unit = f"  {quantity.text}", quantity.value, quantity.unit
    if isinstance(published_value, tuple):
        published_value, unit = published_value
        value = quantity.to_unit(unit)
    if not isinstance(published_value, int | float):
        measured, unit = quantity.format()
        return text, measured, unit, str(published_value or ""), ""
    published = repr(published_value)
    measured = format_number(value, max(5, len(published.replace(".", "").lstrip("0"))))
    percent = deviation(quantity, (published_value, unit))
    difference = "" if percent is None else f"{percent:+.2g} %"
    difference = "other CPU" if quantity.name == "run_time" else difference
    return text, measured, "" if unit == "1" else unit, published, difference


def deviation(quantity: Quantity, published_value: object) -> float | None:
    """Return the difference from a published value in percent, with two digits; None for texts, zeros and run times."""
    value, unit = published_value if isinstance(published_value, tuple) else (published_value, quantity.unit)
    if not isinstance(value, int | float) or not value or quantity.name == "run_time":
        return None
    return float(f"{100 * (quantity.to_unit(unit) / value - 1):.2g}")


def quantity_rows(quantities: Iterable[Quantity], published: dict[str, Any]) -> list[tuple[str, ...]]:
    """Return description, measured value and unit, and with published values also these and the differences."""
    rows = [quantity_row(quantity, published.get(quantity.name)) for quantity in quantities]
    return [(text.strip(), *cells)[: len(quantity_headings(published))] for text, *cells in rows]


def quantity_headings(published: dict[str, Any]) -> list[str]:
    """Return the headings, with the source of the published values."""
    return ["", "measured", "unit", *([f"published ({published['source']})", "difference"] if published else ())]


def write_quantities(quantities: Iterable[Quantity], published: dict[str, Any], path: Path) -> None:
    """Write the quantities of a scene as CSV."""
    write_csv_rows(path, quantity_headings(published), quantity_rows(quantities, published))


def summarize_quantities(
    summary: Summary, quantities: Iterable[Quantity], published: dict[str, Any], run: Trajectory
) -> Summary:
    """Return the summary of a run with its quantities in place of first and last values.

    Quantities without a published value are in a second table, unless no quantity has a published value.
    """
    headings = quantity_headings(published)
    rows = [round_run_time(cells) for cells in quantity_rows(quantities, published)]
    compared = [cells for cells in rows if any(cells[3:])] or rows
    others = [cells[:3] for cells in rows if cells not in compared]
    tables = make_table(headings, compared) + make_table(headings[:3], others, "Quantities without a published value")
    steps = tuple(table for table in summary.tables if table.title == STEPS_TABLE)
    outcome = judge_deviations(quantities, published, run)
    return replace(summary, tables=tables + steps, outcome=outcome)


def round_run_time(cells: tuple[str, ...]) -> tuple[str, ...]:
    """Return a row with two digits of a run time: a busy machine makes more of them meaningless."""
    name, value, *others = cells
    return (name, f"{float(f'{float(value):.2g}'):g}", *others) if name == RUN_TIME else cells


def judge_deviations(quantities: Iterable[Quantity], published: dict[str, Any], run: Trajectory) -> Outcome | None:
    """Return the largest difference from a published value, with a reason if the law chatters."""
    differences = [(deviation(quantity, published.get(quantity.name)), quantity.text) for quantity in quantities]
    deviations = [(percent, name) for percent, name in differences if percent is not None]
    if not deviations:
        return None
    percent, name = max(deviations, key=lambda pair: abs(pair[0]))
    chatters = run.parameters.get("friction") in CHATTERING_LAWS and name in STEP_QUANTITIES
    reason = "; its friction chatters, so its steps depend on rounding" * chatters
    is_good = abs(percent) <= MAX_DEVIATION
    return Outcome(f"{percent:+.2g} %", f"{name} differs by {percent:+.2g} %{reason}", is_good, percent)
