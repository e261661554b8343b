"""Runs work-precision studies and law deviations, and writes the results."""

import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import astuple, dataclass, fields
from functools import partial
from math import isnan
from pathlib import Path

from ...errors import install_command
from ...references.models import CASES, MODELS
from ...references.peer_solvers import missing_packages
from ...results.files import column_heading, write_csv_rows
from ...results.folder import replace_folder
from ...results.provenance import load_provenance, write_provenance
from ...results.summary import MissingResult, Summary, SummaryTable, make_table, write_summary
from ...running.embedded_model import load_model_class, load_more_model
from ...running.fmu_archive import declared_parameters
from ...scenes.fmu_files import find_fmu
from . import law_deviations
from .advice import recommend
from .method_choice import tabulate_choices
from .study import QUICK, Point, Study, SweepSettings, study_model

FOLDER = "precision"
FILES = ("points.csv", "model-exchange.csv", "laws.csv", "figure.svg")
QUICK_RUN = "a quick run"  # does not replace a full run
UNITS = {  # of columns; SI means m and m/s, or rad and rad/s
    **dict.fromkeys(("rtol", "final", "rms", "largest", "beside_dry", "asymmetry", "integration"), "1"),
    **dict.fromkeys(("seconds", "events", "period"), "s"),
    "atol": "SI",
    "creep": "m/s",
}
EXCHANGE_HEADING = "model exchange by fmpy's CVode: largest error at rtol [1]"
EXCHANGE_TABLE = "Model exchange with fmpy's CVode"


@dataclass(frozen=True)
class PrecisionSurvey:
    """All results, with one recommendation per study, and messages on missing results."""

    studies: tuple[Study, ...]
    deviations: tuple[law_deviations.LawDeviation, ...]
    advice: tuple[str, ...]
    missing: tuple[str, ...]


def run_survey(
    models: Sequence[str], extent: SweepSettings, out: Path, report: Callable[[str, float], None]
) -> PrecisionSurvey:
    """Study the models and write the results to out/precision/<model>; a full run replaces a quick one."""
    files = list(map(find_fmu, models))
    with ExitStack() as stack:
        folders = []
        for file in files:
            load_model_class(file)
            folder = out / FOLDER / file.stem
            replaced_source = QUICK_RUN if extent == QUICK else load_provenance(folder).get("source", "")
            folders.append(stack.enter_context(replace_folder(folder, FILES, replaced_source)))
        survey_result = run_studies(models, extent, report)
        for study, sentence, file, folder in zip(
            survey_result.studies, survey_result.advice, files, folders, strict=True
        ):
            write_study(study, survey_result.deviations, sentence, file, folder, extent)
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
            law_deviations.compare_bristles(name, law, load_more_model(name))
            for name, law in law_deviations.BRISTLES.items()
        ]
    advice = tuple(
        recommend(item, [law for law in deviations if law.model == item.model], extent.min_ratio) for item in studies
    )
    missing_peers = (
        f"{peer} was skipped: {package} is not installed: {install_command('peers')}"
        for peer, package in missing_packages().items()
    )
    return PrecisionSurvey(
        studies,
        tuple(deviations),
        advice,
        (*map(count_failures, studies), *failure_reasons(studies), *missing_peers),
    )


def count_failures(study: Study) -> str:
    """Return a sentence on the number of failed runs."""
    failed = sum(bool(point.failure) for point in study.points)
    return f"{study.model}: {failed} of {len(study.points)} runs failed; see {study.model}/points.csv"


def failure_reasons(studies: Iterable[Study]) -> Iterable[str]:
    """Return the error messages of failed runs without tolerance."""
    return dict.fromkeys(p.failure for study in studies for p in study.points if p.failure and isnan(p.rtol))


def write_study(
    study: Study,
    deviations: Iterable[law_deviations.LawDeviation],
    sentence: str,
    file: Path,
    folder: Path,
    extent: SweepSettings,
) -> None:
    """Write tables, figure, provenance and summary of a study of the FMU in `file`, with its recommendation."""
    from .figure import draw

    write_table(folder / "points.csv", csv_headings(Point), map(astuple, study.points))
    exchange: tuple[SummaryTable, ...] = ()
    if exchange_errors := study.exchange_errors():
        headings = [EXCHANGE_HEADING, *(f"{case} [1]" for case in next(iter(exchange_errors.values())))]
        rows = [[rtol, *errors.values()] for rtol, errors in exchange_errors.items()]
        write_table(folder / "model-exchange.csv", headings, rows)
        exchange = make_table(headings, ([f"{number:.4g}" for number in row] for row in rows), EXCHANGE_TABLE)
    laws = {study.model, *(law_deviations.BRISTLES if study.model == "stickslip" else ())}
    model_deviations = [law for law in deviations if law.model in laws]
    if model_deviations:
        headings = csv_headings(law_deviations.LawDeviation)
        write_table(folder / "laws.csv", headings, map(astuple, model_deviations))
    draw(study, model_deviations, folder / "figure.svg")
    values = {case.name: case.run.values for case in study.cases}
    source = QUICK_RUN if extent == QUICK else ""
    write_provenance(folder, [file], declared_parameters(file), values, source=source)
    choices, outcome = tabulate_choices(study, extent.min_ratio)
    command = f"friction-fmus build {study.model} --fmi 3 && friction-fmus precision {study.model}"
    is_incomplete = not exchange and study.model in MODELS
    write_summary(
        folder,
        Summary(
            "precision",
            study.model,
            split_clauses(sentence.removeprefix(f"{study.model}: ")),
            exchange + choices,
            f"{study.model}: run time and right-hand side evaluations over the largest error, by method",
            outcome,
            missing=(MissingResult(f"{study.model} in model exchange", command),) if is_incomplete else (),
        ),
    )


def split_clauses(text: str) -> tuple[str, ...]:
    """Split a recommendation at its semicolons, except those in parentheses, into sentences.

    >>> split_clauses("use exact (1e-15; ode45 2 times); no more.")
    ('Use exact (1e-15; ode45 2 times).', 'No more.')
    """
    clauses = re.split(r"; (?![^()]*\))", text.rstrip("."))
    return tuple(f"{clause[:1].upper()}{clause[1:]}." for clause in clauses if clause)


def csv_headings(kind: type) -> list[str]:
    """Return the field names of a dataclass with their units."""
    return [column_heading(field.name, UNITS.get(field.name, "")) for field in fields(kind)]


def write_table(path: Path, headings: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV file; None and NaN are empty cells."""
    write_csv_rows(path, headings, ([None if value != value else value for value in row] for row in rows))
