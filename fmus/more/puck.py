"""Body on a tilted plate, or on a belt across the slope."""

from fmus import Fixed, Input, Mode, Model, Output, Parameter, PlanarContact, Rule, State, cos, sin


class Puck(Model):
    """Body on a tilted plate, or on a belt across the slope: friction opposes the slip, and its limit is a circle.

    m a_x = F_x - R_x,   m a_y = F_y - m g sin(alpha) - R_y,   slip = (v_x - v_belt, v_y)
    sliding:   R = mu m g cos(alpha) slip/|slip|
    stuck:     slip = 0 while the load (F_x, F_y - m g sin(alpha)) is at most mu_s m g cos(alpha)
    """

    m = Parameter(1.0, "kg", "mass", above=0.0)
    g = Parameter(9.81, "m/s2", "acceleration of gravity", low=0.0)
    alpha = Parameter(0.4, "rad", "tilt of the plate, which falls along -y", low=-1.5, high=1.5, display="deg")
    mu = Parameter(0.5, "1", "coefficient of sliding friction", low=0.0)
    mu_s = Parameter(0.5, "1", "coefficient of static friction", low=0.0)
    v_belt = Parameter(0.0, "m/s", "speed of the belt along x")
    v_x0 = Fixed(2.0, "m/s", "initial speed along x")
    v_y0 = Fixed(1.0, "m/s", "initial speed along y")
    F_x = Input(0.0, "N", "force along x")
    F_y = Input(0.0, "N", "force along y")

    x = State("m", "position along x, horizontal")
    y = State("m", "position along y, up the plate")
    v_x = State("m/s", "speed along x", start=v_x0, rate_of=x)
    v_y = State("m/s", "speed along y", start=v_y0, rate_of=y)
    mode = Mode("0 stuck, 1 sliding")

    N = m * g * cos(alpha)
    R = PlanarContact(
        "N", "friction force, opposing the slip", mode=mode, slip=(v_x - v_belt, v_y), slide=mu * N, hold=mu_s * N
    )
    a_x = Output("m/s2", "acceleration along x", (F_x - R.x) / m, rate_of=v_x)
    a_y = Output("m/s2", "acceleration along y", (F_y - R.y) / m - g * sin(alpha), rate_of=v_y)

    stop_time, step_size, method = 2.5, 0.005, "radau9"
    rules = Rule(mu > mu_s, "mu is {mu!r}, above mu_s = {mu_s!r}: lower mu or raise mu_s")
