"""Drag sled pulled through a spring."""

from fmus import HYBRID, THRESHOLD, Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State


class Stickslip(Model):
    """Drag sled pulled through a spring by a driver of constant speed: stick-slip.

        m a = F_ext + k (x_driver - x) - F_friction,   d(x_driver)/dt = v_driver
        sliding:   F_friction = mu_d m g sign(v)
        stuck:     v = 0 while |F_ext + k (x_driver - x)| <= mu_s m g

    E. Rabinowicz, Friction and Wear of Materials, chapter 4.
    """

    m = Parameter(12.5, "kg", "mass of the sled", above=0.0)
    k = Parameter(742.5, "N/m", "spring stiffness", low=0.0)
    mu_s = Parameter(0.9, "1", "coefficient of static friction", low=0.0)
    mu_d = Parameter(0.6, "1", "coefficient of sliding friction", low=0.0)
    g = Parameter(9.81, "m/s2", "gravitational acceleration", low=0.0)
    v_driver = Parameter(0.034, "m/s", "speed of the driver")
    eps = Parameter(1e-7, "m/s", "speed below which the threshold law holds the sled", above=0.0)
    x0 = Fixed(0.0, "m", "initial position")
    v0 = Fixed(0.0, "m/s", "initial speed")
    F_ext = Input(0.0, "N", "external force on the sled")

    x = State("m", "position of the sled", start=x0)
    v = State("m/s", "speed of the sled", start=v0, rate_of=x)
    x_driver = State("m", "position of the driver, zero at the start", rate=v_driver)
    mode = Mode()

    sliding = mu_d * m * g
    holding = mu_s * m * g
    stretch = x_driver - x
    F_spring = Output("N", "spring force on the sled", k * stretch)
    F_friction = Contact(
        "N",
        "friction force, opposing the motion",
        mode=mode,
        slip=v,
        slide=sliding,
        hold=holding,
        laws=(HYBRID, THRESHOLD),
        eps=eps,
    )
    a = Output("m/s2", "acceleration of the sled", (F_ext + F_spring - F_friction) / m, rate_of=v)
    energy = Output("J", "kinetic and potential energy", 0.5 * (m * v * v + F_spring * stretch), low=0.0)

    stop_time = 16.0
    step_size = 0.016
    rules = Rule(
        mu_d > mu_s,
        "mu_d is {mu_d!r}, above mu_s = {mu_s!r}: sliding friction cannot exceed static friction; "
        "lower mu_d or raise mu_s",
    )
