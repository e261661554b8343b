"""Block on a belt, a model as users write it."""

from fmus import Contact, Fixed, Input, Mode, Model, Output, Parameter, State, fabs


class Block(Model):
    """Block on a belt in the frame of the belt, where it sticks at zero speed: x = (absolute position) - belt t.

        m a = F_ext - k (x + belt t) - F_friction
        sliding:   F_friction = F_s sign(v)/(1 + fall |v|)
        stuck:     v = 0 while |F_ext - k (x + belt t)| <= F_s

    R. I. Leine, Bifurcations in Discontinuous Mechanical Systems of Filippov-Type, 2000.
    """

    m = Parameter(1.0, "kg", "mass of the block", above=0.0)
    k = Parameter(1.0, "N/m", "stiffness of the spring", low=0.0)
    F_s = Parameter(1.0, "N", "static friction", low=0.0)
    fall = Parameter(3.0, "s/m", "decrease of friction with speed", low=0.0)
    belt = Parameter(0.2, "m/s", "speed of the belt")
    x0 = Fixed(1.067, "m", "position at the start")
    v0 = Fixed(-0.2, "m/s", "speed at the start")
    F_ext = Input(0.0, "N", "outer force on the block")

    x = State("m", "position of the block relative to the belt", start=x0)
    v = State("m/s", "speed of the block relative to the belt", start=v0, rate_of=x)
    travel = State("m", "displacement of the belt", rate=belt)
    mode = Mode()

    F_friction = Contact(
        "N", "friction force, opposing the motion", mode=mode, slip=v, slide=F_s / (1.0 + fall * fabs(v)), hold=F_s
    )
    a = Output("m/s2", "acceleration of the block", (F_ext - k * (x + travel) - F_friction) / m, rate_of=v)

    stop_time = 50.0
    step_size = 0.05
