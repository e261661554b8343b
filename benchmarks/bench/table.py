"""Table of the benchmarks, and their summary."""

from collections.abc import Iterable
from math import isnan

from rich.table import Table
from rich.text import Text

from harness.results.summary import Summary, make_table, make_terminal_table

from .benchmark import Baseline, Benchmark


def benchmark_table(benchmarks: Iterable[Benchmark]) -> Table:
    """Return the table of measured values, targets and baselines."""
    table = make_terminal_table()
    table.add_column("benchmark")
    table.add_column("measured", justify="right", no_wrap=True)
    table.add_column("target", justify="right", no_wrap=True)
    table.add_column("verdict")
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


def summarize_benchmarks(benchmarks: Iterable[Benchmark]) -> Summary:
    """Return the summary: the missed targets, those that are met, and what was not measured."""
    groups: dict[str, list[tuple[str, ...]]] = {"": [], "Targets that are met": [], "Not measured": []}
    for benchmark in benchmarks:
        title = "Not measured" if isnan(benchmark.value) else "Targets that are met" if benchmark.is_met else ""
        groups[title].append(summary_row(benchmark))
    missed, met, _ = groups.values()
    sentences = (f"{len(met)} of {len(met) + len(missed)} targets met.", *["Targets that are missed:"][: len(missed)])
    headings = ("benchmark", "measured", "target", "unit", "baselines")
    tables = tuple(table for title, rows in groups.items() for table in make_table(headings, rows, title))
    return Summary("bench", "Targets and measurements", sentences, tables)


def summary_row(benchmark: Benchmark) -> tuple[str, ...]:
    """Return the row of a benchmark, with two digits of what was measured."""
    measured, target = (
        "" if isnan(value) else f"{value:{digits}}"
        for value, digits in ((benchmark.value, ".2g"), (benchmark.target, "g"))
    )
    baselines = "; ".join(
        baseline.name if baseline.value is None else f"{baseline.name} {baseline.value:.2g}"
        for baseline in benchmark.baselines
    )
    return benchmark.name, measured, target, "" if benchmark.unit == "1" else benchmark.unit, baselines
