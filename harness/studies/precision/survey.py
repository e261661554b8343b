"""Runs work-precision studies and law deviations, and writes the results."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from math import isnan
from pathlib import Path

from ...errors import install_command
from ...references.models import CASES
from ...references.peer_solvers import missing_packages
from ...results.folder import replace_folder
from ...results.provenance import load_provenance, write_provenance
from ...results.registry import find_study
from ...results.summary import write_summary
from ...scenes.fmu_files import find_fmu
from ...simulation.embedded_model import load_model_class, load_more_model
from ...simulation.fmu_archive import declared_parameters
from . import law_deviations
from .advice import recommend
from .result import PrecisionResult
from .study import QUICK, Study, SweepSettings, study_model

STUDY = find_study("precision")
QUICK_RUN = "a quick run"  # does not replace a full run


@dataclass(frozen=True)
class PrecisionSurvey:
    """All results, with one recommendation per study, and messages on missing results."""

    studies: tuple[Study, ...]
    deviations: tuple[law_deviations.LawDeviation, ...]
    advice: tuple[str, ...]
    missing: tuple[str, ...]

    def deviations_of(self, model: str) -> tuple[law_deviations.LawDeviation, ...]:
        """Return the deviations of the laws of a model; those of bristles belong to stickslip."""
        laws = {model, *(law_deviations.BRISTLES if model == "stickslip" else ())}
        return tuple(law for law in self.deviations if law.model in laws)


def run_survey(
    models: Sequence[str], extent: SweepSettings, out: Path, report: Callable[[str, float], None]
) -> PrecisionSurvey:
    """Study the models and write the results to out/precision/<model>; a full run replaces a quick one."""
    files = list(map(find_fmu, models))
    with ExitStack() as stack:
        folders = []
        for file in files:
            load_model_class(file)
            folder = out / STUDY.name / file.stem
            replaced_source = QUICK_RUN if extent == QUICK else load_provenance(folder).get("source", "")
            folders.append(stack.enter_context(replace_folder(folder, STUDY.files, replaced_source)))
        survey_result = run_studies(models, extent, report)
        for study, sentence, file, folder in zip(
            survey_result.studies, survey_result.advice, files, folders, strict=True
        ):
            deviations = survey_result.deviations_of(study.model)
            write_study(PrecisionResult(study, deviations, sentence, extent.min_ratio), file, folder, extent)
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
    missing = "; ".join((*failure_reasons(studies), *uninstalled_peers()))
    notes = (*filter(None, map(count_failures, studies)), *([f"Not run: {missing}"] if missing else ()))
    return PrecisionSurvey(studies, tuple(deviations), advice, notes)


def uninstalled_peers() -> Iterable[str]:
    """Return which solvers are not installed, and the command that installs them."""
    missing = missing_packages()
    if missing:
        names = ", ".join(f"{package} ({peer})" for peer, package in missing.items())
        yield f"not installed: {names}, {install_command('peers')}"


def count_failures(study: Study) -> str:
    """Return a sentence on the runs that failed, other than those that were not built; empty without any."""
    runs = [point for point in study.points if not (point.failure and isnan(point.rtol))]
    failed = sum(bool(point.failure) for point in runs)
    return f"{study.model}: {failed} of {len(runs)} runs failed; see {study.model}/points.csv" if failed else ""


def failure_reasons(studies: Iterable[Study]) -> Iterable[str]:
    """Return the error messages of failed runs without tolerance."""
    return dict.fromkeys(p.failure for study in studies for p in study.points if p.failure and isnan(p.rtol))


def write_study(result: PrecisionResult, file: Path, folder: Path, extent: SweepSettings) -> None:
    """Write tables, figure, provenance and summary of a study of the FMU in `file`."""
    result.write(folder)
    values = {case.name: case.values for case in result.measured.cases}
    source = QUICK_RUN if extent == QUICK else ""
    write_provenance(folder, [file], declared_parameters(file), values, source=source)
    write_summary(folder, result.summary())
