"""A Python host that is interrupted while its FMU computes: python interrupted_host.py FUNCTION '[ARGUMENTS]'."""

import json
import os
import signal
import sys
import tempfile
from math import isnan
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))  # an isolated Python searches no other folder

import worker


class Stop(BaseException):
    """An exception that the signal handler of a host may raise."""

    def __init__(self, why, when):
        super().__init__(why, when)


def stop(*_):
    raise Stop("enough", 3)


HANDLERS = {
    "KeyboardInterrupt": signal.default_int_handler,
    "SystemExit": lambda *_: sys.exit(143),
    "Stop": stop,
}


def start_fmu(path):
    process = worker.Worker(tempfile.mkdtemp())
    fmu = process.instances[process.instantiate(path, "interrupted")]
    begin(fmu)
    return fmu


def begin(fmu):
    fmu.set({"solver.method": 2, "solver.rtol": 1e-9})  # ode23: computes for many seconds
    fmu.setup(0.0, None, None)
    fmu.init()


def interrupt(*_):
    os.kill(os.getpid(), signal.SIGINT)


def interrupt_long_step(path, handler):
    """Interrupt one very long step; return the exception, the log, the values, and whether a reset recovers."""
    signal.signal(signal.SIGINT, HANDLERS[handler])
    fmu = start_fmu(path)
    signal.signal(signal.SIGVTALRM, interrupt)
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.1)  # processor time: the step has begun, even on a loaded machine
    try:
        fmu.step(0.0, 1e7)
    except BaseException as error:
        exception = type(error).__name__, error.args
    answer = {"reached": exception, "log": fmu.messages(), "x": isnan(fmu.get(["x"])[0])}
    fmu.reset()
    begin(fmu)
    fmu.step(0.0, 0.1)
    answer["recovers"] = not isnan(fmu.get(["x"])[0])
    fmu.free()
    return answer


def interrupt_short_steps(path, times):
    """Interrupt short steps repeatedly, mostly at entry or exit of a call; return the exceptions that reach the
    host."""
    fmu, exceptions = start_fmu(path), []

    def ring(*_):
        raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, ring)
    for i in range(times):
        t = 0.0
        try:
            signal.setitimer(signal.ITIMER_REAL, 0.001 + 2.74e-5 * i)
            while True:
                fmu.step(t, 1e-5)
                t += 1e-5
                fmu.get(["x", "v"])
        except BaseException as error:
            exceptions.append(type(error).__name__)
        fmu.reset()
        begin(fmu)
    fmu.free()
    return sorted(set(exceptions)), len(exceptions)


if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]](*json.loads(sys.argv[2]))))
