"""Sled pulled through a spring, with friction that falls with speed."""

from fmus import Contact, Input, Mode, Model, Output, Parameter, Rule, State, exp, fabs


class StribeckSled(Model):
    """Sled pulled through a spring. Friction falls from f_s at rest to f_d at high speed.

    m a = F_ext + k (x_driver - x) - F_friction
    sliding:   F_friction = (f_d + (f_s - f_d) exp(-|v|/v_s)) sign(v)
    """

    m = Parameter(12.5, "kg", "mass of the sled", above=0.0)
    k = Parameter(742.5, "N/m", "stiffness of the spring", low=0.0)
    f_s = Parameter(110.0, "N", "friction at rest", low=0.0)
    f_d = Parameter(70.0, "N", "friction at high speed", low=0.0)
    v_s = Parameter(0.1, "m/s", "speed over which friction falls", above=0.0)
    v_driver = Parameter(0.034, "m/s", "speed of the driver")
    F_ext = Input(0.0, "N", "outer force")

    x = State("m", "position of the sled")
    v = State("m/s", "speed of the sled", rate_of=x)
    x_driver = State("m", "position of the driver, zero at the start", rate=v_driver)
    mode = Mode()

    curve = f_d + (f_s - f_d) * exp(-fabs(v) / v_s)
    F_spring = Output("N", "force of the spring", k * (x_driver - x))
    F_friction = Contact("N", "friction force, opposing the motion", mode=mode, slip=v, slide=curve, hold=f_s)
    a = Output("m/s2", "acceleration", (F_ext + F_spring - F_friction) / m, rate_of=v)

    stop_time = 16.0
    rules = Rule(f_d > f_s, "f_d is {f_d!r}, above f_s = {f_s!r}: lower f_d or raise f_s")
