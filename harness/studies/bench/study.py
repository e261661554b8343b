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
from .measure import Measure

FOLDER, FILE = "bench", "bench.csv"


def measures() -> list[Callable[[], Measure]]:
    """All that is measured: run times, then those of the native FMUs, then model exchange, then errors."""
    require_reference_packages()
    from .accuracy import accuracy
    from .exchange import exchange
    from .native import native
    from .speed import speed

    return [*speed(), *native(), *exchange(), *accuracy()]


def bench(chosen: list[Callable[[], Measure]], out: Path, report: Callable[[str, float], None]) -> list[Measure]:
    """Measure the chosen and write out/bench/bench.csv; told of each as it comes."""
    with replace_folder(out / FOLDER, (FILE,)) as folder:
        found = []
        for measure in chosen:
            found.append(measure())
            report(found[-1].what, 1.0)
        save(found, folder / FILE)
        fmus = [fmu for fmu in map(find_fmu, MODELS) if fmu.is_file()]
        write_provenance(folder, fmus, prefix_parameters({fmu.stem: declared_parameters(fmu) for fmu in fmus}))
    return found


def save(found: list[Measure], path: Path) -> None:
    """One line for each measure and for each number beside it."""
    heads = ["what", "measured", "unit", "to reach", "reached", "beside", "its value"]
    mine = ((each, (each.what, each.value, each.unit, each.reach, each.reached)) for each in found)
    write_csv_rows(path, heads, ((*cells, beside.name, beside.value) for each, cells in mine for beside in each.beside))
