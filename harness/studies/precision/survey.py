"""The work-precision job: studies of the models asked for, the laws beside dry friction, the anchors, the results."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from functools import partial
from math import isnan
from pathlib import Path
from shutil import copytree, ignore_patterns

from ...references.models import CASES
from ...references.peer_solvers import missing_packages
from ...results.files import column_heading, write_csv_rows
from ...results.folder import check_same_source, replace_folder
from ...results.provenance import write_provenance
from ...running.description import declared_parameters
from ...running.embedded_model import load_model_class
from ...scenes.fmu_files import check_built, find_fmu
from . import law_deviations, literature_problems
from .advice import recommend
from .study import QUICK, Point, Study, SweepSettings, study_model

FOLDER = "precision"
QUICK_RUN = "a quick run"  # which takes no other's place
UNITS = {  # of the columns that have one; SI stands for m and m/s, or rad and rad/s
    **dict.fromkeys(("rtol", "final", "rms", "largest", "beside_dry", "asymmetry"), "1"),
    **dict.fromkeys(("seconds", "events", "period"), "s"),
    **dict.fromkeys(("atol", "error"), "SI"),
    "creep": "m/s",
}
EXCHANGE_HEADING = "model exchange by fmpy's CVode: largest error at rtol [1]"
FILE_SUFFIXES = (".csv", ".json", ".svg", ".png", ".txt", "-exchange.csv", "-laws.csv")  # earlier versions drew .png


@dataclass(frozen=True)
class PrecisionSurvey:
    """All that was found; what to use, in a sentence for each study; and what is missing, a sentence each."""

    studies: tuple[Study, ...]
    deviations: tuple[law_deviations.LawDeviation, ...]
    literature: tuple[literature_problems.LiteratureRun, ...]
    advice: tuple[str, ...]
    missing: tuple[str, ...]


def run_survey(
    models: Sequence[str], extent: SweepSettings, out: Path, report: Callable[[str, float], None]
) -> PrecisionSurvey:
    """Study the models and write results to out/precision; what is there on other models stays."""
    files = list(map(find_fmu, models))
    for file in files:
        check_built(file)
        if extent == QUICK:
            check_same_source(out / FOLDER, QUICK_RUN, f"{file.stem}.json")
    kept = [path.name for path in (out / FOLDER).glob("*") if path.name.endswith(FILE_SUFFIXES)]
    with replace_folder(out / FOLDER, ["anchors.csv", *kept]) as folder:
        if (out / FOLDER).exists():
            stale = ignore_patterns(*(f"{file.stem}[.-]*" for file in files))
            copytree(out / FOLDER, folder, ignore=stale, dirs_exist_ok=True)
        found = run_studies(models, extent, report)
        write_results(found, files, folder, QUICK_RUN if extent == QUICK else "")
    return found


def run_studies(models: Iterable[str], extent: SweepSettings, report: Callable[[str, float], None]) -> PrecisionSurvey:
    """Run everything."""
    studies = tuple(study_model(model, extent, partial(report, model)) for model in models)
    carried = {model: load_model_class(find_fmu(model)) for model in models}
    told = [
        law_deviations.compare_with_dry_friction(case, carried[case.model])
        for case in CASES
        if case.dry_friction_reference and case.model in models
    ]
    report("anchors", 0.0)
    rows = tuple(literature_problems.solve_all()) if told or any(case.model in models for case in CASES) else ()
    said = tuple(
        recommend(each, [law for law in told if law.model == each.model], extent.min_ratio) for each in studies
    )
    absent = (f"{peer} is left out: pip install {package}" for peer, package in missing_packages().items())
    return PrecisionSurvey(
        studies, tuple(told), rows, said, (*map(count_failures, studies), *failure_reasons(studies), *absent)
    )


def count_failures(found: Study) -> str:
    """How many runs failed."""
    failed = sum(bool(point.failure) for point in found.points)
    return f"{found.model}: {failed} of {len(found.points)} runs are gaps; {found.model}.csv has the reasons"


def failure_reasons(found: Iterable[Study]) -> Iterable[str]:
    """Why what is asked once has no answer."""
    return dict.fromkeys(p.failure for study in found for p in study.points if p.failure and isnan(p.rtol))


def write_results(found: PrecisionSurvey, files: Sequence[Path], folder: Path, source: str) -> None:
    """Tables and figures of what was found about the FMUs in these files, and whether they come from a quick run."""
    from .figure import draw

    for each, file, sentence in zip(found.studies, files, found.advice, strict=True):
        values = {case.name: case.values for case in each.cases}
        write_provenance(folder, [file], declared_parameters(file), values, f"{each.model}.json", source)
        (folder / f"{each.model}.txt").write_text(f"{sentence}\n", encoding="utf-8")
        save(folder / f"{each.model}.csv", heads(Point), map(astuple, each.points))
        exchange_errors = each.exchange_errors()
        if exchange_errors:
            cases = next(iter(exchange_errors.values()))
            rows = [[rtol, *errors.values()] for rtol, errors in exchange_errors.items()]
            save(folder / f"{each.model}-exchange.csv", [EXCHANGE_HEADING, *(f"{case} [1]" for case in cases)], rows)
        mine = [law for law in found.deviations if law.model == each.model]
        draw(each, mine, folder / f"{each.model}.svg")
        if mine:
            save(folder / f"{each.model}-laws.csv", heads(law_deviations.LawDeviation), map(astuple, mine))
    if found.literature:
        save(folder / "anchors.csv", heads(literature_problems.LiteratureRun), map(astuple, found.literature))


def heads(kind: type) -> list[str]:
    """The names of a record's fields, with the units that they are declared with."""
    return [column_heading(field.name, UNITS.get(field.name, "")) for field in fields(kind)]


def save(path: Path, heads: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A CSV file; None and NaN are left empty."""
    write_csv_rows(path, heads, ([None if value != value else value for value in row] for row in rows))
