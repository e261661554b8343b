"""Solution of the pendulum by Taylor series in 25 digits, from one turning point to the next."""

from collections.abc import Callable

import numpy as np
from mpmath import cos, findroot, mpf, odefun, sign, sin, sqrt, workdps

from harness.references.models.pendulum import PendulumProblem, PendulumReactionProblem
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
