"""The table that sets measured figures beside published ones."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from ...results.files import write_csv_rows
from ...results.quantity import Quantity, format_number
from ...running.trajectory import Trajectory
from ...scenes.scene import Scene

OTHER_MACHINE = "elsewhere: the published run time is that of another machine"
ALWAYS_SHOWN = ("steps", "mean_step", "run_time")  # shown in the main job even where nothing was published


@dataclass(frozen=True)
class SceneOutcome:
    """What became of a scene: its measured quantities, or the sentence that says why there are none."""

    name: str
    scene: Scene | None
    run: Trajectory | None
    quantities: tuple[Quantity, ...]
    error: str | None


def results_table(outcomes: Iterable[SceneOutcome], everything: bool) -> Table:
    """One table for all outcomes; `everything`: also what has no published figure."""
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
        figures = outcome.scene.published
        title = Text.assemble((outcome.name, "bold"), f"\n  {outcome.run.settings_label}")
        table.add_row(title, *("", "", Text("\n" + figures.get("source", ""), style="italic"))[: width - 1])
        for quantity in outcome.quantities:
            if everything or quantity.name in figures or quantity.name in ALWAYS_SHOWN:
                cells = row(quantity, figures.get(quantity.name))
                table.add_row(*map(Text, cells[:width]))
                table.caption = OTHER_MACHINE if cells[-1] == "elsewhere" else table.caption
    return table


def row(quantity: Quantity, figure: object) -> tuple[str, str, str, str, str]:
    """Text, measured, unit, published and difference; in the unit of the published figure where it has one."""
    text, value, unit = f"  {quantity.text}", quantity.value, quantity.unit
    if isinstance(figure, tuple):
        figure, unit = figure
        value = quantity.to_unit(unit)
    if not isinstance(figure, int | float):
        measured, unit = quantity.formatted()
        return text, measured, unit, str(figure or ""), ""
    published = repr(figure)
    measured = format_number(value, max(5, len(published.replace(".", "").lstrip("0"))))
    difference = f"{100 * (value / figure - 1):+.2g} %" if figure else ""
    difference = "elsewhere" if quantity.name == "run_time" else difference
    return text, measured, "" if unit == "1" else unit, published, difference


def write_quantities(quantities: Iterable[Quantity], published: dict[str, Any], path: Path) -> None:
    """Write what the table shows of a scene as CSV, with the source of the published figures in its heading."""
    told = [(text.strip(), *cells) for text, *cells in (row(each, published.get(each.name)) for each in quantities)]
    if not published:
        write_csv_rows(path, ["", "measured", "unit"], (cells[:3] for cells in told))
        return
    write_csv_rows(path, ["", "measured", "unit", f"published ({published['source']})", "difference"], told)
