"""Independent solutions for a block on a moving belt, whose motion is a function of time: scipy with events."""

import numpy as np
from scipy.integrate import solve_ivp

BLOCK = '''\
from fmus import Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State


class Block(Model):
    """Block on a belt whose motion other FMUs prescribe, held by a spring."""

    m = Parameter(2.0, "kg", "mass", above=0.0)
    k = Parameter(10.0, "N/m", "stiffness of the spring", low=0.0)
    f_s = Parameter(6.0, "N", "static friction", low=0.0)
    f_d = Parameter(4.0, "N", "sliding friction", low=0.0)
    v0 = Fixed(0.0, "m/s", "initial speed")
    a_belt = Input(0.0, "m/s2", "acceleration of the belt")
    v_belt = Input(0.0, "m/s", "speed of the belt", rate=a_belt)
    x_belt = Input(0.0, "m", "position of the belt", rate=v_belt)

    x = State("m", "position")
    v = State("m/s", "speed", start=v0, rate_of=x)
    mode = Mode()
    lag = Output("m", "lag behind the belt", x_belt - x)
    F_friction = Contact("N", "friction force", mode=mode, slip=v - v_belt, slide=f_d, hold=f_s)
    a = Output("m/s2", "acceleration", (-k * x - F_friction) / m, rate_of=v)
    rules = Rule(f_d > f_s, "f_d = {f_d!r} is above f_s = {f_s!r}")
'''


def belt_rising(t):
    """Return position, speed, acceleration and further derivatives of a belt that speeds up."""
    return 0.2 * t + 0.05 * t * t, 0.2 + 0.1 * t, 0.1, 0.0, 0.0


def belt_shaking(t):
    """Return the same for a belt that goes to and fro."""
    s, c = np.sin(1.7 * t), np.cos(1.7 * t)
    return 0.6 * s, 1.02 * c, -1.734 * s, -2.9478 * c, 5.01126 * s


def solve_block(belt, stop, m=2.0, k=10.0, hold=6.0, slide=4.0):
    """Return the events (time and mode after it) and a function of time for position and speed.

    The block starts at rest relative to the belt.
    """
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "max_step": 0.05}
    t, y, mode = 0.0, np.array([0.0, belt(0.0)[1]]), 0
    events, pieces = [], []

    def load(t, x):
        return -k * x - m * belt(t)[2]

    while t < stop:
        if mode == 0:
            y[1] = belt(t)[1]

            def rates(t, y):
                return [belt(t)[1], belt(t)[2]]

            def end(t, y):
                return hold - abs(load(t, y[0]))

        else:

            def rates(t, y, mode=mode):
                return [y[1], (-k * y[0] - mode * slide) / m]

            def end(t, y, mode=mode, begin=t):
                slip = mode * (y[1] - belt(t)[1])
                return slip if t > begin else 1.0

        end.terminal, end.direction = True, -1
        if mode == 0 and end(t, y) < 0.0:  # sticks no longer than an instant
            solution = None
        else:
            solution = solve_ivp(rates, (t, stop), y, events=end, dense_output=True, **options)
            pieces.append(solution)
            t, y = solution.t[-1], solution.y[:, -1].copy()
            if solution.status != 1:
                break
        mode = int(np.sign(load(t, y[0]))) if mode == 0 else 0
        if mode == 0:
            y[1] = belt(t)[1]
            if abs(load(t, y[0])) > hold:
                mode = int(np.sign(load(t, y[0])))
        events.append((t, mode))

    def motion(t):
        piece = next(piece for piece in pieces if t <= piece.t[-1] or piece is pieces[-1])
        return piece.sol(t)

    return events, motion
