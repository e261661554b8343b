"""A body that is driven away from its equilibrium."""

from fmus import Contact, Fixed, Input, Mode, Model, Output, Parameter, State


class UnstableBody(Model):
    """Body with dry friction, and with a stiffness and a damping of any sign.

    m a = F_ext - k x - c v - F_friction
    """

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(-40.0, "N/m", "stiffness")
    c = Parameter(-0.2, "N.s/m", "damping")
    f_d = Parameter(0.5, "N", "sliding friction", low=0.0)
    f_s = Parameter(0.8, "N", "static friction", low=0.0)
    x0 = Fixed(0.1, "m", "position at the start")
    v0 = Fixed(-0.5, "m/s", "speed at the start")
    F_ext = Input(0.0, "N", "external force")

    x = State("m", "position", start=x0)
    v = State("m/s", "speed", start=v0, rate_of=x)
    mode = Mode()

    F_friction = Contact("N", "friction force", mode=mode, slip=v, slide=f_d, hold=f_s)
    a = Output("m/s2", "acceleration", (F_ext - k * x - c * v - F_friction) / m, rate_of=v)

    stop_time = 2.0
