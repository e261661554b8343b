"""Table of the benchmarks."""

from collections.abc import Iterable
from math import isnan

from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

from .benchmark import Baseline, Benchmark


def benchmark_table(benchmarks: Iterable[Benchmark]) -> Table:
    """Return the table of measured values, targets and baselines."""
    table = Table(box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    table.add_column("benchmark")
    table.add_column("measured", justify="right", no_wrap=True)
    table.add_column("target", justify="right", no_wrap=True)
    table.add_column("")
    table.add_column("baseline")
    for benchmark in benchmarks:
        missed = Text("not measured", style="dim") if isnan(benchmark.value) else Text("missed", style="bold red")
        verdict = Text("met") if benchmark.is_met else missed
        baselines = "\n".join(format_baseline(benchmark, baseline) for baseline in benchmark.baselines)
        values = (format_quantity(number, benchmark.unit) for number in (benchmark.value, benchmark.target))
        table.add_row(benchmark.name, *values, verdict, baselines)
    return table


def format_baseline(benchmark: Benchmark, baseline: Baseline) -> str:
    """Format a baseline with its ratio to the measured value."""
    if baseline.value is None:
        return baseline.name
    ratio = "" if benchmark.unit == "1" or not benchmark.value else f", {baseline.value / benchmark.value:.3g} times"
    return f"{baseline.name}: {format_quantity(baseline.value, 's')}{ratio}"


def format_quantity(value: float, unit: str) -> str:
    """Format a value with its unit, seconds with a prefix; NaN is empty."""
    if isnan(value):
        return ""
    if unit == "s":
        size, name = next((s, n) for s, n in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (0.0, "ns")) if value >= s)
        return f"{value / (size or 1e-9):.3g} {name}"
    return f"{value:.3g}" if unit == "1" else f"{value:.3g} {unit}"
