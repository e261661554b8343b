from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class FixedStep(Fmi2Slave):
    """x' = -k x by Euler's method, in steps of 0.1 s for any communication step: 41 % off after 10 s."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 10.0)
        self.x, self.k, self.steps = 1.0, 1.0, 0
        tunable = Fmi2Variability.tunable
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Real("k", causality=Fmi2Causality.parameter, variability=tunable))

    def do_step(self, t, h):
        while 0.1 * (self.steps + 1) <= t + h + 1e-9:
            self.x -= 0.1 * self.k * self.x
            self.steps += 1
        return True
