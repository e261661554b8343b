"""Block on a moving belt."""

from fmus import Choice, Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State, exp, fabs


class Belt(Model):
    """Block on a moving belt, held by a spring and a damper: it rides along, then slips back.

        m a = F_ext - k x - c v - F_friction,   slip = v - v_belt
        sliding:   F_friction = F(slip) sign(slip)
        stuck:     slip = 0 while |F_ext - k x - c v| <= F_s
        law hyperbola:   F(slip) = F_s/(1 + delta |slip|)
        law stribeck:    F(slip) = F_c + (F_s - F_c) exp(-(slip/v_s)^2) + b |slip|
        law coulomb:     F(slip) = F_c

    R. I. Leine, D. H. van Campen, A. de Kraker, L. van den Steen, Stick-slip vibrations induced by alternate friction
    models, Nonlinear Dynamics 16 (1998) 41-54 (hyperbola, and the default values).
    B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit, A survey of models, analysis tools and compensation methods
    for the control of machines with friction, Automatica 30 (1994) 1083-1138 (Stribeck curve).
    """

    m = Parameter(1.0, "kg", "mass of the block", above=0.0)
    k = Parameter(1.0, "N/m", "stiffness of the spring", low=0.0)
    c = Parameter(0.0, "N.s/m", "damping constant", low=0.0)
    law = Choice(
        "friction over the slip",
        hyperbola="falls as 1/(1 + delta |slip|)",
        stribeck="falls from F_s to F_c and rises with the slip",
        coulomb="constant",
    )
    F_s = Parameter(1.0, "N", "static friction", low=0.0)
    F_c = Parameter(0.7, "N", "Coulomb friction; laws stribeck and coulomb", low=0.0)
    delta = Parameter(3.0, "s/m", "decrease of friction with the slip; law hyperbola", low=0.0)
    v_s = Parameter(0.1, "m/s", "Stribeck speed; law stribeck", above=0.0)
    b = Parameter(0.05, "N.s/m", "viscous friction; law stribeck", low=0.0)
    v_belt = Parameter(0.2, "m/s", "speed of the belt")
    x0 = Fixed(1.067, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    F_ext = Input(0.0, "N", "external force on the block")

    x = State("m", "position of the block", start=x0)
    v = State("m/s", "speed of the block", start=v0, rate_of=x)
    mode = Mode()

    slip = v - v_belt
    ratio = slip / v_s
    sliding = law.choose(
        hyperbola=F_s / (1.0 + delta * fabs(slip)),
        stribeck=F_c + (F_s - F_c) * exp(-ratio * ratio) + b * fabs(slip),
        coulomb=F_c,
    )
    F_spring = Output("N", "spring force on the block", -k * x)
    F_friction = Contact("N", "friction force, opposing the slip", mode=mode, slip=slip, slide=sliding, hold=F_s)
    a = Output("m/s2", "acceleration of the block", (F_ext + F_spring - c * v - F_friction) / m, rate_of=v)
    energy = Output("J", "kinetic and potential energy", 0.5 * (m * v * v - F_spring * x), low=0.0)

    stop_time, step_size = 50.0, 0.05
    rules = Rule(F_c > F_s, "F_c is {F_c!r}, above F_s = {F_s!r}: lower F_c or raise F_s")
