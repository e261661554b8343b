"""Server side of worker_client.py: runs built FMUs in a process that does not import the sources.

One request per line: [instance or null, function, arguments]. One answer per line: {"value": ...}, or {"refused": [FMI
function, status]} if an FMI call does not return OK, or {"failed": traceback}.
"""

import ctypes
import itertools
import json
import os
import shutil
import sys
import tempfile
import traceback
from ctypes import c_double
from unittest.mock import patch

import fmpy
import numpy as np
from fmpy import calloc, extract, free, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Model
from fmpy.logging import addLoggerProxy

sys.path.insert(0, os.path.dirname(__file__))  # an isolated Python does not search the folder of its script

from fmi3_as_fmi2 import Model, Slave

FLAGS = ("again", "terminate", "nominals", "states")  # the outputs of fmi3UpdateDiscreteStates, in order


class Instance:
    """An FMI 2.0 co-simulation instance; its public methods are the requests."""

    def __init__(self, fmu, name):
        directory, description = fmu
        self.variables = {v.name: (v.valueReference, v.type) for v in description.modelVariables}
        self.states, self.log = [], []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self._on_log)
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(ctypes.byref(self.callbacks))
        identifier = description.coSimulation.modelIdentifier
        self.slave = FMU2Slave(
            guid=description.guid, modelIdentifier=identifier, unzipDirectory=directory, instanceName=name
        )
        self.slave.instantiate(callbacks=self.callbacks, loggingOn=True)

    def _on_log(self, environment, instance, status, category, message):
        self.log.append([status, (category or b"").decode(), (message or b"").decode()])

    def messages(self):
        """Return the log since the last call, as [status, category, text]."""
        log, self.log = self.log, []
        return log

    def set(self, values):
        for name, value in values.items():
            reference, kind = self.variables[name]
            (self.slave.setReal if kind == "Real" else self.slave.setInteger)([reference], [value])

    def get(self, names):
        return self._reader(names)()

    def vary_each(self, values, changes, names):
        """Read the named variables with `values` set, and then with each of the changes alone."""
        self.set(values)
        read = self._reader(names)
        rows = [read()]
        for name, value in changes.items():
            self.set({name: value})
            rows.append(read())
            self.set({name: values[name]})
        return rows

    def _reader(self, names):
        """Return a function that reads the named variables with one call per type."""
        reals = [i for i, name in enumerate(names) if self.variables[name][1] == "Real"]
        others = [i for i, name in enumerate(names) if self.variables[name][1] != "Real"]
        real_references = [self.variables[names[i]][0] for i in reals]
        other_references = [self.variables[names[i]][0] for i in others]

        def read():
            row = [None] * len(names)
            for i, value in zip(reals, self.slave.getReal(real_references) if reals else [], strict=True):
                row[i] = value
            for i, value in zip(others, self.slave.getInteger(other_references) if others else [], strict=True):
                row[i] = value
            return row

        return read

    def read(self, kind, references):
        """Read variables with the function of an FMI type, even if they have another type."""
        values = getattr(self.slave, f"get{kind}")(references)
        return [value.decode() if isinstance(value, bytes) else value for value in values]

    def read_one(self, kind, reference):
        """Read one variable in this way."""
        return self.read(kind, [reference])[0]

    def write_one(self, kind, reference, value):
        """Write one variable in this way."""
        getattr(self.slave, f"set{kind}")([reference], [value])

    def ramp(self, name, rate, order=1):
        self.slave.setRealInputDerivatives([self.variables[name][0]], [order], [rate])

    def output_rates(self, names, order=1):
        references = [self.variables[name][0] for name in names]
        return list(self.slave.getRealOutputDerivatives(references, [order] * len(names)))

    def setup(self, start, stop, tolerance):
        self.slave.setupExperiment(startTime=start, stopTime=stop, tolerance=tolerance)

    def enter(self):
        self.slave.enterInitializationMode()

    def exit(self):
        self.slave.exitInitializationMode()

    def init(self):
        self.enter()
        self.exit()

    def step(self, t, h):
        self.slave.doStep(t, h)

    def run(self, times, names):
        """Step through the times; return a row of values for each of them, including the first."""
        read = self._reader(names)
        rows = [read()]
        for t, ahead in itertools.pairwise(times):
            self.slave.doStep(t, ahead - t)
            rows.append(read())
        return rows

    def follow(self, t, stop, names):
        """Step from t to stop along solver.t_next; return the times and a row of values for each."""
        read, read_next = self._reader(names), self._reader(["solver.t_next"])
        times, rows = [t], [read()]
        while t < stop:
            ahead = read_next()[0]
            ahead = ahead if ahead < stop else stop  # NaN (a run that will fail) leads to the stop time
            if ahead <= t:
                raise AssertionError(f"solver.t_next is {ahead!r} at {t!r}: it does not lead on")
            self.slave.doStep(t, ahead - t)
            t = ahead
            times.append(t)
            rows.append(read())
        return times, rows

    def save(self):
        self.states.append(self.slave.getFMUstate())
        return len(self.states) - 1

    def restore(self, state):
        self.slave.setFMUstate(self.states[state])

    def serialize(self, state):
        return self.slave.serializeFMUstate(self.states[state]).hex()

    def deserialize(self, text):
        self.states.append(self.slave.deSerializeFMUstate(bytes.fromhex(text)))
        return len(self.states) - 1

    def reset(self):
        self.slave.reset()

    def terminate(self):
        self.slave.terminate()

    def free(self):
        for state in self.states:
            self.slave.freeFMUstate(state)
        self.slave.freeInstance()


