"""Drag sled with LuGre friction."""

from fmus import Input, Model, Output, Parameter, State, exp, fabs


class Lugre(Model):
    """Drag sled with LuGre friction: the bristles of the contact deflect by z.

        m a = F_ext + k (x_driver - x) - F_friction,   d(x_driver)/dt = v_driver
        F_friction = s_0 z + s_1 u + s_2 v,   u = dz/dt = v - s_0 |v| z/(f_d + (f_s - f_d) exp(-(v/v_s)^2))

    C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, A new model for control of systems with friction,
    IEEE Trans. Automatic Control 40 (1995) 419-425.
    """

    m = Parameter(12.5, "kg", "mass of the sled", above=0.0)
    k = Parameter(742.5, "N/m", "stiffness of the spring", low=0.0)
    f_s = Parameter(110.34, "N", "friction force at rest", above=0.0)
    f_d = Parameter(73.56, "N", "friction force at high speed", above=0.0)
    s_0 = Parameter(1e4, "N/m", "stiffness of the bristles", above=0.0)
    s_1 = Parameter(300.0, "N.s/m", "damping of the bristles", low=0.0)
    s_2 = Parameter(0.4, "N.s/m", "viscous friction", low=0.0)
    v_s = Parameter(0.01, "m/s", "speed at which friction has come down most of the way", above=0.0)
    v_driver = Parameter(0.034, "m/s", "speed of the driver")
    F_ext = Input(0.0, "N", "outer force on the sled")

    x = State("m", "position of the sled")
    v = State("m/s", "speed of the sled", rate_of=x, nominal_velocity=v_s)
    z = State("m", "deflection of the bristles")
    x_driver = State("m", "position of the driver, zero at the start", rate=v_driver)

    ratio = v / v_s
    curve = f_d + (f_s - f_d) * exp(-ratio * ratio)
    stretch = x_driver - x
    u = Output("m/s", "speed of the bristles", v - s_0 * fabs(v) * z / curve, rate_of=z)
    F_spring = Output("N", "force of the spring on the sled", k * stretch)
    F_friction = Output("N", "force of friction, against the motion", s_0 * z + s_1 * u + s_2 * v)
    a = Output("m/s2", "acceleration of the sled", (F_ext + F_spring - F_friction) / m, rate_of=v)

    stop_time, step_size, method = 16.0, 0.016, "rodas"
