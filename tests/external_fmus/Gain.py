from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Gain(Fmi2Slave):
    """y = k u + c, without states and units."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 1.0, 0.01)
        self.u, self.y, self.k, self.c = 0.0, 0.0, 1.0, 0.0
        tunable = Fmi2Variability.tunable
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("k", causality=Fmi2Causality.parameter, variability=tunable))
        self.register_variable(Real("c", causality=Fmi2Causality.parameter, variability=tunable))

    def exit_initialization_mode(self):
        self.y = self.k * self.u + self.c

    def do_step(self, t, h):
        self.y = self.k * self.u + self.c
        return True
