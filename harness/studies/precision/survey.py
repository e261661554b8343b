"""Runs work-precision studies, law deviations and literature problems, and writes the results."""

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
from ...scenes.fmu_files import find_fmu
from . import law_deviations, literature_problems
from .advice import recommend
from .study import QUICK, Point, Study, SweepSettings, study_model

FOLDER = "precision"
QUICK_RUN = "a quick run"  # does not replace a full run
UNITS = {  # of columns; SI means m and m/s, or rad and rad/s
    **dict.fromkeys(("rtol", "final", "rms", "largest", "beside_dry", "asymmetry", "integration"), "1"),
    **dict.fromkeys(("seconds", "events", "period"), "s"),
    **dict.fromkeys(("atol", "error"), "SI"),
    "creep": "m/s",
}
EXCHANGE_HEADING = "model exchange by fmpy's CVode: largest error at rtol [1]"
FILE_SUFFIXES = (".csv", ".json", ".svg", ".png", ".txt", "-exchange.csv", "-laws.csv")  # earlier versions drew .png


@dataclass(frozen=True)
class PrecisionSurvey:
    """All results, with one recommendation per study, and messages on missing results."""

    studies: tuple[Study, ...]
    deviations: tuple[law_deviations.LawDeviation, ...]
    literature: tuple[literature_problems.LiteratureRun, ...]
    advice: tuple[str, ...]
    missing: tuple[str, ...]


def run_survey(
    models: Sequence[str], extent: SweepSettings, out: Path, report: Callable[[str, float], None]
) -> PrecisionSurvey:
    """Study the models and write the results to out/precision; results of other models are kept."""
    files = list(map(find_fmu, models))
    for file in files:
        load_model_class(file)
        if extent == QUICK:
            check_same_source(out / FOLDER, QUICK_RUN, f"{file.stem}.json")
    existing = [path.name for path in (out / FOLDER).glob("*") if path.name.endswith(FILE_SUFFIXES)]
    with replace_folder(out / FOLDER, ["anchors.csv", *existing]) as folder:
        if (out / FOLDER).exists():
            replaced_files = ignore_patterns(*(f"{file.stem}[.-]*" for file in files))
            copytree(out / FOLDER, folder, ignore=replaced_files, dirs_exist_ok=True)
        survey_result = run_studies(models, extent, report)
        write_results(survey_result, files, folder, QUICK_RUN if extent == QUICK else "")
    return survey_result


def run_studies(models: Iterable[str], extent: SweepSettings, report: Callable[[str, float], None]) -> PrecisionSurvey:
    """Run all studies."""
    studies = tuple(study_model(model, extent, partial(report, model)) for model in models)
    classes = {model: load_model_class(find_fmu(model)) for model in models}
    deviations = [
        law_deviations.compare_with_dry_friction(case, classes[case.model])
        for case in CASES
        if case.dry_friction_reference and case.model in models
    ]
    if "stickslip" in models:
        deviations += [
            law_deviations.compare_bristles(name, law, literature_problems.load_more_model(name))
            for name, law in law_deviations.BRISTLES.items()
        ]
    report("anchors", 0.0)
    literature = (
        tuple(literature_problems.solve_all()) if deviations or any(case.model in models for case in CASES) else ()
    )
    advice = tuple(
        recommend(item, [law for law in deviations if law.model == item.model], extent.min_ratio) for item in studies
    )
    missing_peers = (f"{peer} was skipped: pip install {package}" for peer, package in missing_packages().items())
    return PrecisionSurvey(
        studies,
        tuple(deviations),
        literature,
        advice,
        (*map(count_failures, studies), *failure_reasons(studies), *missing_peers),
    )


def count_failures(study: Study) -> str:
    """Return a sentence on the number of failed runs."""
    failed = sum(bool(point.failure) for point in study.points)
    return f"{study.model}: {failed} of {len(study.points)} runs failed; see {study.model}.csv"


def failure_reasons(studies: Iterable[Study]) -> Iterable[str]:
    """Return the error messages of failed runs without tolerance."""
    return dict.fromkeys(p.failure for study in studies for p in study.points if p.failure and isnan(p.rtol))


def write_results(results: PrecisionSurvey, files: Sequence[Path], folder: Path, source: str) -> None:
    """Write tables, figures and provenance for the FMUs in `files`."""
    from .figure import draw

    for study, file, sentence in zip(results.studies, files, results.advice, strict=True):
        values = {case.name: case.values for case in study.cases}
        write_provenance(folder, [file], declared_parameters(file), values, f"{study.model}.json", source)
        (folder / f"{study.model}.txt").write_text(f"{sentence}\n", encoding="utf-8")
        write_table(folder / f"{study.model}.csv", csv_headings(Point), map(astuple, study.points))
        exchange_errors = study.exchange_errors()
        if exchange_errors:
            cases = next(iter(exchange_errors.values()))
            rows = [[rtol, *errors.values()] for rtol, errors in exchange_errors.items()]
            write_table(
                folder / f"{study.model}-exchange.csv", [EXCHANGE_HEADING, *(f"{case} [1]" for case in cases)], rows
            )
        model_deviations = [law for law in results.deviations if law.model == study.model]
        if study.model == "stickslip":
            model_deviations += [law for law in results.deviations if law.model in law_deviations.BRISTLES]
        draw(study, model_deviations, folder / f"{study.model}.svg")
        if model_deviations:
            write_table(
                folder / f"{study.model}-laws.csv",
                csv_headings(law_deviations.LawDeviation),
                map(astuple, model_deviations),
            )
    if results.literature:
        write_table(
            folder / "anchors.csv", csv_headings(literature_problems.LiteratureRun), map(astuple, results.literature)
        )


def csv_headings(kind: type) -> list[str]:
    """Return the field names of a dataclass with their units."""
    return [column_heading(field.name, UNITS.get(field.name, "")) for field in fields(kind)]


def write_table(path: Path, csv_headings: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV file; None and NaN are empty cells."""
    write_csv_rows(path, csv_headings, ([None if value != value else value for value in row] for row in rows))
