"""FMI 3.0 instances of fmpy with the method names of its FMI 2.0 slave, so that the same helpers work for both."""

from fmpy.fmi3 import FMU3Model, FMU3Slave


class Names:
    """FMI 2.0 names for functions that have another name or signature in FMI 3.0."""

    experiment = {}  # noqa: RUF012 - replaced, never mutated

    def setupExperiment(self, **experiment):
        self.experiment = experiment

    def reset(self):
        self.experiment = {}
        super().reset()

    def enterInitializationMode(self):
        super().enterInitializationMode(**self.experiment)

    def getReal(self, references):
        return self.getFloat64(references)

    def setReal(self, references, values):
        self.setFloat64(references, values)

    def getInteger(self, references):
        return self.getInt64(references)

    def setInteger(self, references, values):
        self.setInt64(references, values)

    def getRealOutputDerivatives(self, references, orders):
        return self.getOutputDerivatives(references, orders)

    def getFMUstate(self):
        return self.getFMUState()

    def setFMUstate(self, state):
        self.setFMUState(state)

    def freeFMUstate(self, state):
        self.freeFMUState(state)

    def serializeFMUstate(self, state):
        return self.serializeFMUState(state)

    def deSerializeFMUstate(self, content):
        return self.deserializeFMUState(content)


class Slave(Names, FMU3Slave):
    """An instance for co-simulation."""


class Model(Names, FMU3Model):
    """An instance for model exchange."""
