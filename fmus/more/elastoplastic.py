"""Mass pulled through a spring, with elasto-plastic friction."""

from fmus import Fixed, Input, Model, Output, Parameter, Rule, State, choose, cos, exp, fabs, pi


class Elastoplastic(Model):
    """Mass pulled through a spring by a driver of constant speed, with elasto-plastic friction: z is the deflection.

        m a = F_ext + k (x_driver - x) - F_friction,   d(x_driver)/dt = v_driver
        F_friction = sigma_0 z + sigma_1 dz/dt + sigma_2 v
        dz/dt = v - alpha |v| z/z_ss,   z_ss = (F_c + (F_s - F_c) exp(-(v/v_s)^2))/sigma_0
        alpha = 0 if v z <= 0 or |z| <= z_ba;   1 if |z| >= z_ss;   otherwise
        alpha = (1 - cos(pi (|z| - z_ba)/(z_ss - z_ba)))/2

    Below z_ba the contact is elastic, so a load below sigma_0 z_ba causes no drift; with z_ba = 0 and alpha = 1 this is
    LuGre.
    P. Dupont, V. Hayward, B. Armstrong, F. Altpeter, Single state elastoplastic friction models, IEEE Transactions on
    Automatic Control 47 (2002) 787-792.
    """

    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(2.0, "N/m", "spring stiffness", low=0.0)
    F_s = Parameter(1.5, "N", "static friction", above=0.0)
    F_c = Parameter(1.0, "N", "Coulomb friction", above=0.0)
    v_s = Parameter(0.001, "m/s", "Stribeck speed", above=0.0)
    sigma_0 = Parameter(1e5, "N/m", "stiffness of the contact", above=0.0)
    sigma_1 = Parameter(1e5**0.5, "N.s/m", "damping of the contact", low=0.0)
    sigma_2 = Parameter(0.4, "N.s/m", "viscous friction", low=0.0)
    z_ba = Parameter(7e-6, "m", "deflection up to which the contact is elastic", low=0.0)
    v_driver = Parameter(0.1, "m/s", "speed of the driver")
    x0 = Fixed(0.0, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    z0 = Fixed(0.0, "m", "initial deflection of the contact")
    F_ext = Input(0.0, "N", "external force on the mass")

    x = State("m", "position of the mass", start=x0)
    v = State("m/s", "speed of the mass", start=v0, rate_of=x, nominal_velocity=v_s)
    z = State("m", "deflection of the contact", start=z0)
    x_driver = State("m", "position of the driver, zero at the start", rate=v_driver)

    ratio = v / v_s
    z_ss = (F_c + (F_s - F_c) * exp(-ratio * ratio)) / sigma_0
    w = (fabs(z) - z_ba) / (z_ss - z_ba)
    share = 0.5 * (1.0 + fabs(w) - fabs(w - 1.0))  # w between 0 and 1; alpha is smooth there, so it needs no event
    alpha = choose(v * z <= 0.0, 0.0, 0.5 - 0.5 * cos(pi * share))
    dz = Output("m/s", "rate of the deflection", v - alpha * fabs(v) * z / z_ss, rate_of=z)
    stretch = x_driver - x
    F_spring = Output("N", "spring force on the mass", k * stretch)
    F_friction = Output("N", "friction force, opposing the motion", sigma_0 * z + sigma_1 * dz + sigma_2 * v)
    a = Output("m/s2", "acceleration of the mass", (F_ext + F_spring - F_friction) / m, rate_of=v)
    energy = Output(
        "J",
        "kinetic and potential energy, with that of the contact",
        0.5 * (m * v * v + F_spring * stretch + sigma_0 * z * z),
        low=0.0,
    )

    stop_time, step_size, method = 20.0, 0.02, "rodas"
    rules = (
        Rule(F_c > F_s, "F_c is {F_c!r}, above F_s = {F_s!r}: lower F_c or raise F_s"),
        Rule(
            sigma_0 * z_ba >= F_c,
            "z_ba is {z_ba!r}, but the elastic force sigma_0 z_ba must be below F_c = {F_c!r}: lower z_ba",
        ),
    )
