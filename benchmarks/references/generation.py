"""Generation of references of the models with an independent implementation, which takes some minutes.

piecewise linear laws   closed form in 40 digits; the tests compare it with a second one
pendulum                Taylor series in 25 digits, and DOP853 restarted at every change of mode
magic formula           DOP853, which is explicit, and Radau, which is implicit

This module shares no code with the FMUs.

Solution of the pendulum by Taylor series in 25 digits, from one turning point to the next.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from mpmath import cos, findroot, mpf, odefun, sign, sin, sqrt, workdps

from harness.references.certified_reference import POINTS, ReferenceCase, event_time_error, max_relative_difference
from harness.references.models import MODEL_MODULES
from harness.references.models.pendulum import PendulumProblem, PendulumReactionProblem
from harness.references.ode_problem import OdeProblem
from harness.references.peer_solvers import solve
from harness.references.reference_trajectory import mode_changes, sample_segments
from harness.references.segments import Segment
from harness.simulation.solution import Solution

DIGITS = 25
TURNING_POINT_BRACKET = (0.25, 0.45)  # s: around half a period, so that it holds one turning point


def solve_pendulum(problem: PendulumProblem, times: list[float]) -> Solution:
    """Return the motion at rising times in s, and the changes of mode."""
    with workdps(DIGITS):
        weight, arm = mpf(problem.m) * mpf(problem.g), mpf(problem.mu) * mpf(problem.r)
        inertia, a = mpf(problem.inertia), mpf(problem.a)
        moment = mpf(problem.m) * a

        def pin_load(x: mpf, v: mpf, mode: int) -> mpf:
            """Return the load on the pin; N^2 = R^2 + (m g sin(x) + m a alpha)^2, where alpha is linear in N."""
            if not isinstance(problem, PendulumReactionProblem):
                return weight
            radial = weight * cos(x) + moment * v * v
            b, s = weight * sin(x) * (1 - moment * a / inertia), mode * arm * moment / inertia
            return (sqrt((1 - s * s) * radial**2 + b * b) - s * b) / (1 - s * s)

        def half_cycle(mode: int, t: mpf, x: mpf) -> Callable[[mpf], list[mpf]]:
            def rates(_: mpf, y: list[mpf]) -> list[mpf]:
                return [y[1], -(weight * a * sin(y[0]) + mode * arm * pin_load(y[0], y[1], mode)) / inertia]

            return odefun(rates, t, [x, mpf(0)])

        motion: list[tuple[mpf, mpf]] = []
        events: list[tuple[mpf, int]] = []
        t, x = mpf(0), mpf(problem.start[0])
        while weight * a * abs(sin(x)) > arm * weight:
            mode = -int(sign(x))
            if t > 0:
                events.append((t, mode))
            state = half_cycle(mode, t, x)
            bracket = tuple(t + w for w in TURNING_POINT_BRACKET)
            end = findroot(lambda s, state=state: state(s)[1], bracket, solver="anderson")
            motion += [tuple(state(mpf(s))) for s in times if t <= s < end]
            t, x = end, state(end)[0]
        events.append((t, 0))
        motion += [(x, mpf(0)) for s in times if s >= t]
        assert len(motion) == len(times)
        return Solution(np.array(times), np.array(motion, float), [(float(t), mode) for t, mode in events])


CLOSED_FORMS: dict[str, Callable[[float], Iterator[Segment]]] = {  # segments up to a stop in s
    name: form for module in MODEL_MODULES.values() for name, form in getattr(module, "CLOSED_FORMS", {}).items()
}
UNIT_ROUNDOFF = 2.0**-53
ZERO = 1e-40  # a smaller value is a zero with the rounding error of 120 digits


def generate_reference(case: ReferenceCase) -> Solution:
    """Return the reference of a case."""
    problem, name = case.problem, case.reference_source
    assert isinstance(name, str)
    times = np.linspace(0.0, problem.stop, POINTS)
    solution = solve_independently(name, problem, times)
    start_mode = problem.resolve_mode(0.0, *problem.start) if problem.has_dry_friction else None
    return replace(solution, start_mode=start_mode)


def solve_independently(name: str, problem: OdeProblem, times: np.ndarray) -> Solution:
    """Return the solution with the methods used and their largest difference."""
    if name in CLOSED_FORMS:
        return evaluate_closed_form(name, times)
    explicit = solve("scipy", "DOP853", problem, times, 3e-14, 1e-16)  # the smallest tolerance it can meet
    if isinstance(problem, PendulumProblem):
        solution = solve_pendulum(problem, times.tolist())
        event_error = event_time_error(solution.events or [], explicit.events or []) / times[-1]
        difference = max(max_relative_difference(solution, explicit), event_error)
        return replace(solution, method="Taylor series in 25 digits and DOP853", estimated_error=difference)
    implicit = solve("scipy", "Radau", problem, times, 1e-11, 1e-14)
    difference = max_relative_difference(explicit, implicit)
    return replace(explicit, method="DOP853 and Radau", estimated_error=difference)


def evaluate_closed_form(name: str, times: np.ndarray) -> Solution:
    """Return the closed form rounded to doubles at the times (n,) in s, with the changes of mode up to the last one."""
    segments = list(CLOSED_FORMS[name](float(times[-1])))
    motion = sample_segments(segments, times.tolist())
    motion[np.abs(motion) < ZERO] = 0.0
    events = [(t, mode) for t, mode in mode_changes(segments) if t <= times[-1]]
    return Solution(times, motion, events, method="closed form in 40 digits", estimated_error=UNIT_ROUNDOFF)
