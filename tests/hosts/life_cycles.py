"""Many life cycles of FMUs in one process: a test names a function of this file and its arguments; the result is JSON.

python life_cycles.py FUNCTION '[ARGUMENTS]'

An FMU is given as [path, interface]. The interface is CO_SIMULATION or, for FMI 3.0, MODEL_EXCHANGE.
"""

import ctypes
import gc
import json
import multiprocessing
import os
import sys
import threading
from ctypes import c_double
from functools import cache
from itertools import pairwise
from pathlib import Path
from shutil import rmtree

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))  # an isolated Python searches no other folder

import fmi3_as_fmi2

TIMES = [0.25 * i for i in range(9)]
MODEL_EXCHANGE = "ModelExchange"

describe = cache(read_model_description)


class LifeCycle:
    """An instance for co-simulation of an unpacked FMU: its folder and interface."""

    def __init__(self, fmu, name="life"):
        folder, interface = fmu
        description = describe(folder)
        kind = FMU2Slave if description.fmiVersion == "2.0" else fmi3_as_fmi2.Slave
        if interface == MODEL_EXCHANGE:
            kind = fmi3_as_fmi2.Model
        self.fmu = kind(
            guid=description.guid, unzipDirectory=folder, modelIdentifier=description.modelName, instanceName=name
        )
        outputs = [v for v in description.modelVariables if v.causality == "output"]
        self.outputs = [v.valueReference for v in outputs if v.type in ("Real", "Float64")]
        self.fmu.instantiate()

    def begin(self):
        self.fmu.setupExperiment(startTime=TIMES[0], stopTime=TIMES[-1])
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def step(self, t, ahead):
        self.fmu.doStep(t, ahead - t)
        return self.read()

    def read(self):
        return [value.hex() for value in self.fmu.getReal(self.outputs)]

    def run(self):
        return [self.step(t, ahead) for t, ahead in pairwise(TIMES)]

    def end(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


class ModelExchangeLifeCycle(LifeCycle):
    """An instance for model exchange of an FMI 3.0 FMU; a step is one Euler step followed by an event."""

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


def instantiate(fmu, name="life"):
    """Create an instance of an unpacked FMU."""
    return (ModelExchangeLifeCycle if fmu[1] == MODEL_EXCHANGE else LifeCycle)(fmu, name)


def unpack(fmu):
    """Unpack an FMU; return its folder and interface."""
    path, interface = fmu
    return extract(path), interface


class Heap(ctypes.Structure):
    """The result of mallinfo(3) of glibc."""

    _fields_ = [(name, ctypes.c_int) for name in ("_0", "_1", "_2", "_3", "mapped", "_5", "_6", "used", "_8", "_9")]


def memory():
    """Return the memory in use in the C heap and in the heap of Python, whose blocks average 64 bytes, in kB.

    The resident memory would show the same leak only after ten times as many life cycles.
    """
    gc.collect()
    tell = ctypes.CDLL(None).mallinfo
    tell.restype = Heap
    return (tell().mapped + tell().used + 64 * sys.getallocatedblocks()) / 1000


def run_in_turn(fmus, number):
    """Create, run, reset, run and free one FMU after another.

    Returns the number of distinct runs, the memory after a tenth of the life cycles and after all, and additions to
    sys.path.
    """
    unpacked_fmus, before, after = [unpack(fmu) for fmu in fmus], list(sys.path), []
    rows = {fmu: set() for fmu in unpacked_fmus}
    for i in range(number):
        fmu = unpacked_fmus[i % len(unpacked_fmus)]
        life = instantiate(fmu)
        rows[fmu].add(repr(life.begin().run()))
        life.fmu.reset()
        rows[fmu].add(repr(life.begin().run()))
        life.end()
        if i + 1 in (number // 10, number):
            after.append(memory())
    path = [entry for entry in sys.path if entry not in before]
    return {"runs": [len(runs) for runs in rows.values()], "memory": after, "path": path}


def run_interleaved(fmus, number):
    """Step all instances in turn while all exist; return the number of distinct runs and the memory per instance."""
    unpacked_fmus = [unpack(fmu) for fmu in fmus]
    fleet = [[instantiate(fmu, str(i)).begin() for i in range(5)] for fmu in unpacked_fmus]
    before = memory()
    for instances, fmu in zip(fleet, unpacked_fmus, strict=True):
        instances += [instantiate(fmu, str(i)).begin() for i in range(number)]
    per_instance = (memory() - before) / (number * len(fmus))
    rows = {}
    for t, ahead in pairwise(TIMES):
        for name, instances in enumerate(fleet):
            rows.setdefault((name, t), set()).update(repr(life.step(t, ahead)) for life in instances)
    for instances in reversed(fleet):
        for life in reversed(instances):
            life.end()
    return {"runs": max(map(len, rows.values())), "each": per_instance}


def unpack_for_every_run(fmu, number):
    """Unpack, run and delete repeatedly, as fmpy.simulate_fmu does; return early and late memory, libraries and
    sys.path."""
    before, after = list(sys.path), []
    for i in range(number):
        unpacked_fmu = unpack(fmu)
        instantiate(unpacked_fmu).begin().end()
        describe.cache_clear()
        rmtree(unpacked_fmu[0])
        if i + 1 in (number // 10, number):
            after.append(memory())
    with open("/proc/self/maps") as maps:
        libraries = len({line.split(maxsplit=5)[5] for line in maps if "/binaries/" in line})
    return {"memory": after, "libraries": libraries, "path": [entry for entry in sys.path if entry not in before]}


def run_in_threads(fmus, threads, turns):
    """Run life cycles of every FMU in several threads; return the number of distinct runs."""
    unpacked_fmus = [unpack(fmu) for fmu in fmus]
    for folder, _ in unpacked_fmus:
        describe(folder)  # now, because the XML parser occasionally fails in two threads at once
    rows, errors = {fmu: set() for fmu in unpacked_fmus}, []

    def work():
        try:
            for _ in range(turns):
                for fmu in unpacked_fmus:
                    life = instantiate(fmu)
                    rows[fmu].add(repr(life.begin().run()))
                    life.end()
        except BaseException as error:
            errors.append(repr(error))

    workers = [threading.Thread(target=work) for _ in range(threads)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    return {"runs": [len(runs) for runs in rows.values()], "errors": errors}


def continue_instances(instances, unpacked_fmus):
    """Return the next step of the given instances, and a complete run of each FMU."""
    return [life.step(TIMES[1], TIMES[2]) for life in instances], [
        instantiate(fmu).begin().run() for fmu in unpacked_fmus
    ]


def run_in_child(answers, *arguments):
    answers.put(continue_instances(*arguments))


def run_in_processes(fmus, method):
    """Carry instances into two forked children, or none into a spawned one; compare the children with the parent."""
    unpacked_fmus = [unpack(fmu) for fmu in fmus]
    instances = [instantiate(fmu).begin() for fmu in unpacked_fmus]
    for life in instances:
        life.step(TIMES[0], TIMES[1])
    if method == "spawn":
        instances = []
    context = multiprocessing.get_context(method)
    answers = context.Queue()
    children = [
        context.Process(target=run_in_child, args=(answers, instances, unpacked_fmus))
        for _ in range(2 if instances else 1)
    ]
    for child in children:
        child.start()
    results = [answers.get(timeout=60) for _ in children]
    for child in children:
        child.join(60)
    expected = continue_instances(instances, unpacked_fmus)
    return {"same": all(answer == expected for answer in results), "codes": [child.exitcode for child in children]}


def run_beside_sources(root, fmu_paths):
    """Run the FMUs in a host that has imported the sources and another pythonfmu; return the files of their code."""
    sys.path.insert(0, root)
    import pythonfmu

    import fmus.runtime.slave

    assert fmus.runtime.slave.Fmi2Slave is pythonfmu.fmi2slave.Fmi2Slave
    pythonfmu.fmi2slave.Fmi2Slave.do_step = None  # any use of it by an FMU would fail
    loaded_before = set(sys.modules)
    rows = run_each(fmu_paths)
    new = {getattr(sys.modules[name], "__file__", None) for name in set(sys.modules) - loaded_before}
    folders = (os.path.join(root, "fmus", ""), os.path.join(os.path.dirname(pythonfmu.__file__), ""))
    return {"rows": rows, "foreign": [file for file in new if file and file.startswith(folders)]}


def run_in_folder(fmu, folder):
    """Run the FMU unpacked into this folder."""
    path, interface = fmu
    life = instantiate((extract(path, folder), interface))
    rows = life.begin().run()
    life.end()
    return rows


def run_in_folders(fmu, folders):
    """Run the FMU unpacked into each of these folders."""
    return [run_in_folder(fmu, folder) for folder in folders]


def run_each(fmus):
    """Run each FMU once."""
    return [run_in_folder(fmu, None) for fmu in fmus]


if __name__ == "__main__":
    function, arguments = sys.argv[1], json.loads(sys.argv[2])
    print(json.dumps(globals()[function](*arguments)))
