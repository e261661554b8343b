from pythonfmu3 import DefaultExperiment, Float64, Fmi3Causality, Fmi3Slave, Fmi3Status, Fmi3StepResult, Fmi3Variability


class Fmi3FixedStep(Fmi3Slave):
    """FMI 3.0: the decay of FixedStep, in the same internal steps of 0.1 s."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 10.0)
        self.time, self.x, self.k, self.steps = 0.0, 1.0, 1.0, 0
        continuous, tunable = Fmi3Variability.continuous, Fmi3Variability.tunable
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        self.register_variable(Float64("x", causality=Fmi3Causality.output))
        self.register_variable(Float64("k", causality=Fmi3Causality.parameter, variability=tunable))

    def do_step(self, t, h):
        self.time = t + h
        while 0.1 * (self.steps + 1) <= t + h + 1e-9:
            self.x -= 0.1 * self.k * self.x
            self.steps += 1
        return Fmi3StepResult(status=Fmi3Status.ok)
