"""Certified results of the shipped models: of generation.py, and for fmus/more of event_located.py and plane.py."""

from pathlib import Path

from harness.references.certification import CertifiedFile, certify_default_run, write_references
from harness.references.certified_reference import FOLDER
from harness.references.models import CASES
from harness.scenes.fmu_files import find_fmu
from harness.simulation.embedded_model import load_model_class
from harness.simulation.solution import Solution

from .event_located import PROBLEMS, certify_by_two_routes
from .generation import generate_reference
from .icon import draw_missing_icon
from .plane import CLOSED_FORMS


def certify_shipped(name: str) -> list[CertifiedFile]:
    """Write the certified results of all laws of a shipped model, whose FMU is built, next to its file.

    Raises
    ------
    HarnessError
        If no model has this name, its FMU is not built, or its two methods disagree.
    """
    model = load_model_class(find_fmu(name))
    file = model_file(name)
    references = generate_all(name) or {name: certify_default_run(model, file)}
    return write_references(references, model, file.parent)


def model_file(name: str) -> Path:
    """Return the file of a shipped model."""
    return next(folder / f"{name}.py" for folder in (FOLDER, FOLDER / "more") if (folder / f"{name}.py").is_file())


def missing_parts(name: str) -> list[str]:
    """Draw the icon of a shipped model that has none; return sentences on this and on a missing second formulation."""
    folder, sentences = model_file(name).parent, []
    if icon := draw_missing_icon(name, folder):
        sentences.append(f"{icon}: drawn from the result; a function of docs/make_icons.py draws a better one")
    if folder != FOLDER and name not in PROBLEMS and name not in CLOSED_FORMS:
        sentences.append(
            f"{name} has no second formulation, so two methods of its FMU certify it: add one to "
            "benchmarks/references/event_located.py and repeat the command"
        )
    return sentences


def generate_all(name: str) -> dict[str, Solution]:
    """Return the references of all laws of a shipped model by their names; none without a second formulation."""
    if name in CLOSED_FORMS:
        return {name: CLOSED_FORMS[name]()}
    if name in PROBLEMS:
        return {name: certify_by_two_routes(name)}
    cases = {case.reference_source: case for case in CASES if case.model == name}
    return {str(source): generate_reference(case) for source, case in cases.items()}
