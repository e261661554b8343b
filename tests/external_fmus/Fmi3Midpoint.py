from pythonfmu3 import (
    Boolean,
    DefaultExperiment,
    Float64,
    Fmi3Causality,
    Fmi3Slave,
    Fmi3Status,
    Fmi3StepResult,
    Fmi3Variability,
    Int64,
    Unit,
)


class Fmi3Midpoint(Fmi3Slave):
    """FMI 3.0: the oscillator of Midpoint, with units; it terminates the simulation at the time `limit`."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 1.0)
        self.time, self.x, self.v, self.k, self.limit, self.right, self.turns = 0.0, 1.0, 0.0, 40.0, 1e9, True, 0
        self.register_units([Unit("m", m=1), Unit("m/s", m=1, s=-1), Unit("1/s2", s=-2), Unit("s", s=1)])
        output, parameter, tunable = Fmi3Causality.output, Fmi3Causality.parameter, Fmi3Variability.tunable
        discrete, continuous = Fmi3Variability.discrete, Fmi3Variability.continuous
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        self.register_variable(Float64("x", unit="m", causality=output))
        self.register_variable(Float64("v", unit="m/s", causality=output))
        self.register_variable(Boolean("right", causality=output, variability=discrete))
        self.register_variable(Int64("turns", causality=output, variability=discrete))
        self.register_variable(Float64("k", unit="1/s2", causality=parameter, variability=tunable))
        self.register_variable(Float64("limit", unit="s", causality=parameter, variability=tunable))

    def do_step(self, t, h):
        x, v = self.x + h / 2 * self.v, self.v - h / 2 * self.k * self.x
        self.x, v = self.x + h * v, self.v - h * self.k * x
        self.turns += (v > 0.0) != (self.v > 0.0)
        self.v, self.right, self.time = v, self.x > 0.0, t + h
        return Fmi3StepResult(status=Fmi3Status.ok, terminateSimulation=t + h >= self.limit)
