"""Spring and damper between two flanges."""

from fmus import Fixed, Input, Model, Output, Parameter, State


class Spring(Model):
    """Spring and damper between two flanges, to couple FMUs: speeds are inputs, forces are outputs.

    F_a = k (x_b - x_a) + c (v_b - v_a) = -F_b,   d(x_a)/dt = v_a,   d(x_b)/dt = v_b
    """

    k = Parameter(40.0, "N/m", "stiffness of the spring", low=0.0)
    c = Parameter(0.0, "N.s/m", "damping constant", low=0.0)
    x0_a = Fixed(0.0, "m", "initial position of flange a")
    x0_b = Fixed(0.0, "m", "initial position of flange b")
    v_a = Input(0.0, "m/s", "speed of flange a")
    v_b = Input(0.0, "m/s", "speed of flange b")

    x_a = State("m", "position of flange a", start=x0_a)
    x_b = State("m", "position of flange b", start=x0_b)
    rate_a = Output("m/s", "rate of the position of flange a", v_a, rate_of=x_a)
    rate_b = Output("m/s", "rate of the position of flange b", v_b, rate_of=x_b)
    F_a = Output("N", "force on flange a", k * (x_b - x_a) + c * (v_b - v_a))
    F_b = Output("N", "force on flange b", k * (x_a - x_b) + c * (v_a - v_b))

    stop_time = 1.0
