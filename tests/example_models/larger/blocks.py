"""A block on a block."""

from fmus import Contact, Input, Mode, Model, Output, Parameter, State


class Blocks(Model):
    """A block on a block on the ground; the driver pulls the upper one, and both contacts act on the lower one.

    m1 a1 = F_ext - c x1 + F2 - F1,   m2 a2 = k (x_driver - x2) - F2,   slip1 = v1,   slip2 = v2 - v1
    sliding:   F1 = mu1 (m1 + m2) g sign(slip1),   F2 = mu2 m2 g sign(slip2)
    stuck:     the force required by both bodies, up to `stick` times the sliding force
    """

    m1 = Parameter(4.0, "kg", "mass of the lower block", above=0.0)
    m2 = Parameter(2.0, "kg", "mass of the upper block", above=0.0)
    k = Parameter(400.0, "N/m", "stiffness of the spring of the driver", low=0.0)
    c = Parameter(150.0, "N/m", "stiffness of the spring of the lower block", low=0.0)
    mu1 = Parameter(0.15, "1", "sliding friction of the lower block", low=0.0)
    mu2 = Parameter(0.5, "1", "sliding friction of the upper block", low=0.0)
    stick = Parameter(1.4, "1", "static over sliding friction", low=1.0)
    g = Parameter(9.81, "m/s2", "gravity", low=0.0)
    v_driver = Parameter(0.2, "m/s", "speed of the driver")
    F_ext = Input(0.0, "N", "outer force on the lower block")

    x1 = State("m", "position of the lower block")
    v1 = State("m/s", "speed of the lower block", rate_of=x1)
    x2 = State("m", "position of the upper block")
    v2 = State("m/s", "speed of the upper block", rate_of=x2)
    x_driver = State("m", "position of the driver", rate=v_driver)
    mode1, mode2 = Mode(), Mode()

    n1 = mu1 * (m1 + m2) * g
    n2 = mu2 * m2 * g
    F_spring = Output("N", "force of the spring of the driver", k * (x_driver - x2))
    F_back = Output("N", "force of the spring of the lower block", -c * x1)
    F1 = Contact("N", "friction on the ground", mode=mode1, slip=v1, slide=n1, hold=stick * n1)
    F2 = Contact("N", "friction between the blocks", mode=mode2, slip=v2 - v1, slide=n2, hold=stick * n2)
    a1 = Output("m/s2", "acceleration of the lower block", (F_ext + F_back + F2 - F1) / m1, rate_of=v1)
    a2 = Output("m/s2", "acceleration of the upper block", (F_spring - F2) / m2, rate_of=v2)

    stop_time, step_size = 8.0, 0.008
