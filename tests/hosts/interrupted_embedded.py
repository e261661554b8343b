"""Interrupt the code inside an FMU at function entry, in any Python that runs this file (3.9 or newer).

python interrupted_embedded.py RESOURCES: prints for every entry point what reaches the caller and what the FMU reports.
"""

import ctypes
import io
import json
import signal
import sys
from functools import partial
from importlib import import_module
from operator import methodcaller
from pathlib import Path


class Stop(BaseException):
    """An exception that the signal handler of a host may raise."""


def stop(*_):
    raise Stop("enough", 3)


def interrupt_call(slave, name, arguments):
    """Call a method with an interrupt pending; no Python code runs between the interrupt and the call, as in the
    native layer."""
    trip, queue = ctypes.pythonapi["PyErr_SetInterrupt"], slave._get_log_queue()
    calls = trip, partial(getattr(slave, name), *arguments), queue.clear
    try:
        list(map(methodcaller("__call__"), calls))
    except BaseException as error:
        return [type(error).__name__, error.args, sys.stderr.getvalue().splitlines()[-1]]


ENTRIES = {
    **{"get_real": [[0]], "set_real": [[0], [1.0]], "get_integer": [[0]], "setup_experiment": [0.0]},
    **{"do_step": [0.0, 0.1], "exit_initialization_mode": [], "_get_fmu_state": []},
}


def main(resources):
    sys.path.insert(0, resources)
    entry = import_module(Path(resources, "slavemodule.txt").read_text().strip())
    signal.signal(signal.SIGINT, stop)
    sys.stderr = io.StringIO()

    def new_instance():
        slave = entry.Stickslip(instance_name="embedded", resources=resources, logger=None, visible=False)
        slave.exit_initialization_mode()
        return slave

    return {name: interrupt_call(new_instance(), name, arguments) for name, arguments in ENTRIES.items()}


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1])))
