"""The table of the benchmark."""

from collections.abc import Iterable
from math import isnan

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from .benchmark import Baseline, Benchmark


def benchmark_table(found: Iterable[Benchmark]) -> Table:
    """Measured, to reach, reached or not, and what stands beside it."""
    table = Table(box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    table.add_column("what")
    table.add_column("measured", justify="right", no_wrap=True)
    table.add_column("to reach", justify="right", no_wrap=True)
    table.add_column("")
    table.add_column("beside")
    for measure in found:
        missed = Text("not measured", style="dim") if isnan(measure.value) else Text("missed", style="bold red")
        verdict = Text("reached") if measure.is_met else missed
        beside = "\n".join(format_baseline(measure, each) for each in measure.baselines)
        figures = (format_quantity(number, measure.unit) for number in (measure.value, measure.target))
        table.add_row(measure.name, *figures, verdict, beside)
    return table


def format_baseline(measure: Benchmark, beside: Baseline) -> str:
    """What stands beside, and how many times the measured number it is."""
    if beside.value is None:
        return beside.name
    ratio = "" if measure.unit == "1" or not measure.value else f", {beside.value / measure.value:.3g} times"
    return f"{beside.name}: {format_quantity(beside.value, 's')}{ratio}"


def format_quantity(value: float, unit: str) -> str:
    """A number in its unit, seconds in one of a handy size; nothing for what was not measured."""
    if isnan(value):
        return ""
    if unit == "s":
        size, name = next((s, n) for s, n in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (0.0, "ns")) if value >= s)
        return f"{value / (size or 1e-9):.3g} {name}"
    return f"{value:.3g}" if unit == "1" else f"{value:.3g} {unit}"
