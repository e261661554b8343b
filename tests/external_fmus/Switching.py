from math import exp

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String


class Switching(Fmi2Slave):
    """A room with a thermostat that acts every half second: the heater switches on below 20 degrees and off above
    22."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 30.0)
        self.T, self.on, self.switched, self.says = 15.0, True, 0, "cold"
        self.loss, self.enabled, self.most, self.name = 0.1, True, 1000, "hall"
        self.checks = 0
        output, parameter, fixed = Fmi2Causality.output, Fmi2Causality.parameter, Fmi2Variability.fixed
        discrete = Fmi2Variability.discrete
        self.register_variable(Real("T", causality=output))
        self.register_variable(Boolean("on", causality=output, variability=discrete))
        self.register_variable(Integer("switched", causality=output, variability=discrete))
        self.register_variable(String("says", causality=output, variability=discrete))
        self.register_variable(Real("loss", causality=parameter, variability=Fmi2Variability.tunable))
        self.register_variable(Boolean("enabled", causality=parameter, variability=fixed))
        self.register_variable(Integer("most", causality=parameter, variability=fixed))
        self.register_variable(String("name", causality=parameter, variability=fixed))

    def do_step(self, t, h):
        stop = t + h
        while t < stop:
            end = min(stop, 0.5 * (self.checks + 1))
            rest = 10.0 + (2.0 / self.loss if self.on else 0.0)
            self.T, t = rest + (self.T - rest) * exp(-self.loss * (end - t)), end
            if end == 0.5 * (self.checks + 1):
                self.switch()
        return True

    def switch(self):
        self.checks += 1
        on = self.enabled and self.switched < self.most and (self.T < 20.0 or (self.on and self.T < 22.0))
        self.switched += on != self.on
        self.on, self.says = on, f"{self.name} {'cold' if self.T < 20.0 else 'warm'}"
