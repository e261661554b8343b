from math import cos

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class NonConforming(Fmi2Slave):
    """Violates the standard, as many FMUs do: variables other than Real may not be continuous, which is the default."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 1.0)
        self.x, self.count, self.up, self.k = 1.0, 0, True, 40.0
        tunable = Fmi2Variability.tunable
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Integer("count", causality=Fmi2Causality.output))
        self.register_variable(Boolean("up", causality=Fmi2Causality.output))
        self.register_variable(Real("k", causality=Fmi2Causality.parameter, variability=tunable))

    def do_step(self, t, h):
        self.x = cos(self.k**0.5 * (t + h))
        self.count, self.up = int(4 * (t + h)), self.x > 0.0
        return True
