"""Dry clutch between two inertias."""

from fmus import Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State


class Clutch(Model):
    """Two inertias and a dry clutch between them; engaged they turn as one.

    J_1 alpha1 = T_1 - T_clutch,   T_1 = T_in - c_1 omega1
    J_2 alpha2 = T_clutch - T_2,   T_2 = T_load + c_2 omega2
    sliding:   T_clutch = mu_d r F_n sign(slip),   slip = omega1 - omega2
    engaged:   slip = 0 while |T_clutch| <= mu_s r F_n,   T_clutch as required by both inertias
    """

    J_1 = Parameter(0.5, "kg.m2", "moment of inertia of the driving side", above=0.0)
    J_2 = Parameter(1.5, "kg.m2", "moment of inertia of the driven side", above=0.0)
    c_1 = Parameter(0.05, "N.m.s/rad", "damping of the driving side", low=0.0)
    c_2 = Parameter(0.2, "N.m.s/rad", "damping of the driven side", low=0.0)
    mu_s = Parameter(0.4, "1", "coefficient of static friction", low=0.0)
    mu_d = Parameter(0.3, "1", "coefficient of sliding friction", low=0.0)
    r = Parameter(0.1, "m", "effective radius of the clutch", low=0.0)
    F_n = Input(1000.0, "N", "normal force in the clutch", low=0.0)
    T_in = Input(20.0, "N.m", "torque that drives")
    T_load = Input(5.0, "N.m", "torque that brakes")
    omega10 = Fixed(50.0, "rad/s", "speed of the driving side at the start")

    omega1 = State("rad/s", "speed of the driving side", start=omega10)
    omega2 = State("rad/s", "speed of the driven side")
    mode = Mode("-1 driven faster, 0 engaged, 1 driving faster")

    T_1 = Output("N.m", "torque on the driving side", T_in - c_1 * omega1)
    T_2 = Output("N.m", "torque required by the driven side", T_load + c_2 * omega2)
    T_clutch = Contact(
        "N.m", "torque in the clutch", mode=mode, slip=omega1 - omega2, slide=mu_d * r * F_n, hold=mu_s * r * F_n
    )
    alpha1 = Output("rad/s2", "acceleration of the driving side", (T_1 - T_clutch) / J_1, rate_of=omega1)
    alpha2 = Output("rad/s2", "acceleration of the driven side", (T_clutch - T_2) / J_2, rate_of=omega2)
    energy = Output("J", "kinetic energy", 0.5 * (J_1 * omega1 * omega1 + J_2 * omega2 * omega2), low=0.0)

    rules = Rule(mu_d > mu_s, "mu_d is {mu_d!r}, above mu_s = {mu_s!r}: lower mu_d or raise mu_s")
