"""Drag sled with a smooth friction curve."""

from fmus import Fixed, Input, Model, Output, Parameter, Rule, State, asin, atan, pi, sin, tan


class Pacejka(Model):
    """Drag sled with the smooth friction curve of Pacejka's magic formula; a sled at rest creeps instead of sticking.

        m a = F_ext + k (x_driver - x) - F_friction,   d(x_driver)/dt = v_driver
        F_friction = mu(v) m g,   mu(v) = D sin(C atan(B v - E (B v - atan(B v))))
        D = mu_s,   C = 2 - 2 asin(mu_d/D)/pi,   B = 2 mu_s/(x_m C D),
        E = (B x_m - tan(pi/(2 C)))/(B x_m - atan(B x_m))

    The curve has its peak mu_s at the speed x_m and tends to mu_d.
    H. B. Pacejka, Tire and Vehicle Dynamics, section 4.3.
    """

    m = Parameter(12.5, "kg", "mass of the sled", above=0.0)
    k = Parameter(742.5, "N/m", "spring stiffness", low=0.0)
    mu_s = Parameter(0.9, "1", "peak of the friction coefficient", above=0.0)
    mu_d = Parameter(0.6, "1", "coefficient of friction at high speed", low=0.0)
    g = Parameter(9.81, "m/s2", "gravitational acceleration", low=0.0)
    v_driver = Parameter(0.034, "m/s", "speed of the driver")
    x_m = Parameter(0.01, "m/s", "speed at the peak of the friction curve", above=0.0)
    x0 = Fixed(0.0, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    F_ext = Input(0.0, "N", "external force on the sled")

    x = State("m", "position of the sled", start=x0)
    v = State("m/s", "speed of the sled", start=v0, rate_of=x, nominal_velocity=x_m)
    x_driver = State("m", "position of the driver, zero at the start", rate=v_driver)

    D = mu_s
    C = 2.0 - 2.0 * asin(mu_d / D) / pi
    B = 2.0 * mu_s / (x_m * C * D)
    peak = B * x_m
    E = (peak - tan(0.5 * pi / C)) / (peak - atan(peak))
    z = B * v
    y = z - E * (z - atan(z))
    mu = D * sin(C * atan(y))

    weight = m * g
    stretch = x_driver - x
    F_spring = Output("N", "spring force on the sled", k * stretch)
    F_friction = Output("N", "friction force, opposing the motion", mu * weight)
    a = Output("m/s2", "acceleration of the sled", (F_ext + F_spring) / m - mu * g, rate_of=v)
    energy = Output("J", "kinetic and potential energy", 0.5 * (m * v * v + F_spring * stretch), low=0.0)

    stop_time = 16.0
    step_size = 0.016
    method = "radau9"
    tolerance = 2e-7  # a position error shifts the next break-away and costs the speed another digit
    rules = (
        Rule(
            mu_d >= mu_s,
            "mu_d is {mu_d!r}, not below mu_s = {mu_s!r}: at mu_d = mu_s the factor C is 1 and no finite E puts the "
            "peak of the curve at x_m; lower mu_d or raise mu_s",
        ),
    )
