"""Robot joint with friction on both sides of its gear, and a speed controller."""

from fmus import Contact, Input, Mode, Model, Output, Parameter, Rule, State, sin


class Joint(Model):
    """Motor, elastic gear and load, with dry friction on both sides, and a PI controller of the motor speed.

        J_m alpha_m = T - T_gear/n - T_m,   J_l alpha_l = T_ext + T_gear - T_l
        T_gear = k (phi_m/n - phi_l) + c (omega_m/n - omega_l)
        T = K_p e + K_i E,   dE/dt = e = A sin(angle) - omega_m,   d(angle)/dt = Omega
        sliding:   T_m = T_dm sign(omega_m),   T_l = T_dl sign(omega_l)
        stuck:     omega_m = 0 while |T - T_gear/n| <= T_sm,   omega_l = 0 while |T_ext + T_gear| <= T_sl

    M. W. Spong, Modeling and control of elastic joint robots, Journal of Dynamic Systems, Measurement, and Control 109
    (1987) 310-318.
    """

    J_m = Parameter(0.001, "kg.m2", "moment of inertia of the motor", above=0.0)
    J_l = Parameter(5.0, "kg.m2", "moment of inertia of the load", above=0.0)
    n = Parameter(100.0, "1", "gear ratio, motor speed over load speed", above=0.0)
    k = Parameter(20000.0, "N.m/rad", "stiffness of the gear, at the load", low=0.0)
    c = Parameter(20.0, "N.m.s/rad", "damping of the gear, at the load", low=0.0)
    T_sm = Parameter(0.1, "N.m", "static friction torque of the motor", low=0.0)
    T_dm = Parameter(0.08, "N.m", "sliding friction torque of the motor", low=0.0)
    T_sl = Parameter(15.0, "N.m", "static friction torque of the load", low=0.0)
    T_dl = Parameter(10.0, "N.m", "sliding friction torque of the load", low=0.0)
    K_p = Parameter(0.05, "N.m.s/rad", "proportional gain of the controller", low=0.0)
    K_i = Parameter(0.5, "N.m/rad", "integral gain of the controller", low=0.0)
    A = Parameter(50.0, "rad/s", "amplitude of the set point of the motor speed", low=0.0)
    Omega = Parameter(3.141592653589793, "rad/s", "angular frequency of the set point", low=0.0)
    T_ext = Input(0.0, "N.m", "external torque on the load")

    phi_m = State("rad", "angle of the motor")
    omega_m = State("rad/s", "angular speed of the motor", rate_of=phi_m)
    phi_l = State("rad", "angle of the load")
    omega_l = State("rad/s", "angular speed of the load", rate_of=phi_l)
    E = State("rad", "integral of the speed error")
    angle = State("rad", "phase angle of the set point", rate=Omega)
    mode_m, mode_l = Mode(), Mode()

    e = Output("rad/s", "speed error of the motor", A * sin(angle) - omega_m, rate_of=E)
    T = Output("N.m", "torque of the motor", K_p * e + K_i * E)
    T_gear = Output("N.m", "torque of the gear on the load", k * (phi_m / n - phi_l) + c * (omega_m / n - omega_l))
    T_m = Contact("N.m", "friction torque of the motor", mode=mode_m, slip=omega_m, slide=T_dm, hold=T_sm)
    T_l = Contact("N.m", "friction torque of the load", mode=mode_l, slip=omega_l, slide=T_dl, hold=T_sl)
    alpha_m = Output("rad/s2", "angular acceleration of the motor", (T - T_gear / n - T_m) / J_m, rate_of=omega_m)
    alpha_l = Output("rad/s2", "angular acceleration of the load", (T_ext + T_gear - T_l) / J_l, rate_of=omega_l)

    stop_time, step_size, method = 4.0, 0.004, "dop853"
    rules = (
        Rule(T_dm > T_sm, "T_dm is {T_dm!r}, above T_sm = {T_sm!r}: lower T_dm or raise T_sm"),
        Rule(T_dl > T_sl, "T_dl is {T_dl!r}, above T_sl = {T_sl!r}: lower T_dl or raise T_sl"),
    )
