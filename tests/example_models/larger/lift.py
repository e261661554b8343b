"""Sled that the driver lifts while pulling."""

from fmus import Contact, Input, Mode, Model, Output, Parameter, State


class Lift(Model):
    """Sled that the driver lifts while pulling: while it sticks, the static limit falls and the load rises.

    m a = F_ext + k s - F_friction,   N = m g - lift s,   s = x_driver - x
    sliding:   F_friction = mu_d N sign(v)
    stuck:     v = 0 while |F_ext + k s| <= mu_s N
    """

    m = Parameter(12.5, "kg", "mass of the sled", above=0.0)
    k = Parameter(742.5, "N/m", "stiffness of the spring", low=0.0)
    lift = Parameter(300.0, "N/m", "force that lifts, over the stretch of the spring", low=0.0)
    mu_s = Parameter(0.9, "1", "coefficient of static friction", low=0.0)
    mu_d = Parameter(0.6, "1", "coefficient of sliding friction", low=0.0)
    g = Parameter(9.81, "m/s2", "gravity", low=0.0)
    v_driver = Parameter(0.034, "m/s", "speed of the driver")
    F_ext = Input(0.0, "N", "outer force on the sled")

    x = State("m", "position of the sled")
    v = State("m/s", "speed of the sled", rate_of=x)
    x_driver = State("m", "position of the driver", rate=v_driver)
    mode = Mode()

    stretch = x_driver - x
    N = Output("N", "normal force of the ground", m * g - lift * stretch)
    F_spring = Output("N", "force of the spring on the sled", k * stretch)
    F_friction = Contact("N", "friction, against the motion", mode=mode, slip=v, slide=mu_d * N, hold=mu_s * N)
    a = Output("m/s2", "acceleration of the sled", (F_ext + F_spring - F_friction) / m, rate_of=v)

    stop_time, step_size = 16.0, 0.016
