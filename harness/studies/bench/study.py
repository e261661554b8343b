"""The numbers to reach, each beside what it is compared with in the same run."""

from collections.abc import Callable
from pathlib import Path

from ...references.models import MODELS
from ...references.reference_trajectory import require_reference_packages
from ...results.files import write_csv_rows
from ...results.folder import replace_folder
from ...results.provenance import prefix_parameters, write_provenance
from ...running.description import declared_parameters
from ...scenes.fmu_files import find_fmu
from .benchmark import Benchmark

FOLDER, FILE = "bench", "bench.csv"


def all_benchmarks() -> list[Callable[[], Benchmark]]:
    """All that is measured: run times, then those of the native FMUs, then model exchange, then errors."""
    require_reference_packages()
    from .accuracy import accuracy_benchmarks
    from .model_exchange import exchange_benchmarks
    from .native import native_benchmarks
    from .speed import speed_benchmarks

    return [*speed_benchmarks(), *native_benchmarks(), *exchange_benchmarks(), *accuracy_benchmarks()]


def run_benchmarks(
    chosen: list[Callable[[], Benchmark]], out: Path, report: Callable[[str, float], None]
) -> list[Benchmark]:
    """Measure the chosen and write out/bench/bench.csv; told of each as it comes."""
    with replace_folder(out / FOLDER, (FILE,)) as folder:
        found = []
        for measure in chosen:
            found.append(measure())
            report(found[-1].name, 1.0)
        save(found, folder / FILE)
        fmus = [fmu for fmu in map(find_fmu, MODELS) if fmu.is_file()]
        write_provenance(folder, fmus, prefix_parameters({fmu.stem: declared_parameters(fmu) for fmu in fmus}))
    return found


def save(found: list[Benchmark], path: Path) -> None:
    """One line for each measure and for each number beside it."""
    heads = ["what", "measured", "unit", "to reach", "reached", "beside", "its value"]
    mine = ((each, (each.name, each.value, each.unit, each.target, each.is_met)) for each in found)
    write_csv_rows(
        path, heads, ((*cells, beside.name, beside.value) for each, cells in mine for beside in each.baselines)
    )
