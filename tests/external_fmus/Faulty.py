import ctypes
import os
import signal
import time

from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class Faulty(Fmi2Slave):
    """x = k t, for half a second; then the fault given by `kind` (0: none)."""

    KINDS = ("nothing", "hangs", "crashes", "raises", "prints", "is lost", "fails", "is stopped")

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 1.0)
        self.x, self.k, self.kind = 0.0, 1.0, 0
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        tunable = Fmi2Variability.tunable
        self.register_variable(Real("k", causality=Fmi2Causality.parameter, variability=tunable))
        self.register_variable(Integer("kind", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))

    def do_step(self, t, h):
        self.x = self.k * (t + h)
        if t < 0.5:
            return True
        kind = self.KINDS[self.kind]
        if kind == "hangs":
            time.sleep(1e6)
        elif kind == "crashes":
            ctypes.string_at(1)
        elif kind == "raises":
            raise ArithmeticError("what nobody expects")
        elif kind == "prints":
            print(f"I am at {t + h}", flush=True)
        elif kind == "is lost":
            self.x = float("nan")
        elif kind == "is stopped":
            os.kill(os.getpid(), signal.SIGSTOP)
        return kind != "fails"
