"""Compound pendulum with friction in its pin."""

from math import radians

from fmus import (
    HYBRID,
    SIGN,
    Choice,
    Contact,
    Fixed,
    Input,
    Mode,
    Model,
    Output,
    Parameter,
    Rule,
    State,
    cos,
    sin,
    sqrt,
)

POUND, INCH = 0.45359237, 0.0254


class Pendulum(Model):
    """Compound pendulum with dry friction in its pin.

        J alpha = T_ext - m g a sin(theta) - T_friction,   J = J_G + m a^2
        sliding:   T_friction = mu r N sign(omega)
        stuck:     omega = 0 while |T_ext - m g a sin(theta)| <= mu r m g
        pin_load weight:     N = m g
        pin_load reaction:   N^2 = (m g cos(theta) + m a omega^2)^2 + (m g sin(theta) + m a alpha)^2

    At rest the pin carries the weight, so both loads hold the same torque.
    """

    m = Parameter(0.46 * POUND, "kg", "mass", above=0.0)
    a = Parameter(3.7 * INCH, "m", "distance from the pin to the centre of mass", low=0.0)
    J_G = Parameter(1.5 * POUND * INCH * INCH, "kg.m2", "moment of inertia about the centre of mass", low=0.0)
    g = Parameter(386.0 * INCH, "m/s2", "gravitational acceleration", low=0.0)
    mu = Parameter(0.1, "1", "coefficient of friction in the pin", low=0.0)
    r = Parameter(0.25 * INCH, "m", "radius of the pin", low=0.0)
    theta0 = Fixed(radians(10.02), "rad", "initial angle, zero when hanging down", display="deg")
    omega0 = Fixed(0.0, "rad/s", "initial angular speed", display="deg/s")
    pin_load = Choice("load on the pin", weight="the weight", reaction="the magnitude of the pin reaction")
    T_ext = Input(0.0, "N.m", "external torque on the pendulum")

    theta = State("rad", "angle, zero when hanging down", start=theta0, display="deg")
    omega = State("rad/s", "angular speed", start=omega0, rate_of=theta, display="deg/s")
    mode = Mode()

    J = J_G + m * a * a
    weight = m * g
    moment = weight * a
    arm = mu * r
    share = arm * m * a / J
    rest = 1.0 - share * share
    load = T_ext - moment * sin(theta)

    # the reaction while the pin slides obeys N^2 = radial^2 + (b - mode share N)^2
    radial = weight * cos(theta) + m * a * omega * omega
    b = weight * sin(theta) + m * a * load / J
    reaction = (sqrt(b * b + rest * radial * radial) - mode * share * b) / rest
    N = pin_load.choose(weight=weight, reaction=reaction)

    T_friction = Contact(
        "N.m",
        "friction torque in the pin, opposing the motion",
        mode=mode,
        slip=omega,
        slide=arm * N,
        hold=arm * weight,
        laws=(HYBRID, SIGN),
        lifts_off=False,  # the root in the reaction exceeds its other term, as share is below 1
    )
    alpha = Output("rad/s2", "angular acceleration", (load - T_friction) / J, rate_of=omega, display="deg/s2")
    half = sin(0.5 * theta)
    energy = Output(
        "J",
        "kinetic and potential energy, zero at rest when hanging down",
        0.5 * J * omega * omega + 2.0 * moment * half * half,
        low=0.0,
    )

    stop_time = 5.0
    step_size = 0.005
    tolerance = 1e-10
    method = "dop853"
    rules = (
        Rule(J <= 0.0, "J_G + m a^2 is zero: a pendulum needs inertia; raise J_G or a"),
        Rule(
            pin_load.choose(weight=0.0, reaction=share) >= 1.0,
            "mu r is {mu!r}*{r!r} m, too much for pin_load = 2 (reaction): the friction torque would outgrow the "
            "inertia (mu r m a must be below J_G + m a^2); lower mu or r, or set pin_load to 1 (weight)",
        ),
    )
