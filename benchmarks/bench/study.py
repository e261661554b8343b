"""Runs the benchmarks and writes bench.csv."""

from collections.abc import Callable
from pathlib import Path

from benchmarks import command_line
from harness.references.models import MODELS
from harness.results.files import write_csv_rows
from harness.results.folder import replace_folder
from harness.results.provenance import prefix_parameters, write_provenance
from harness.results.summary import write_summary
from harness.scenes.fmu_files import find_fmu
from harness.simulation.fmu_archive import declared_parameters

from .benchmark import Benchmark
from .table import summarize_benchmarks

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
    selected: list[Callable[[], Benchmark]], out: Path, report: Callable[[str, float], None]
) -> list[Benchmark]:
    """Run benchmarks and write out/bench/bench.csv; `report` receives the name of each finished benchmark."""
    with replace_folder(out / FOLDER, (FILE,)) as folder:
        results = []
        for run_benchmark in selected:
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
