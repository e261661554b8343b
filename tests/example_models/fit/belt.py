"""Block on a moving belt."""

from fmus import Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State, exp


class Belt(Model):
    """Block on a moving belt, held by a spring and a damper: it rides along, then slips back.

    m a = F_ext - k x - c v - F_friction,   slip = v - v_belt
    sliding:   F_friction = (f_d + (f_s - f_d) exp(-(slip/v_s)^2)) sign(slip)
    stuck:     slip = 0 while |F_ext - k x - c v| <= f_s

    B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and compensation methods
    for the control of machines with friction, Automatica 30 (1994) 1083-1138.
    """

    m = Parameter(1.0, "kg", "mass of the block", above=0.0)
    k = Parameter(100.0, "N/m", "stiffness of the spring", low=0.0)
    c = Parameter(0.2, "N.s/m", "damping constant", low=0.0)
    f_s = Parameter(8.0, "N", "friction force at rest", low=0.0)
    f_d = Parameter(5.0, "N", "friction force at high slip", low=0.0)
    v_s = Parameter(0.1, "m/s", "slip at which friction has come down most of the way", above=0.0)
    v_belt = Parameter(0.1, "m/s", "speed of the belt")
    x0 = Fixed(0.0, "m", "position at the start")
    v0 = Fixed(0.0, "m/s", "speed at the start")
    F_ext = Input(0.0, "N", "outer force on the block")

    x = State("m", "position of the block", start=x0)
    v = State("m/s", "speed of the block", start=v0, rate_of=x)
    mode = Mode()

    slip = v - v_belt
    ratio = slip / v_s
    curve = f_d + (f_s - f_d) * exp(-ratio * ratio)
    F_spring = Output("N", "force of the spring on the block", -k * x)
    F_friction = Contact("N", "friction on the block, against its slip", mode=mode, slip=slip, slide=curve, hold=f_s)
    a = Output("m/s2", "acceleration of the block", (F_ext + F_spring - c * v - F_friction) / m, rate_of=v)
    energy = Output("J", "kinetic and potential energy", 0.5 * (m * v * v - F_spring * x), low=0.0)

    stop_time, step_size = 10.0, 0.01
    rules = Rule(f_d > f_s, "f_d is {f_d!r}, above f_s = {f_s!r}: lower f_d or raise f_s")
