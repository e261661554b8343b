"""The benchmarks, each with its target and its baselines: runs them, and writes and summarizes bench.csv."""

from collections.abc import Callable, Iterable, Sequence
from math import isnan
from pathlib import Path

from benchmarks import command_line
from harness.references.models import MODELS
from harness.results.files import write_csv_rows
from harness.results.folder import replace_folder
from harness.results.provenance import prefix_parameters, write_provenance
from harness.results.summary import ResultColumn, ResultTable, Summary, SummaryTable, write_summary
from harness.scenes.fmu_files import find_fmu
from harness.simulation.fmu_archive import declared_parameters

from .benchmark import Baseline, Benchmark


def benchmark_table(benchmarks: Sequence[Benchmark]) -> ResultTable:
    """Return the table of measured values, targets and baselines."""
    return ResultTable(
        benchmarks,
        (
            ResultColumn("benchmark", "{0.name}", is_text=True),
            ResultColumn("measured", lambda benchmark: format_quantity(benchmark.value, benchmark.unit)),
            ResultColumn("target", lambda benchmark: format_quantity(benchmark.target, benchmark.unit)),
            ResultColumn("verdict", judge, is_text=True),
            ResultColumn("baseline", list_baselines, is_text=True),
        ),
    )


def judge(benchmark: Benchmark) -> str:
    """Return whether the target is met."""
    return "met" if benchmark.is_met else "not measured" if isnan(benchmark.value) else "missed"


def list_baselines(benchmark: Benchmark) -> str:
    """Return the baselines, one a line."""
    return "\n".join(format_baseline(benchmark, baseline) for baseline in benchmark.baselines)


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
    groups: dict[str, list[Benchmark]] = {"": [], "Targets that are met": [], "Not measured": []}
    for benchmark in benchmarks:
        title = "Not measured" if isnan(benchmark.value) else "Targets that are met" if benchmark.is_met else ""
        groups[title].append(benchmark)
    missed_targets, met_targets, _ = groups.values()
    sentences = (
        f"{len(met_targets)} of {len(met_targets) + len(missed_targets)} targets met.",
        *["Targets that are missed:"][: len(missed_targets)],
    )
    headings = ("benchmark", "measured", "target", "unit", "baselines")
    tables = tuple(
        SummaryTable(headings, tuple(map(summary_row, rows)), title) for title, rows in groups.items() if rows
    )
    return Summary("bench", "Targets and measurements", sentences, tables)


def summary_row(benchmark: Benchmark) -> tuple[str, ...]:
    """Return the row of a benchmark, with two digits of what was measured."""
    value_text, target_text = (
        "" if isnan(value) else f"{value:{digits}}"
        for value, digits in ((benchmark.value, ".2g"), (benchmark.target, "g"))
    )
    baselines = "; ".join(
        baseline.name if baseline.value is None else f"{baseline.name} {baseline.value:.2g}"
        for baseline in benchmark.baselines
    )
    return benchmark.name, value_text, target_text, "" if benchmark.unit == "1" else benchmark.unit, baselines


FOLDER, FILE = "bench", "bench.csv"


def all_benchmarks() -> list[Callable[[], Benchmark]]:
    """Return all benchmarks: run times, native FMUs, stiff friction, model exchange, accuracy."""
    from .accuracy import accuracy_benchmarks
    from .model_exchange import exchange_benchmarks
    from .native import native_benchmarks
    from .speed import speed_benchmarks
    from .stiff import stiff_benchmarks

    return [
        *speed_benchmarks(),
        *native_benchmarks(),
        *stiff_benchmarks(),
        *exchange_benchmarks(),
        *accuracy_benchmarks(),
    ]


def run_benchmarks(
    functions: list[Callable[[], Benchmark]], out: Path, report: Callable[[str, float], None]
) -> list[Benchmark]:
    """Run benchmarks and write out/bench/bench.csv; `report` receives the name of each finished benchmark."""
    with replace_folder(out / FOLDER, (FILE,)) as folder:
        results = []
        for run_benchmark in functions:
            results.append(run_benchmark())
            report(results[-1].name, 1.0)
        save(results, folder / FILE)
        fmus = [fmu for fmu in map(find_fmu, MODELS) if fmu.is_file()]
        parameters = prefix_parameters({fmu.stem: declared_parameters(fmu) for fmu in fmus})
        write_provenance(folder, fmus, parameters, command=command_line())
        write_summary(folder, summarize_benchmarks(results))
    return results


def save(results: list[Benchmark], path: Path) -> None:
    """Write one row for each baseline of each benchmark."""
    headings = ["benchmark", "measured", "unit", "target", "met", "baseline", "baseline value"]
    rows = ((result, (result.name, result.value, result.unit, result.target, result.is_met)) for result in results)
    write_csv_rows(
        path,
        headings,
        ((*cells, baseline.name, baseline.value) for result, cells in rows for baseline in result.baselines),
    )
