"""Spring and mass with Coulomb friction."""

from fmus import HYBRID, SIGN, Contact, Fixed, Input, Mode, Model, Output, Parameter, State


class Coulomb(Model):
    """Spring and mass with Coulomb friction, with an optional viscous damper.

        m a = F_ext - k x - c v - F_friction
        sliding:   F_friction = f sign(v)
        stuck:     v = 0 while |F_ext - k x| <= f

    L. Meirovitch, Fundamentals of Vibrations, chapter 2.
    """

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(157.9, "N/m", "spring stiffness", low=0.0)
    c = Parameter(0.0, "N.s/m", "damping constant", low=0.0)
    f = Parameter(0.5, "N", "friction force", low=0.0)
    x0 = Fixed(0.1, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    F_ext = Input(0.0, "N", "external force on the mass")

    x = State("m", "position of the mass", start=x0)
    v = State("m/s", "speed of the mass", start=v0, rate_of=x)
    mode = Mode()

    F_spring = Output("N", "spring force on the mass", -k * x)
    F_friction = Contact("N", "friction force, opposing the motion", mode=mode, slip=v, slide=f, laws=(HYBRID, SIGN))
    a = Output("m/s2", "acceleration of the mass", (F_ext + F_spring - c * v - F_friction) / m, rate_of=v)
    energy = Output("J", "kinetic and potential energy", 0.5 * (m * v * v - F_spring * x), low=0.0)