class CoSimulation(Instance):
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
        flags = self.slave.updateDiscreteStates()[: len(FLAGS)]
        return [name for name, flag in zip(FLAGS, flags, strict=True) if flag]

    def enter_continuous_time(self):
        self.slave.enterContinuousTimeMode()

    def solve(self, times, names, method, rtol, ramp):
        """Integrate with scipy as a second importer; return the rows at the times and the number of derivative
        evaluations.

        The instance is at times[0], in continuous-time mode. `ramp` is {name: [value at time 0, rate, ...]} for inputs:
        the coefficients of a polynomial in time. An event is handled where an indicator is no longer positive, as in
        SUNDIALS.
        """
        from scipy.integrate import solve_ivp  # takes 0.3 s, and few processes need it

        read, t, rows, evaluations = self._reader(names), times[0], [], 0

        def set_point_and_inputs(t, y):
            self.set({name: sum(c * t**n for n, c in enumerate(powers)) for name, powers in ramp.items()})
            self.set_point(t, list(y))

        def rates(t, y):
            set_point_and_inputs(t, y)
            return self.rates()

        def indicator(i):
            def root(t, y):
                set_point_and_inputs(t, y)
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
                set_point_and_inputs(times[len(rows)], run.sol(times[len(rows)]))
                rows.append(read())
            if run.status != 1:
                return rows, evaluations
            t = ahead
            set_point_and_inputs(t, run.sol(t))
            self.enter_event_mode()
            self.update_discrete_states()
            self.enter_continuous_time()
        raise RuntimeError(f"events without end near t = {t!r} s")


class Worker:
    """The extracted FMUs and their instances."""

    def __init__(self, temporary_folder):
        self.temporary_folder, self.fmus, self.instances = temporary_folder, {}, []

    def instantiate(self, path, name):
        return self._new(path, name, CoSimulation)

    def exchange(self, path, name):
        return self._new(path, name, ModelExchange)

    def _new(self, path, name, kind):
        fmu = self.unpack(path)
        self.instances.append((Instance if fmu[1].fmiVersion == "2.0" else kind)(fmu, name))
        return len(self.instances) - 1

    def simulate(self, path, options):
        """Return {"columns": ..., "evaluations": of the derivatives} of fmpy.simulate_fmu, or {"error": text}.

        An `input` is given as [names, rows].
        """
        if "input" in options:
            names, rows = options["input"]
            rows = [tuple(row) for row in rows]
            options["input"] = np.array(rows, dtype=[(name, float) for name in ("time", *names)])
        (folder, options["model_description"]), count = self.unpack(path), [0]
        plain = FMU3Model.getContinuousStateDerivatives

        def count_and_call(*arguments):
            count[0] += 1
            return plain(*arguments)

        try:
            with patch.object(FMU3Model, "getContinuousStateDerivatives", count_and_call):
                table = fmpy.simulate_fmu(folder, **options)
        except Exception as error:
            return {"error": str(error)}
        return {"columns": {name: table[name].tolist() for name in table.dtype.names}, "evaluations": count[0]}

    def unpack(self, path):
        """Return the folder and the description of an FMU."""
        if path not in self.fmus:
            directory = extract(path, tempfile.mkdtemp(dir=self.temporary_folder))
            self.fmus[path] = directory, read_model_description(path)
        return self.fmus[path]

    def modules(self):
        """Return the files of all loaded modules."""
        files = [getattr(module, "__file__", None) for module in list(sys.modules.values())]
        return sorted(file for file in files if file)

    def directory(self, path):
        return str(self.fmus[path][0])

    def batch(self, requests):
        """Handle several requests, none of which may fail."""
        return [self.handle(*request) for request in requests]

    def handle(self, number, function, arguments):
        return getattr(self if number is None else self.instances[number], function)(*arguments)


def main():
    temporary_folder = tempfile.mkdtemp()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # output of an FMU must not be mistaken for an answer
    worker = Worker(temporary_folder)
    for line in sys.stdin:
        try:
            answer = {"value": worker.handle(*json.loads(line))}
        except FMICallException as refusal:
            answer = {"refused": [refusal.function, refusal.status]}
        except Exception:
            answer = {"failed": traceback.format_exc()}
        sys.stderr.flush()
        print(json.dumps(answer), file=answers, flush=True)
    shutil.rmtree(temporary_folder)


if __name__ == "__main__":
    main()
