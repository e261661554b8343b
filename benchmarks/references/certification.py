"""Certified results of the shipped models: those of generation.py, and of event_located.py for fmus/more."""

from harness.references.certification import CertifiedFile, certify_default_run, write_references
from harness.references.certified_reference import FOLDER
from harness.references.models import CASES
from harness.running.embedded_model import load_model_class
from harness.running.solution import Solution
from harness.scenes.fmu_files import find_fmu

from .event_located import PROBLEMS, certify_by_two_routes
from .generation import generate_reference


def certify_shipped(name: str) -> list[CertifiedFile]:
    """Write the certified results of all laws of a shipped model, whose FMU is built, next to its file.

    Raises
    ------
    HarnessError
        If no model has this name, its FMU is not built, or its two methods disagree.
    """
    fmu = find_fmu(name)
    model = load_model_class(fmu)
    file = next(folder / f"{name}.py" for folder in (FOLDER, FOLDER / "more") if (folder / f"{name}.py").is_file())
    references = generate_all(name) or {name: certify_default_run(model, file)}
    return write_references(references, model, file.parent)


def generate_all(name: str) -> dict[str, Solution]:
    """Return the references of all laws of a shipped model by their names; none without a second formulation."""
    if name in PROBLEMS:
        return {name: certify_by_two_routes(name)}
    cases = {case.reference_source: case for case in CASES if case.model == name}
    return {str(source): generate_reference(case) for source, case in cases.items()}
