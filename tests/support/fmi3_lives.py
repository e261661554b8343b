"""lives.py with lives of FMI 3.0 FMUs: of the folders it is given, one is for co-simulation, one for model exchange.

Lives of FMI 2.0 FMUs are as ever.  python fmi3_lives.py FUNCTION '[ARGUMENTS]'
"""

import json
import os
import sys
from ctypes import c_double

sys.path.insert(0, os.path.dirname(__file__))  # an isolated Python does not look beside its script

import lives
from fmi3_slave import Model, Slave

FMI2 = lives.Life
kinds: dict = {}  # folder -> class


class Solving(lives.Life):
    """An instance for co-simulation."""

    interface = Slave

    def __init__(self, folder, name="life"):
        description = lives.describe(folder)
        self.fmu = self.interface(
            guid=description.guid, unzipDirectory=folder, modelIdentifier=description.modelName, instanceName=name
        )
        declared = description.modelVariables
        self.outputs = [v.valueReference for v in declared if v.causality == "output" and v.type == "Float64"]
        self.fmu.instantiate()


class Solved(Solving):
    """An instance for model exchange; a step is one of Euler's, and an event."""

    interface = Model

    def begin(self):
        super().begin()
        self.fmu.updateDiscreteStates()
        self.fmu.enterContinuousTimeMode()
        return self

    def step(self, t, ahead):
        size = self.fmu.getNumberOfContinuousStates()
        states, rates = (c_double * size)(), (c_double * size)()
        self.fmu.getContinuousStates(states, size)
        self.fmu.getContinuousStateDerivatives(rates, size)
        for i, rate in enumerate(rates):
            states[i] += (ahead - t) * rate
        self.fmu.setTime(ahead)
        self.fmu.setContinuousStates(states, size)
        self.fmu.enterEventMode()
        self.fmu.updateDiscreteStates()
        self.fmu.enterContinuousTimeMode()
        return self.read()


def life(folder, name="life"):
    """A life of the FMU in a folder."""
    if lives.describe(folder).fmiVersion == "2.0":
        return FMI2(folder, name)
    return kinds.setdefault(folder, (Solving, Solved)[len(kinds) % 2])(folder, name)


lives.Life = life  # also in a spawned child, which reads this file too


if __name__ == "__main__":
    function, arguments = sys.argv[1], json.loads(sys.argv[2])
    print(json.dumps(getattr(lives, function)(*arguments)))
