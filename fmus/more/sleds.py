"""Two sleds in a row, pulled through a spring."""

from fmus import Contact, Input, Mode, Model, Output, Parameter, Rule, State


class Sleds(Model):
    """Two sleds in a row, pulled through a spring by a driver of constant speed, each with stick and slip.

        m_1 a_1 = F_ext + F_spring - F_link - F_1,   m_2 a_2 = F_link - F_2
        F_spring = k (x_driver - x_1),   F_link = k_link (x_1 - x_2),   d(x_driver)/dt = v_driver
        sliding:   F_1 = f_d1 sign(v_1),   F_2 = f_d2 sign(v_2)
        stuck:     v_1 = 0 while |F_ext + F_spring - F_link| <= f_s1,   v_2 = 0 while |F_link| <= f_s2

    R. Burridge, L. Knopoff, Model and theoretical seismicity, Bulletin of the Seismological Society of America 57
    (1967) 341-371.
    """

    m_1 = Parameter(12.5, "kg", "mass of the first sled", above=0.0)
    m_2 = Parameter(8.0, "kg", "mass of the second sled", above=0.0)
    k = Parameter(742.5, "N/m", "stiffness of the spring of the driver", low=0.0)
    k_link = Parameter(1100.0, "N/m", "stiffness of the spring between the sleds", low=0.0)
    f_s1 = Parameter(110.3625, "N", "static friction of the first sled", low=0.0)
    f_d1 = Parameter(73.575, "N", "sliding friction of the first sled", low=0.0)
    f_s2 = Parameter(66.0, "N", "static friction of the second sled", low=0.0)
    f_d2 = Parameter(40.0, "N", "sliding friction of the second sled", low=0.0)
    v_driver = Parameter(0.034, "m/s", "speed of the driver")
    F_ext = Input(0.0, "N", "external force on the first sled")

    x_1 = State("m", "position of the first sled")
    v_1 = State("m/s", "speed of the first sled", rate_of=x_1)
    x_2 = State("m", "position of the second sled, counted so that the spring between them is relaxed at the start")
    v_2 = State("m/s", "speed of the second sled", rate_of=x_2)
    x_driver = State("m", "position of the driver, zero at the start", rate=v_driver)
    mode_1, mode_2 = Mode(), Mode()

    F_spring = Output("N", "force of the driver's spring on the first sled", k * (x_driver - x_1))
    F_link = Output("N", "force of the spring between the sleds on the second sled", k_link * (x_1 - x_2))
    F_1 = Contact("N", "friction force of the first sled", mode=mode_1, slip=v_1, slide=f_d1, hold=f_s1)
    F_2 = Contact("N", "friction force of the second sled", mode=mode_2, slip=v_2, slide=f_d2, hold=f_s2)
    a_1 = Output("m/s2", "acceleration of the first sled", (F_ext + F_spring - F_link - F_1) / m_1, rate_of=v_1)
    a_2 = Output("m/s2", "acceleration of the second sled", (F_link - F_2) / m_2, rate_of=v_2)

    stop_time, step_size, method = 16.0, 0.016, "dop853"
    rules = (
        Rule(f_d1 > f_s1, "f_d1 is {f_d1!r}, above f_s1 = {f_s1!r}: lower f_d1 or raise f_s1"),
        Rule(f_d2 > f_s2, "f_d2 is {f_d2!r}, above f_s2 = {f_s2!r}: lower f_d2 or raise f_s2"),
    )
