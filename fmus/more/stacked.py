"""Block on a block."""

from fmus import Contact, Input, Mode, Model, Output, Parameter, Rule, State


class Stacked(Model):
    """Block on a block on the ground: the driver pulls the upper one, and both contacts act on the lower one.

        m_1 a_1 = F_ext - k_1 x_1 + F_2 - F_1,   m_2 a_2 = k_2 (x_driver - x_2) - F_2
        slip_1 = v_1,   slip_2 = v_2 - v_1,   d(x_driver)/dt = v_driver
        sliding:   F_1 = mu_d1 (m_1 + m_2) g sign(slip_1),   F_2 = mu_d2 m_2 g sign(slip_2)
        stuck:     the forces that keep the slips at zero, up to mu_s1 (m_1 + m_2) g and mu_s2 m_2 g

    D. Karnopp, Computer simulation of stick-slip friction in mechanical dynamic systems, Journal of Dynamic Systems,
    Measurement, and Control 107 (1985) 100-103.
    """

    m_1 = Parameter(4.0, "kg", "mass of the lower block", above=0.0)
    m_2 = Parameter(2.0, "kg", "mass of the upper block", above=0.0)
    k_1 = Parameter(150.0, "N/m", "stiffness of the spring of the lower block", low=0.0)
    k_2 = Parameter(400.0, "N/m", "stiffness of the spring of the driver", low=0.0)
    mu_s1 = Parameter(0.21, "1", "coefficient of static friction on the ground", low=0.0)
    mu_d1 = Parameter(0.15, "1", "coefficient of sliding friction on the ground", low=0.0)
    mu_s2 = Parameter(0.7, "1", "coefficient of static friction between the blocks", low=0.0)
    mu_d2 = Parameter(0.5, "1", "coefficient of sliding friction between the blocks", low=0.0)
    g = Parameter(9.81, "m/s2", "gravitational acceleration", low=0.0)
    v_driver = Parameter(0.2, "m/s", "speed of the driver")
    F_ext = Input(0.0, "N", "external force on the lower block")

    x_1 = State("m", "position of the lower block")
    v_1 = State("m/s", "speed of the lower block", rate_of=x_1)
    x_2 = State("m", "position of the upper block")
    v_2 = State("m/s", "speed of the upper block", rate_of=x_2)
    x_driver = State("m", "position of the driver, zero at the start", rate=v_driver)
    mode_1, mode_2 = Mode(), Mode()

    N_1 = (m_1 + m_2) * g
    N_2 = m_2 * g
    F_ground = Output("N", "force of the spring of the lower block on it", -k_1 * x_1)
    F_spring = Output("N", "force of the driver's spring on the upper block", k_2 * (x_driver - x_2))
    F_1 = Contact(
        "N", "friction force of the ground on the lower block", mode=mode_1, slip=v_1, slide=mu_d1 * N_1,
        hold=mu_s1 * N_1,
    )  # fmt: skip
    F_2 = Contact(
        "N", "friction force of the lower block on the upper one", mode=mode_2, slip=v_2 - v_1, slide=mu_d2 * N_2,
        hold=mu_s2 * N_2,
    )  # fmt: skip
    a_1 = Output("m/s2", "acceleration of the lower block", (F_ext + F_ground + F_2 - F_1) / m_1, rate_of=v_1)
    a_2 = Output("m/s2", "acceleration of the upper block", (F_spring - F_2) / m_2, rate_of=v_2)

    stop_time, step_size, method = 8.0, 0.008, "dop853"
    rules = (
        Rule(mu_d1 > mu_s1, "mu_d1 is {mu_d1!r}, above mu_s1 = {mu_s1!r}: lower mu_d1 or raise mu_s1"),
        Rule(mu_d2 > mu_s2, "mu_d2 is {mu_d2!r}, above mu_s2 = {mu_s2!r}: lower mu_d2 or raise mu_s2"),
    )
