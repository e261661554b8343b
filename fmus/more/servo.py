"""Servo axis with a friction curve given by points, under position control."""

from fmus import Contact, Fixed, Input, Mode, Model, Output, Parameter, State, Table, fabs


class Servo(Model):
    """Axis with a friction curve given by points, under PID control of its position; it hunts around the set point.

        m a = F_ext + F_c - F_friction
        F_c = K_p e - K_d v + K_i E,   dE/dt = e = r - x
        sliding:   F_friction = F(|v|) sign(v)
        stuck:     v = 0 while |F_ext + F_c| <= F(0)

    Between the points, the friction curve F is linear.  The points have the shape of the curve of a guide with grease:
    friction falls while the speed is low and rises at larger speeds.  Replace them by those of your axis.  With K_i = 0
    and K_p = 0 the force F_ext of another controller moves the axis.

    B. Armstrong, B. Amin, PID control in the presence of static friction: a comparison of algebraic and describing
    function analysis, Automatica 32 (1996) 679-692 (hunting).
    """

    m = Parameter(10.0, "kg", "mass of the axis", above=0.0)
    r = Parameter(0.01, "m", "set point of the position")
    K_p = Parameter(2e4, "N/m", "proportional gain of the controller", low=0.0)
    K_i = Parameter(5e4, "N/(m.s)", "integral gain of the controller", low=0.0)
    K_d = Parameter(500.0, "N.s/m", "derivative gain of the controller", low=0.0)
    x0 = Fixed(0.0, "m", "initial position")
    F_ext = Input(0.0, "N", "external force on the axis")
    friction_curve = Table(
        [0.0, 0.001, 0.005, 0.02, 0.05, 0.1, 0.2],
        [30.0, 26.0, 18.0, 15.0, 16.0, 18.0, 22.0],
        "m/s",
        "N",
        ends="continue",
    )

    x = State("m", "position of the axis", start=x0)
    v = State("m/s", "speed of the axis", rate_of=x)
    E = State("m.s", "integral of the position error")
    mode = Mode()

    e = Output("m", "position error", r - x, rate_of=E)
    F_c = Output("N", "force of the controller", K_p * e - K_d * v + K_i * E)
    F_friction = Contact("N", "friction force, opposing the motion", mode=mode, slip=v, slide=friction_curve(fabs(v)))
    a = Output("m/s2", "acceleration of the axis", (F_ext + F_c - F_friction) / m, rate_of=v)

    stop_time, step_size, method = 10.0, 0.01, "dop853"
