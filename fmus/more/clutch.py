"""Two inertias with a clutch that locks."""

from fmus import Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State, cos, sin


class Clutch(Model):
    """Two inertias and a dry clutch between them, driven by a harmonic torque; locked they turn as one.

        J_1 alpha_1 = T sin(angle_T) + T_1 - T_clutch,   J_2 alpha_2 = T_clutch + T_2
        slip = omega_1 - omega_2,   N = N_0 cos(angle_N),   d(angle_T)/dt = Omega_T,   d(angle_N)/dt = Omega_N
        sliding:   T_clutch = mu_d N sign(slip)
        locked:    slip = 0 while |T_clutch| <= mu_s N
        open:      T_clutch = 0 while N < 0

    The default run is that of the first two inertias of the example CoupledClutches before the second clutch closes:
    Modelica Standard Library, Modelica.Mechanics.Rotational.Examples.CoupledClutches.
    M. Otter, H. Elmqvist, S. E. Mattsson, Hybrid modeling in Modelica based on the synchronous data flow principle,
    IEEE International Symposium on Computer Aided Control System Design (1999) 151-157.
    """

    J_1 = Parameter(1.0, "kg.m2", "moment of inertia of the driving side", above=0.0)
    J_2 = Parameter(1.0, "kg.m2", "moment of inertia of the driven side", above=0.0)
    T = Parameter(10.0, "N.m", "amplitude of the driving torque", low=0.0)
    Omega_T = Parameter(31.41592653589793, "rad/s", "angular frequency of the driving torque", low=0.0)
    N_0 = Parameter(20.0, "N", "amplitude of the normal force", low=0.0)
    Omega_N = Parameter(1.2566370614359172, "rad/s", "angular frequency of the normal force", low=0.0)
    mu_s = Parameter(0.55, "m", "static friction torque per normal force", low=0.0)
    mu_d = Parameter(0.5, "m", "sliding friction torque per normal force", low=0.0)
    omega0_1 = Fixed(10.0, "rad/s", "initial speed of the driving side")
    omega0_2 = Fixed(0.0, "rad/s", "initial speed of the driven side")
    T_1 = Input(0.0, "N.m", "further torque on the driving side")
    T_2 = Input(0.0, "N.m", "torque on the driven side")

    omega_1 = State("rad/s", "angular speed of the driving side", start=omega0_1)
    omega_2 = State("rad/s", "angular speed of the driven side", start=omega0_2)
    angle_T = State("rad", "phase angle of the driving torque", rate=Omega_T)
    angle_N = State("rad", "phase angle of the normal force", rate=Omega_N)
    mode = Mode("-1 driven side faster, 0 locked, 1 driving side faster")

    N = Output("N", "normal force, negative while the clutch is open", N_0 * cos(angle_N))
    T_drive = Output("N.m", "torque on the driving side without that of the clutch", T * sin(angle_T) + T_1)
    T_clutch = Contact(
        "N.m", "torque of the clutch", mode=mode, slip=omega_1 - omega_2, slide=mu_d * N, hold=mu_s * N, lifts_off=True
    )
    alpha_1 = Output("rad/s2", "angular acceleration of the driving side", (T_drive - T_clutch) / J_1, rate_of=omega_1)
    alpha_2 = Output("rad/s2", "angular acceleration of the driven side", (T_clutch + T_2) / J_2, rate_of=omega_2)
    energy = Output("J", "kinetic energy", 0.5 * (J_1 * omega_1 * omega_1 + J_2 * omega_2 * omega_2), low=0.0)

    stop_time, step_size, method = 1.5, 0.0015, "dop853"
    rules = Rule(mu_d > mu_s, "mu_d is {mu_d!r}, above mu_s = {mu_s!r}: lower mu_d or raise mu_s")
