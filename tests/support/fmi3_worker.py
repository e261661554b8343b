"""worker.py for FMI 3.0: co-simulation and model-exchange instances, and complete runs by fmpy, in one process.

FMI 2.0 FMUs may be used in the same process.
"""

import os
import sys
from ctypes import c_double
from unittest.mock import patch

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Model
from scipy.integrate import solve_ivp

sys.path.insert(0, os.path.dirname(__file__))  # an isolated Python does not search the folder of its script

import worker
from fmi3_as_fmi2 import Model, Slave

FLAGS = ("again", "terminate", "nominals", "states")  # the outputs of fmi3UpdateDiscreteStates, in order


class CoSimulation(worker.Instance):
    """An FMI 3.0 co-simulation instance."""

    interface = Slave

    def __init__(self, fmu, name):
        directory, description = fmu
        kinds = {"Float64": "Real"}  # as in the base class
        self.variables = {v.name: (v.valueReference, kinds.get(v.type, v.type)) for v in description.modelVariables}
        self.states, self.log = [], []
        self.slave = self.interface(
            guid=description.guid,
            modelIdentifier=description.modelName,
            unzipDirectory=directory,
            instanceName=name,
        )
        self.slave.instantiate(loggingOn=True, logMessage=self._on_log_fmi3)

    def _on_log_fmi3(self, environment, status, category, message):
        self._on_log(environment, None, status, category, message)


class ModelExchange(CoSimulation):
    """An FMI 3.0 model-exchange instance."""

    interface = Model

    def sizes(self):
        """Return the numbers of continuous states and of event indicators."""
        return self.slave.getNumberOfContinuousStates(), self.slave.getNumberOfEventIndicators()

    def _vector(self, get, size):
        values = (c_double * size)()
        get(values, size)
        return list(values)

    def set_time(self, t):
        self.slave.setTime(t)

    def set_states(self, states):
        self.slave.setContinuousStates((c_double * len(states))(*states), len(states))

    def set_point(self, t, states):
        self.set_time(t)
        self.set_states(states)

    def get_states(self):
        return self._vector(self.slave.getContinuousStates, self.sizes()[0])

    def rates(self):
        return self._vector(self.slave.getContinuousStateDerivatives, self.sizes()[0])

    def indicators(self):
        return self._vector(self.slave.getEventIndicators, self.sizes()[1])

    def nominals(self):
        return self._vector(self.slave.getNominalsOfContinuousStates, self.sizes()[0])

    def enter_event_mode(self):
        self.slave.enterEventMode()

    def update_discrete_states(self):
        """Update the discrete states and return the names of the flags that are set."""
        *flags, timed, due = self.slave.updateDiscreteStates()
        self.ahead = due if timed else None
        return [name for name, flag in zip(FLAGS, flags, strict=True) if flag]

    def next_event_time(self):
        """Return the time of the next event from the last update, or None."""
        return self.ahead

    def enter_continuous_time(self):
        self.slave.enterContinuousTimeMode()

    def solve(self, times, names, method, rtol, ramp):
        """Integrate with scipy as a second importer; return the rows at the times and the number of derivative
        evaluations.

        The instance is at times[0], in continuous-time mode. `ramp` is {name: [value at time 0, rate]} for inputs. An
        event is handled where an indicator is no longer positive, as in SUNDIALS.
        """
        read, t, rows, evaluations = self._reader(names), times[0], [], 0

        def place(t, y):
            self.set({name: value + rate * t for name, (value, rate) in ramp.items()})
            self.set_point(t, list(y))

        def rates(t, y):
            place(t, y)
            return self.rates()

        def indicator(i):
            def root(t, y):
                place(t, y)
                return self.indicators()[i]

            root.terminal, root.direction = True, -1
            return root

        roots = [indicator(i) for i in range(self.sizes()[1])]
        absolute = [rtol * nominal for nominal in self.nominals()]
        for _ in range(500):  # more events than any run has
            options = {"rtol": rtol, "atol": absolute, "events": roots, "dense_output": True}
            run = solve_ivp(rates, (t, times[-1]), self.get_states(), method, **options)
            evaluations += run.nfev
            ahead = run.t[-1]
            if run.status == 1:  # at the root, up to the last digits
                near = (ahead + i * np.spacing(ahead) for i in range(1000))
                ahead = next(t for t in near if min(root(t, run.sol(t)) for root in roots) <= 0.0)
            while len(rows) < len(times) and (times[len(rows)] < ahead or run.status == 0):
                place(times[len(rows)], run.sol(times[len(rows)]))
                rows.append(read())
            if run.status != 1:
                return rows, evaluations
            t = ahead
            place(t, run.sol(t))
            self.enter_event_mode()
            self.update_discrete_states()
            self.enter_continuous_time()
        raise RuntimeError(f"events without end near t = {t!r} s")


class Worker(worker.Worker):
    """The extracted FMUs and their instances."""

    def instantiate(self, path, name):
        return self._new(path, name, CoSimulation)

    def exchange(self, path, name):
        return self._new(path, name, ModelExchange)

    def _new(self, path, name, kind):
        fmu = self.unpacked(path)
        self.instances.append((worker.Instance if fmu[1].fmiVersion == "2.0" else kind)(fmu, name))
        return len(self.instances) - 1

    def simulate(self, path, options):
        """Return {"columns": ..., "evaluations": of the derivatives} of fmpy.simulate_fmu, or {"error": text}.

        An `input` is given as [names, rows].
        """
        if "input" in options:
            names, rows = options["input"]
            rows = [tuple(row) for row in rows]
            options["input"] = np.array(rows, dtype=[(name, float) for name in ("time", *names)])
        (folder, options["model_description"]), count = self.unpacked(path), [0]
        plain = FMU3Model.getContinuousStateDerivatives

        def counted(*arguments):
            count[0] += 1
            return plain(*arguments)

        try:
            with patch.object(FMU3Model, "getContinuousStateDerivatives", counted):
                table = fmpy.simulate_fmu(folder, **options)
        except Exception as error:
            return {"error": str(error)}
        return {"columns": {name: table[name].tolist() for name in table.dtype.names}, "evaluations": count[0]}


if __name__ == "__main__":
    worker.Worker = Worker
    worker.main()
