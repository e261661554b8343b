"""Child process of the stability study: it runs cases and computes their references."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...errors import HarnessError
from ...process.child_process import RequestServer
from ...references.certification import compute_by_two_methods
from ...references.models import MODELS
from ...references.reference_trajectory import CommunicationGrid, compute_reference
from ...running.embedded_model import load_model_class
from ...running.solution import Solution
from ...running.step_sequence import inject_nonfinite, run_steps
from ...scenes.fmu_files import find_fmu
from ...scenes.run_spec import RunSpec


def read_run(run: dict[str, Any]) -> RunSpec:
    """Return the run of a case, whose start and stop may be invalid."""
    return RunSpec(Path(run["fmu"]), values=run["values"], start=run["start"], stop=run["stop"])


def solve_reference(model: str, spans: list[Any], grid: dict[str, Any]) -> Solution:
    """Return the reference of a model, or the result of two methods of a user model."""
    solve = compute_reference if model in MODELS else compute_by_two_methods
    return solve(model, spans, CommunicationGrid(**grid))


def find_modes(model: str) -> list[str]:
    """Return the modes of a model; HarnessError if it has no position with a speed."""
    model_class: Any = load_model_class(find_fmu(model))
    if not {*model_class.states} & {*model_class.states.values()}:
        raise HarnessError(f"{model}: no state is the rate of another one; the cases need a position and a speed")
    return list(model_class.contacts)


HANDLERS: dict[str, Callable[..., Any]] = {
    "modes": find_modes,
    "reference": solve_reference,
    "steps": lambda run, calls, changes: run_steps(read_run(run), calls, dict(changes)),
    "nonfinite": lambda run: inject_nonfinite(read_run(run)),
}


if __name__ == "__main__":
    RequestServer().serve(lambda request: HANDLERS[request[0]](**request[1]))
