"""Makes the references of the laws that are written a second time, in some minutes; it shares no code with the FMUs.

piecewise linear laws   closed form in 40 digits; the tests hold a second one against it
pendulum                Taylor series in 25 digits, and DOP853 restarted at every change of mode
magic formula           DOP853, which is explicit, and Radau, which is implicit
"""

from collections.abc import Callable, Iterator

import numpy as np

from ..running.solution import Solution
from .certified_reference import POINTS, CertifiedReference, ReferenceCase, event_time_error, max_relative_difference
from .models import MODEL_MODULES
from .models.pendulum import Pendulum
from .ode_problem import OdeProblem
from .peer_solvers import solve
from .pendulum_series import solve_pendulum
from .reference_trajectory import mode_changes, sample_segments
from .segments import Segment

CLOSED_FORMS: dict[str, Callable[[float], Iterator[Segment]]] = {  # up to a stop in s
    name: form for each in MODEL_MODULES.values() for name, form in getattr(each, "CLOSED_FORMS", {}).items()
}
ROUNDING = 2.0**-53  # of a number stored as a double
NOTHING = 1e-40  # what 120 digits leave of a zero is less


def generate_reference(case: ReferenceCase) -> CertifiedReference:
    """The motion under one of the laws that are written a second time."""
    problem, name = case.problem, case.reference_source
    assert isinstance(name, str)
    times = np.linspace(0.0, problem.stop, POINTS)
    answer, how, apart = solve_independently(name, problem, times)
    start = [(0.0, problem.resolve_mode(0.0, *problem.start))] if problem.has_dry_friction else []
    return CertifiedReference(times, answer.states, start + (answer.events or []), how, apart)


def solve_independently(name: str, problem: OdeProblem, times: np.ndarray) -> tuple[Solution, str, float]:
    """The motion, the routes that led to it, and their largest difference relative to the largest of each column."""
    if name in CLOSED_FORMS:
        return evaluate_closed_form(name, times), "closed form in 40 digits", ROUNDING
    explicit = solve("scipy", "DOP853", problem, times, 3e-14, 1e-16)  # as far down as it goes
    if isinstance(problem, Pendulum):
        answer = solve_pendulum(problem, times.tolist())
        apart = max(
            max_relative_difference(answer, explicit),
            event_time_error(answer.events or [], explicit.events or []) / times[-1],
        )
        return answer, "Taylor series in 25 digits and DOP853", apart
    implicit = solve("scipy", "Radau", problem, times, 1e-11, 1e-14)
    return explicit, "DOP853 and Radau", max_relative_difference(explicit, implicit)


def evaluate_closed_form(name: str, times: np.ndarray) -> Solution:
    """The doubles next to the closed form; what changes after the last of the times is left out."""
    found = list(CLOSED_FORMS[name](float(times[-1])))
    motion = sample_segments(found, times.tolist())
    motion[np.abs(motion) < NOTHING] = 0.0
    events = [(t, mode) for t, mode in mode_changes(found) if t <= times[-1]]
    return Solution(motion, events, 0)
