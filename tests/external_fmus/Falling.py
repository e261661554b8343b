from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Status


class Falling(Fmi2Slave):
    """A stone that terminates the simulation when it reaches the ground, at t = (2 height / g)^1/2."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 2.0)
        self.height, self.g, self.y = 4.905, 9.81, 4.905
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        for name in ("height", "g"):
            tunable = Fmi2Variability.tunable
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=tunable))

    def exit_initialization_mode(self):
        self.y = self.height

    def do_step(self, t, h):
        y = self.height - self.g * (t + h) ** 2 / 2
        if y < 0.0:
            self.log("the stone is on the ground", Fmi2Status.discard)
            return False
        self.y = y
        return True
