from enum import Enum
from math import cos, sin

from pythonfmu3 import (
    DefaultExperiment,
    Dimension,
    Enumeration,
    EnumerationType,
    Float64,
    Fmi3Causality,
    Fmi3Slave,
    Fmi3Variability,
    String,
)


class Sense(Enum):
    left = 1
    right = 2


class Arrays(Fmi3Slave):
    """FMI 3.0: a point on a circle, and its rotation matrix; arrays, an enumeration and a string."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 1.0)
        self.time, self.omega, self.sense, self.begin, self.label = 0.0, 3.0, 1, [1.0, 0.0], "turning"
        output, parameter, fixed = Fmi3Causality.output, Fmi3Causality.parameter, Fmi3Variability.fixed
        discrete, continuous = Fmi3Variability.discrete, Fmi3Variability.continuous
        two, types = Dimension(start="2"), EnumerationType("Sense", values=Sense)
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        self.register_variable(Float64("turn", causality=output, dimensions=[two, two], getter=self.turn))
        self.register_variable(Float64("place", causality=output, dimensions=[two], getter=self.place))
        going = Enumeration("going", causality=output, variability=discrete, getter=lambda: self.sense)
        self.register_variable(going, var_type=types)
        self.register_variable(String("says", causality=output, variability=discrete, getter=lambda: self.label))
        self.register_variable(Float64("omega", causality=parameter, variability=Fmi3Variability.tunable))
        sense = Enumeration("sense", causality=parameter, variability=fixed)
        self.register_variable(sense, var_type=types)
        going.dimensions, going.size = sense.dimensions, sense.size = [], lambda variables: 1
        begin = {"getter": lambda: self.begin, "setter": self.put}
        self.register_variable(Float64("begin", causality=parameter, variability=fixed, dimensions=[two], **begin))
        self.register_variable(String("label", causality=parameter, variability=fixed))

    def put(self, values):
        self.begin = [*values]

    def turn(self):
        angle = (3 - 2 * self.sense) * self.omega * self.time
        return [cos(angle), -sin(angle), sin(angle), cos(angle)]

    def place(self):
        a, b, c, d = self.turn()
        x, y = self.begin
        return [a * x + b * y, c * x + d * y]

    def do_step(self, t, h):
        self.time = t + h
        return True
