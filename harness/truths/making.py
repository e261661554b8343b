"""Makes the references of the laws that are written a second time, in some minutes; it shares no code with the FMUs.

piecewise linear laws   closed form in 40 digits; the tests hold a second one against it
pendulum                Taylor series in 25 digits, and DOP853 restarted at every change of mode
magic formula           DOP853, which is explicit, and Radau, which is implicit
"""

from collections.abc import Callable, Iterator

import numpy as np

from ..running.solution import Solution
from .models import FOUND
from .models.pendulum import Pendulum
from .peers import solve
from .pieces import Piece
from .problem import Equations
from .reference import POINTS, Case, Reference, difference, late
from .taylor import swings
from .truth import changes, sampled

CLOSED: dict[str, Callable[[float], Iterator[Piece]]] = {  # up to a stop in s
    name: form for each in FOUND.values() for name, form in getattr(each, "CLOSED", {}).items()
}
ROUNDING = 2.0**-53  # of a number stored as a double
NOTHING = 1e-40  # what 120 digits leave of a zero is less


def made(case: Case) -> Reference:
    """The motion under one of the laws that are written a second time."""
    problem, name = case.problem, case.truth
    assert isinstance(name, str)
    times = np.linspace(0.0, problem.stop, POINTS)
    answer, how, apart = routes(name, problem, times)
    start = [(0.0, problem.mode_from(0.0, *problem.start))] if problem.dry else []
    return Reference(times, answer.states, start + (answer.events or []), how, apart)


def routes(name: str, problem: Equations, times: np.ndarray) -> tuple[Solution, str, float]:
    """The motion, the routes that led to it, and their largest difference relative to the largest of each column."""
    if name in CLOSED:
        return closed(name, times), "closed form in 40 digits", ROUNDING
    explicit = solve("scipy", "DOP853", problem, times, 3e-14, 1e-16)  # as far down as it goes
    if isinstance(problem, Pendulum):
        answer = swings(problem, times.tolist())
        apart = max(difference(answer, explicit), late(answer.events or [], explicit.events or []) / times[-1])
        return answer, "Taylor series in 25 digits and DOP853", apart
    implicit = solve("scipy", "Radau", problem, times, 1e-11, 1e-14)
    return explicit, "DOP853 and Radau", difference(explicit, implicit)


def closed(name: str, times: np.ndarray) -> Solution:
    """The doubles next to the closed form; what changes after the last of the times is left out."""
    found = list(CLOSED[name](float(times[-1])))
    motion = sampled(found, times.tolist())
    motion[np.abs(motion) < NOTHING] = 0.0
    events = [(t, mode) for t, mode in changes(found) if t <= times[-1]]
    return Solution(motion, events, 0)
