from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Midpoint(Fmi2Slave):
    """An undamped oscillator by the midpoint rule, one step per communication step; no units."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 1.0, 0.01)
        self.x, self.v, self.k = 1.0, 0.0, 40.0
        tunable = Fmi2Variability.tunable
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Real("v", causality=Fmi2Causality.output))
        self.register_variable(Real("k", causality=Fmi2Causality.parameter, variability=tunable))

    def do_step(self, t, h):
        x, v = self.x + h / 2 * self.v, self.v - h / 2 * self.k * self.x
        self.x, self.v = self.x + h * v, self.v - h * self.k * x
        return True
