"""Spring and mass with dry friction under a harmonic force."""

from fmus import Contact, Fixed, Mode, Model, Output, Parameter, State, cos


class Forced(Model):
    """Spring and mass with dry friction under a harmonic force, with an optional viscous damper.

        m a = P cos(angle) - k x - c v - F_friction,   d(angle)/dt = Omega
        sliding:   F_friction = f sign(v)
        stuck:     v = 0 while |P cos(angle) - k x| <= f

    J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Transactions of the ASME 53 (1931),
    APM-53-9, 107-115.
    """

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(100.0, "N/m", "spring stiffness", low=0.0)
    c = Parameter(0.0, "N.s/m", "damping constant", low=0.0)
    f = Parameter(6.0, "N", "friction force", low=0.0)
    P = Parameter(10.0, "N", "amplitude of the force", low=0.0)
    Omega = Parameter(5.0, "rad/s", "angular frequency of the force", low=0.0)
    x0 = Fixed(0.0, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    angle0 = Fixed(0.0, "rad", "initial phase angle of the force", display="deg")

    x = State("m", "position of the mass", start=x0)
    v = State("m/s", "speed of the mass", start=v0, rate_of=x)
    travel = State("rad", "phase angle of the force since the start", rate=Omega, display="deg")
    mode = Mode()

    F = Output("N", "harmonic force on the mass", P * cos(angle0 + travel))
    F_spring = Output("N", "spring force on the mass", -k * x)
    F_friction = Contact("N", "friction force, opposing the motion", mode=mode, slip=v, slide=f)
    a = Output("m/s2", "acceleration of the mass", (F + F_spring - c * v - F_friction) / m, rate_of=v)
    energy = Output("J", "kinetic and potential energy", 0.5 * (m * v * v - F_spring * x), low=0.0)

    stop_time, step_size, method = 10.0, 0.01, "dop853"
