"""Mass pulled through a spring, with LuGre friction."""

from fmus import Fixed, Input, Model, Output, Parameter, Rule, State, exp, fabs


class Lugre(Model):
    """Mass pulled through a spring by a driver of constant speed, with LuGre friction: z is the bristle deflection.

        m a = F_ext + k (x_driver - x) - F_friction,   d(x_driver)/dt = v_driver
        F_friction = sigma_0 z + sigma_1 dz/dt + sigma_2 v
        dz/dt = v - sigma_0 |v| z/g(v),   g(v) = F_c + (F_s - F_c) exp(-(v/v_s)^2)

    With sigma_1 = sigma_2 = 0 and F_s = F_c this is Dahl's model.  The default run is the stick-slip motion of the
    article.
    C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, A new model for control of systems with friction, IEEE
    Transactions on Automatic Control 40 (1995) 419-425.
    """

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(2.0, "N/m", "spring stiffness", low=0.0)
    F_s = Parameter(1.5, "N", "static friction", above=0.0)
    F_c = Parameter(1.0, "N", "Coulomb friction", above=0.0)
    v_s = Parameter(0.001, "m/s", "Stribeck speed", above=0.0)
    sigma_0 = Parameter(1e5, "N/m", "stiffness of the bristles", above=0.0)
    sigma_1 = Parameter(1e5**0.5, "N.s/m", "damping of the bristles", low=0.0)
    sigma_2 = Parameter(0.4, "N.s/m", "viscous friction", low=0.0)
    v_driver = Parameter(0.1, "m/s", "speed of the driver")
    x0 = Fixed(0.0, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    z0 = Fixed(0.0, "m", "initial deflection of the bristles")
    F_ext = Input(0.0, "N", "external force on the mass")

    x = State("m", "position of the mass", start=x0)
    v = State("m/s", "speed of the mass", start=v0, rate_of=x, nominal_velocity=v_s)
    z = State("m", "deflection of the bristles", start=z0)
    x_driver = State("m", "position of the driver, zero at the start", rate=v_driver)

    ratio = v / v_s
    g = F_c + (F_s - F_c) * exp(-ratio * ratio)
    dz = Output("m/s", "rate of the deflection", v - sigma_0 * fabs(v) * z / g, rate_of=z)
    stretch = x_driver - x
    F_spring = Output("N", "spring force on the mass", k * stretch)
    F_friction = Output("N", "friction force, opposing the motion", sigma_0 * z + sigma_1 * dz + sigma_2 * v)
    a = Output("m/s2", "acceleration of the mass", (F_ext + F_spring - F_friction) / m, rate_of=v)
    energy = Output(
        "J",
        "kinetic and potential energy, with that of the bristles",
        0.5 * (m * v * v + F_spring * stretch + sigma_0 * z * z),
        low=0.0,
    )

    stop_time, step_size, method = 20.0, 0.02, "rodas"
    rules = Rule(F_c > F_s, "F_c is {F_c!r}, above F_s = {F_s!r}: lower F_c or raise F_s")
