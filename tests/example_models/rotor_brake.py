"""A rotor with a brake."""

from fmus import HYBRID, THRESHOLD, Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State, exp


class RotorBrake(Model):
    """Rotor on a torsion spring whose far end turns, with a brake whose friction falls with the slip speed.

    J alpha = T + k (turn - phi) - c omega - T_brake
    sliding:   T_brake = (T_d + (T_s - T_d) exp(-(omega/omega_s)^2)) sign(omega)
    stuck:     omega = 0 while |T + k (turn - phi)| <= T_s
    """

    J = Parameter(0.02, "kg.m2", "moment of inertia", above=0)
    k = Parameter(3.0, "N.m/rad", "stiffness of the spring", low=0)
    c = Parameter(0.01, "N.m.s/rad", "damping", low=0)
    T_s = Parameter(0.5, "N.m", "torque of the brake at rest", low=0)
    T_d = Parameter(0.3, "N.m", "torque of the brake at high speed", low=0)
    omega_s = Parameter(0.5, "rad/s", "speed at which the brake has let go most of the way", above=0)
    omega_turn = Parameter(0.4, "rad/s", "speed of the far end")
    omega_h = Parameter(1e-6, "rad/s", "speed below which the threshold law holds", above=0)
    omega0 = Fixed(0.0, "rad/s", "speed at the start")
    T = Input(0.0, "N.m", "outer torque")

    phi = State("rad", "angle")
    omega = State("rad/s", "angular speed", start=omega0, rate_of=phi)
    turn = State("rad", "angle of the far end", rate=omega_turn)
    grip = Mode()

    ratio = omega / omega_s
    T_brake = Contact(
        "N.m",
        "torque of the brake, against the motion",
        mode=grip,
        slip=omega,
        slide=T_d + (T_s - T_d) * exp(-ratio * ratio),
        laws=(HYBRID, THRESHOLD),
        eps=omega_h,
    )
    T_spring = Output("N.m", "torque of the spring", k * (turn - phi))
    alpha = Output("rad/s2", "angular acceleration", (T + T_spring - c * omega - T_brake) / J, rate_of=omega)

    stop_time, step_size, method = 6.0, 0.01, "ode45"
    rules = Rule(T_d > T_s, "T_d is {T_d!r}, above T_s = {T_s!r}: lower T_d or raise T_s")
