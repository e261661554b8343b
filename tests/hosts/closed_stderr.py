"""Run an FMU that reports an error while standard error is unusable: python closed_stderr.py run_all '[FMU, FAILURES]'.

Prints for each failure the log, the values read after the error, and the result of the run after a reset.
"""

import io
import json
import os
import sys
import tempfile
from math import isnan
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))  # an isolated Python searches no other folder

import worker
from fmpy.fmi1 import FMICallException


class BrokenStream:
    """A stream whose methods raise the given exceptions."""

    encoding = "utf-8"

    def __init__(self, **raising):
        self.raising = raising

    def write(self, text):
        if "write" in self.raising:
            raise self.raising["write"]

    def flush(self):
        if "flush" in self.raising:
            raise self.raising["flush"]


def no_reader():
    end, start = os.pipe()
    os.close(end)
    os.dup2(start, 2)


STDERR_FAILURES = {
    "none": lambda: setattr(sys, "stderr", None),
    "write raises": lambda: setattr(sys, "stderr", BrokenStream(write=RuntimeError("no"))),
    "flush raises": lambda: setattr(sys, "stderr", BrokenStream(flush=OSError(5, "no"))),
    "no methods": lambda: setattr(sys, "stderr", object()),
    "ASCII only": lambda: setattr(sys, "stderr", io.TextIOWrapper(io.BytesIO(), "ascii", "strict")),
    "an encoding that is none": lambda: setattr(sys, "stderr", BrokenStream(write=UnicodeError("no"))),
    "deleted": lambda: delattr(sys, "stderr"),
    # the following cannot be undone within a process
    "closed": lambda: sys.stderr.close(),
    "descriptor closed": lambda: os.close(2),
    "no reader": no_reader,
    "disk full": lambda: os.dup2(os.open("/dev/full", os.O_WRONLY), 2),
}


def run_all(path, failures):
    process = worker.Worker(tempfile.mkdtemp())
    return [run_without_stderr(failure, process, path) for failure in failures]


def run_without_stderr(failure, process, path):
    fmu = process.instances[process.instantiate(path, "Prüfstand")]
    STDERR_FAILURES[failure]()

    def begin():
        fmu.setup(0.0, None, None)
        fmu.init()
        fmu.step(0.0, 0.1)
        return fmu.get(["theta"])

    first = begin()
    fmu.set({"T_ext": float("nan")})
    try:
        fmu.step(0.1, 0.1)
        status = 0
    except FMICallException as refusal:
        status = refusal.status
    silent = all(isnan(value) for value in fmu.get(["theta", "omega", "alpha", "T_friction", "energy"]))
    fmu.read_one("Boolean", 10**6)
    log = fmu.messages()
    fmu.reset()
    answer = {"status": status, "silent": silent, "log": log, "recovered": begin() == first}
    fmu.free()
    return answer


if __name__ == "__main__":
    print(json.dumps({"run_all": run_all}[sys.argv[1]](*json.loads(sys.argv[2]))))
