"""A cart against a bumper, which uses almost every available function."""

from fmus import (
    Choice,
    Fixed,
    Input,
    Model,
    Output,
    Parameter,
    State,
    acos,
    choose,
    cos,
    exp,
    fabs,
    log,
    sinh,
    sqrt,
    tanh,
)


class Bumper(Model):
    """Cart pulled to and fro by a rope, against a bumper with progressive stiffness.

        m a = F - F_drag - F_bumper

    The bumper acts only beyond its gap; the drag is a smooth sign function, or grows as the root of the speed.
    """

    m = Parameter(2.0, "kg", "mass", above=0.0)
    F_0 = Parameter(3.0, "N", "size of the drag", low=0.0)
    u = Parameter(0.05, "m/s", "speed scale of the drag", above=0.0)
    gap = Parameter(0.02, "m", "gap before the bumper", low=0.0)
    s = Parameter(0.01, "m", "length over which the bumper hardens", above=0.0)
    wobble = Parameter(0.4, "1", "share of the drag that wobbles", low=0.0, high=1.0)
    start = Fixed(0.1, "m/s", "speed at the start")
    drag = Choice("law of the drag", smooth="tends to a constant", root="grows as the root of the speed")
    F = Input(8.0, "N", "pull of the rope")

    x = State("m", "position")
    v = State("m/s", "speed", start=start, rate_of=x)

    w = v / u
    smooth = tanh(w) * (1.0 - wobble * cos(w) * exp(-w * w))
    root = choose(v < 0, -sqrt(fabs(w)), sqrt(fabs(w))) + acos(wobble) - acos(wobble)
    F_drag = Output("N", "drag", F_0 * drag.choose(smooth=smooth, root=root))
    press = (x - gap) / s
    F_bumper = Output("N", "push of the bumper", choose(x > gap, F_0 * (sinh(press) + log(1 + press)), 0.0))
    a = Output("m/s2", "acceleration", (F - F_drag - F_bumper) / m, rate_of=v)

    stop_time, step_size, method = 1.0, 0.001, "rodas"
