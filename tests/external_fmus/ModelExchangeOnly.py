from pythonfmu3 import (
    DefaultExperiment,
    Float64,
    Fmi3Causality,
    Fmi3Initial,
    Fmi3SlaveBase,
    Fmi3Variability,
    ModelExchange,
)


class ModelExchangeOnly(Fmi3SlaveBase, ModelExchange):
    """FMI 3.0, model exchange only: the oscillator of Midpoint, solved by the importer."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 1.0)
        self.time, self.x, self.v, self.k, self.der_x, self.der_v = 0.0, 1.0, 0.0, 40.0, 0.0, -40.0
        output, continuous = Fmi3Causality.output, Fmi3Variability.continuous
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        self.register_variable(Float64("x", causality=output, variability=continuous, initial=Fmi3Initial.exact))
        self.register_variable(Float64("v", causality=output, variability=continuous, initial=Fmi3Initial.exact))
        local = Fmi3Causality.local
        self.register_variable(Float64("der_x", causality=local, variability=continuous, derivative=1))
        self.register_variable(Float64("der_v", causality=local, variability=continuous, derivative=2))
        parameter, tunable = Fmi3Causality.parameter, Fmi3Variability.tunable
        self.register_variable(Float64("k", causality=parameter, variability=tunable))

    def get_continuous_state_derivatives(self):
        self.der_x, self.der_v = self.v, -self.k * self.x
        return [self.der_x, self.der_v]
