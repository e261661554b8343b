"""life_cycles.py for FMI 3.0 FMUs: folders are used for co-simulation and model exchange in turn.

FMI 2.0 FMUs are handled by life_cycles.py.  python fmi3_life_cycles.py FUNCTION '[ARGUMENTS]'
"""

import json
import os
import sys
from ctypes import c_double

sys.path.insert(0, os.path.dirname(__file__))  # an isolated Python does not search the folder of its script

import life_cycles
from fmi3_as_fmi2 import Model, Slave

FMI2 = life_cycles.LifeCycle
kinds: dict = {}  # folder -> class


class CoSimulationLifeCycle(life_cycles.LifeCycle):
    """An instance for co-simulation."""

    interface = Slave

    def __init__(self, folder, name="life"):
        description = life_cycles.describe(folder)
        self.fmu = self.interface(
            guid=description.guid, unzipDirectory=folder, modelIdentifier=description.modelName, instanceName=name
        )
        declared = description.modelVariables
        self.outputs = [v.valueReference for v in declared if v.causality == "output" and v.type == "Float64"]
        self.fmu.instantiate()


class ModelExchangeLifeCycle(CoSimulationLifeCycle):
    """An instance for model exchange; a step is one Euler step followed by an event."""

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


def make_life_cycle(folder, name="life"):
    """Create an instance of the FMU in a folder."""
    if life_cycles.describe(folder).fmiVersion == "2.0":
        return FMI2(folder, name)
    return kinds.setdefault(folder, (CoSimulationLifeCycle, ModelExchangeLifeCycle)[len(kinds) % 2])(folder, name)


life_cycles.LifeCycle = make_life_cycle  # also in a spawned child, which imports this file too


if __name__ == "__main__":
    function, arguments = sys.argv[1], json.loads(sys.argv[2])
    print(json.dumps(getattr(life_cycles, function)(*arguments)))
