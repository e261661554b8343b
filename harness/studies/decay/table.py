"""What was found, for the terminal: three ways side by side, and the sentences that belong to them."""

from rich.box import SIMPLE_HEAD
from rich.table import Table

from ...analyses.decay.estimates import Estimate
from ...analyses.decay.identification import DecayIdentification
from ...results.quantity import format_interval


def decay_table(found: DecayIdentification) -> Table:
    """Value and half of its 95 % interval, by the whole signal, by its turning points, and by two of them."""
    shown = Table(box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0), title=found.record.name, title_justify="left")
    shown.add_column("", min_width=14)
    for head in ("whole signal", "turning points", "two peaks"):
        shown.add_column(head, justify="right")
    shown.add_column("", no_wrap=True)
    turns = {each.name: each for each in found.extrema_estimates}
    peaks = {each.name: each for each in found.two_peak_estimates}
    for each in found.estimates:
        cells = [format_estimate(by[each.name]) if each.name in by else "" for by in (turns, peaks)]
        unit = "" if each.unit == "1" else each.unit
        shown.add_row(f"{each.text}, {each.name}", format_estimate(each), *cells, unit)
    return shown


def format_estimate(each: Estimate) -> str:
    """As every result tells it."""
    return format_interval(each.value, each.low, each.high)


def summary_lines(found: DecayIdentification) -> list[str]:
    """What is to be read below the table."""
    said = [found.sentence]
    said += [f"No {name}: {why}." for name, why in found.unavailable.items() if why]
    if found.two_peak_estimates and len(found.best.terms) > 1:
        said.append("Two peaks take all of the loss for one kind; beside a mixed law each of them is too large.")
    used, record = found.t, found.record
    left = len(record.t) - len(used)
    if left:
        said.append(
            f"Fitted to {record.quantity} from t = {record.format_time(used[0])} to {record.format_time(used[-1])} s; {left} of "
            f"{len(record.t)} samples are left out (before the release, after the last sure swing, or stray)."
        )
    return [*said, *found.remarks]
