"""Table of measured quantities and known values: published values, references, or parameters."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from ...results.files import write_csv_rows
from ...results.quantity import Quantity, format_number
from ...results.summary import MAX_DEVIATION, STEPS_TABLE, Outcome, Summary, make_table
from ...scenes.scene import KnownValues, Scene
from ...simulation.trajectory import Trajectory

OTHER_MACHINE = "other CPU: the published run time was measured on another machine"
RUN_TIME = "run time"
CHATTERING_LAWS = ("sign", "threshold")
STEP_QUANTITIES = ("steps", "mean_step")
KINDS = ("published", "reference", "parameter")  # of known values, as in the table
ALWAYS_SHOWN = ("steps", "mean_step", "run_time")  # shown for all scenes, even without a known value


@dataclass(frozen=True)
class SceneOutcome:
    """Result of a scene: the measured quantities, or the error message."""

    name: str
    scene: Scene | None
    run: Trajectory | None
    quantities: tuple[Quantity, ...]
    error: str | None


def results_table(outcomes: Iterable[SceneOutcome], everything: bool) -> Table:
    """Return one table for all outcomes; if `everything`, include quantities without a known value."""
    outcomes = list(outcomes)
    width = 5 if any(outcome.scene and outcome.scene.known for outcome in outcomes) else 3  # columns
    table = Table(box=SIMPLE_HEAD, show_edge=False, padding=0, caption_justify="left")
    table.add_column("quantity", no_wrap=True)
    table.add_column("measured", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    if width == 5:
        table.add_column("compared with", justify="right", min_width=14)
        table.add_column("difference", justify="right", no_wrap=True)
    for outcome in outcomes:
        table.add_section()
        if outcome.scene is None or outcome.run is None:
            table.add_row(Text(outcome.name, style="bold red"), Text("failed", style="red"))
            continue
        known = outcome.scene.known
        title = Text.assemble((outcome.name, "bold"), f"\n  {outcome.run.settings_label}")
        origin = f"{known.kind}\n{known.source}" if known else ""
        table.add_row(title, *("", "", Text(origin, style="italic"))[: width - 1])
        values = known.values if known else {}
        for quantity in outcome.quantities:
            if everything or quantity.name in values or quantity.name in ALWAYS_SHOWN:
                cells = quantity_row(quantity, values.get(quantity.name))
                table.add_row(*map(Text, cells[:width]))
                table.caption = OTHER_MACHINE if cells[-1] == "other CPU" else table.caption
    return table


def quantity_row(quantity: Quantity, known_value: object) -> tuple[str, str, str, str, str]:
    """Return description, measured value, unit, known value and difference, in the unit of the known value."""
    text, value, unit = f"  {quantity.text}", quantity.value, quantity.unit
    if isinstance(known_value, tuple):
        known_value, unit = known_value
        value = quantity.to_unit(unit)
    if not isinstance(known_value, int | float):
        measured, unit = quantity.format()
        return text, measured, unit, str(known_value or ""), ""
    known = repr(known_value)
    measured = format_number(value, max(5, len(known.replace(".", "").lstrip("0"))))
    percent = deviation(quantity, (known_value, unit))
    difference = "" if percent is None else f"{percent:+.2g} %"
    difference = "other CPU" if quantity.name == "run_time" else difference
    return text, measured, "" if unit == "1" else unit, known, difference


def deviation(quantity: Quantity, known_value: object) -> float | None:
    """Return the difference from a known value in percent, with two digits; None for texts, zeros and run times."""
    value, unit = known_value if isinstance(known_value, tuple) else (known_value, quantity.unit)
    if not isinstance(value, int | float) or not value or quantity.name == "run_time":
        return None
    return float(f"{100 * (quantity.to_unit(unit) / value - 1):.2g}")


def quantity_rows(quantities: Iterable[Quantity], known: KnownValues | None) -> list[tuple[str, ...]]:
    """Return description, measured value and unit, and with known values also these and the differences."""
    values = known.values if known else {}
    rows = [quantity_row(quantity, values.get(quantity.name)) for quantity in quantities]
    return [(text.strip(), *cells)[: len(quantity_headings(known))] for text, *cells in rows]


def quantity_headings(known: KnownValues | None, first: str = "quantity") -> list[str]:
    """Return the headings, with the kind and the source of the known values."""
    return [first, "measured", "unit", *([known.label, "difference"] if known else ())]


def write_quantities(quantities: Iterable[Quantity], known: KnownValues | None, path: Path) -> None:
    """Write the quantities of a scene as CSV. Its first column, the descriptions, has no heading."""
    write_csv_rows(path, quantity_headings(known, ""), quantity_rows(quantities, known))


def judge_outcomes(outcomes: Iterable[SceneOutcome]) -> list[tuple[str, Outcome]]:
    """Return name and conclusion of each scene that is compared with known values."""
    judged = [
        (outcome.name, judge_deviations(outcome.quantities, outcome.scene.known, outcome.run))
        for outcome in outcomes
        if outcome.scene and outcome.run
    ]
    return [(name, outcome) for name, outcome in judged if outcome]


def comparison_as_json(outcome: SceneOutcome) -> dict[str, object] | None:
    """Return the known values of a scene with their kind, source, citation and differences; None without any."""
    if outcome.scene is None or outcome.run is None or outcome.scene.known is None:
        return None
    known = outcome.scene.known
    judgement = judge_deviations(outcome.quantities, known, outcome.run)
    compared = [quantity for quantity in outcome.quantities if quantity.name in known.values]
    values = [
        {"name": item.name, "value": known.values[item.name], "percent": deviation(item, known.values[item.name])}
        for item in compared
    ]
    return {
        "kind": known.kind,
        "source": known.source,
        "citation": known.citation,
        "values": values,
        "agrees": judgement.is_good if judgement else None,
        "text": judgement.text if judgement else "",
    }


def summarize_quantities(
    summary: Summary, quantities: Iterable[Quantity], known: KnownValues | None, run: Trajectory
) -> Summary:
    """Return the summary of a run with its quantities in place of its signals.

    Quantities without a known value are in a second table, unless no quantity has a known value.
    """
    headings = quantity_headings(known)
    rows = [round_run_time(cells) for cells in quantity_rows(quantities, known)]
    compared = [cells for cells in rows if any(cells[3:])] or rows
    others = [cells[:3] for cells in rows if cells not in compared]
    tables = make_table(headings, compared) + make_table(headings[:3], others, "Quantities without a known value")
    steps = tuple(table for table in summary.tables if table.title == STEPS_TABLE)
    outcome = judge_deviations(quantities, known, run)
    return replace(summary, tables=tables + steps, outcome=outcome)


def round_run_time(cells: tuple[str, ...]) -> tuple[str, ...]:
    """Return a row with two digits of a run time: a busy machine makes more of them meaningless."""
    name, value, *others = cells
    return (name, f"{float(f'{float(value):.2g}'):g}", *others) if name == RUN_TIME else cells


def judge_deviations(quantities: Iterable[Quantity], known: KnownValues | None, run: Trajectory) -> Outcome | None:
    """Return the largest difference from a known value; steps of a law that chatters are not judged."""
    if known is None:
        return None
    ignored = STEP_QUANTITIES if chatters(run) else ()
    differences = [(deviation(item, known.values.get(item.name)), item) for item in quantities]
    deviations = [
        (percent, item.text) for percent, item in differences if percent is not None and item.name not in ignored
    ]
    if not deviations:
        return None
    percent, name = max(deviations, key=lambda pair: abs(pair[0]))
    is_good = abs(percent) <= MAX_DEVIATION
    text = f"{name} differs by {percent:+.2g} %"
    return Outcome(f"{percent:+.2g} %", text, is_good, percent, known.kind, known.source)


def chatters(run: Trajectory) -> bool:
    """Return whether the friction law of a run chatters, so that its steps depend on rounding."""
    return run.parameters.get("friction") in CHATTERING_LAWS


def explain_chatter(outcomes: Iterable[SceneOutcome]) -> str:
    """Return why the known steps of scenes whose friction chatters are not judged; empty without any."""
    names = [
        outcome.name
        for outcome in outcomes
        if outcome.scene and outcome.run and outcome.scene.known and chatters(outcome.run)
        if {*STEP_QUANTITIES} & {*outcome.scene.known.values}
    ]
    reason = "friction chatters at a stop, so they depend on rounding"
    return f"Steps of {', '.join(names)} are not judged: {reason}." if names else ""


def conclude(outcomes: Iterable[SceneOutcome]) -> Text:
    """Return what was checked: one line, in green if all cases agree with their known values; otherwise in red, with
    those that differ."""
    judged = judge_outcomes(outcomes)
    if not judged:
        return Text()
    counts = {kind: sum(outcome.kind == kind for _, outcome in judged) for kind in KINDS}
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    differing = [f"{name}: {outcome.text}" for name, outcome in judged if not outcome.is_good]
    text = f"{len(judged) - len(differing)} of {len(judged)} cases agree within {MAX_DEVIATION:g} % ({kinds})."
    return Text("\n".join((text, *differing)), style="red" if differing else "green")
