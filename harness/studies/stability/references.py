"""References of the stability study, computed in a worker process."""

from typing import Any

from ...errors import HarnessError
from ...references.certification import compute_by_two_methods
from ...references.models import MODELS
from ...references.reference_trajectory import CommunicationGrid, compute_reference
from ...references.segments import ParameterSpan
from ...scenes.fmu_files import find_fmu
from ...simulation.embedded_model import load_model_class
from ...simulation.solution import Solution


def solve_reference(model: str, spans: list[ParameterSpan], grid: CommunicationGrid) -> Solution:
    """Return the reference of a model, or the result of two methods of a user model."""
    solve = compute_reference if model in MODELS else compute_by_two_methods
    return solve(model, spans, grid)


def find_modes(model: str) -> list[str]:
    """Return the modes of a model; HarnessError if it has no position with a speed."""
    model_class: Any = load_model_class(find_fmu(model))
    if not {*model_class.states} & {*model_class.states.values()}:
        raise HarnessError(f"{model}: no state is the rate of another one; the cases need a position and a speed")
    return list(model_class.contacts)
