"""Spring, mass and viscous damper."""

from fmus import Fixed, Input, Model, Output, Parameter, State


class Smd(Model):
    """Spring, mass and viscous damper: the damped linear oscillator.

        m a = F_ext - k x - c v

    L. Meirovitch, Fundamentals of Vibrations, chapter 2.
    """

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(157.9, "N/m", "spring stiffness", low=0.0)
    c = Parameter(2.0, "N.s/m", "damping constant", low=0.0)
    x0 = Fixed(0.1, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    F_ext = Input(0.0, "N", "external force on the mass")

    x = State("m", "position of the mass", start=x0)
    v = State("m/s", "speed of the mass", start=v0, rate_of=x)

    F_spring = Output("N", "spring force on the mass", -k * x)
    F_damper = Output("N", "damper force on the mass", -c * v)
    a = Output("m/s2", "acceleration of the mass", (F_ext + F_spring + F_damper) / m, rate_of=v)
    energy = Output("J", "kinetic and potential energy", 0.5 * (m * v * v - F_spring * x), low=0.0)
