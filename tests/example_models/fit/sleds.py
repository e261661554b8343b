"""Two sleds in a row."""

from fmus import Contact, Input, Mode, Model, Output, Parameter, State


class Sleds(Model):
    """Two sleds in a row, pulled through a spring, each with stick and slip.

    m1 a1 = F_ext + F_spring - F_link - F1,   m2 a2 = F_link - F2
    F_spring = k (x_driver - x1),   F_link = link (x1 - x2),   d(x_driver)/dt = v_driver
    sliding:   F1 = slide1 sign(v1),   stuck: v1 = 0 while |F_ext + F_spring - F_link| <= hold1;   F2 likewise
    """

    m1 = Parameter(12.5, "kg", "mass of the first sled", above=0.0)
    m2 = Parameter(8.0, "kg", "mass of the second sled", above=0.0)
    k = Parameter(742.5, "N/m", "stiffness of the spring", low=0.0)
    link = Parameter(1100.0, "N/m", "stiffness of the link between the sleds", low=0.0)
    slide1 = Parameter(73.575, "N", "sliding friction of the first sled", low=0.0)
    slide2 = Parameter(40.0, "N", "sliding friction of the second sled", low=0.0)
    hold1 = Parameter(110.3625, "N", "static friction of the first sled", low=0.0)
    hold2 = Parameter(66.0, "N", "static friction of the second sled", low=0.0)
    v_driver = Parameter(0.034, "m/s", "speed of the driver")
    F_ext = Input(0.0, "N", "outer force on the first sled")

    x1 = State("m", "position of the first sled")
    v1 = State("m/s", "speed of the first sled", rate_of=x1)
    x2 = State("m", "position of the second sled, relative to the first at rest")
    v2 = State("m/s", "speed of the second sled", rate_of=x2)
    x_driver = State("m", "position of the driver, zero at the start", rate=v_driver)
    mode1, mode2 = Mode(), Mode()

    F_spring = Output("N", "force of the spring on the first sled", k * (x_driver - x1))
    F_link = Output("N", "force of the link on the second sled", link * (x1 - x2))
    F1 = Contact("N", "friction of the first sled", mode=mode1, slip=v1, slide=slide1, hold=hold1)
    F2 = Contact("N", "friction of the second sled", mode=mode2, slip=v2, slide=slide2, hold=hold2)
    a1 = Output("m/s2", "acceleration of the first sled", (F_ext + F_spring - F_link - F1) / m1, rate_of=v1)
    a2 = Output("m/s2", "acceleration of the second sled", (F_link - F2) / m2, rate_of=v2)

    stop_time, step_size = 16.0, 0.016
