"""Slider on a crank that a driver turns through a torsion spring."""

from fmus import Contact, Input, Mode, Model, Output, Parameter, Rule, State, cos


class Crank(Model):
    """Crank whose slider rubs on its guide: it sticks and slips, and passes dead points, where friction has no lever.

    J dw/dt = M_ext + k (p - q) - F_friction r cos(q),   slip = r cos(q) w,   dp/dt = Omega
    """

    J = Parameter(0.05, "kg.m2", "moment of inertia", above=0.0)
    k = Parameter(2.0, "N.m/rad", "stiffness of the torsion spring", low=0.0)
    r = Parameter(0.1, "m", "radius of the crank", above=0.0)
    f_s = Parameter(30.0, "N", "static friction", low=0.0)
    f_d = Parameter(20.0, "N", "sliding friction", low=0.0)
    Omega = Parameter(3.0, "rad/s", "speed of the driver")
    M_ext = Input(0.0, "N.m", "outer torque")

    q = State("rad", "angle of the crank, from where it is across the guide")
    w = State("rad/s", "speed of the crank", rate_of=q)
    p = State("rad", "angle of the driver", rate=Omega)
    mode = Mode()

    lever = r * cos(q)
    M_spring = Output("N.m", "torque of the spring", k * (p - q))
    F_friction = Contact("N", "friction on the slider", mode=mode, slip=lever * w, slide=f_d, hold=f_s)
    dw = Output("rad/s2", "angular acceleration", (M_ext + M_spring - F_friction * lever) / J, rate_of=w)

    stop_time, step_size = 8.0, 0.01
    rules = Rule(f_d > f_s, "f_d is {f_d!r}, above f_s = {f_s!r}: lower f_d or raise f_s")
