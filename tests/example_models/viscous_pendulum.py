"""A pendulum in oil."""

from fmus import Model, Output, Parameter, State, sin


class ViscousPendulum(Model):
    """Pendulum with a damped pin and no input.

    m l^2 alpha = - m g l sin(phi) - d omega
    """

    m = Parameter(1, "kg", "mass", above=0)
    l = Parameter(0.5, "m", "length", above=0)  # noqa: E741
    g = Parameter(9.81, "m/s2", "gravity")
    d = Parameter(0.05, "N.m.s/rad", "damping", low=0)

    phi = State("rad", "angle", start=0.3)
    omega = State("rad/s", "angular speed", rate_of=phi)
    alpha = Output(
        "rad/s2",
        "angular acceleration",
        (-m * g * l * sin(phi) - d * omega) / (m * l * l),
        rate_of=omega,
        display="deg/s2",
    )
