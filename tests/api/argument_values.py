"""Call the functions of the public API with arguments that make no sense, in a process with a time limit for each call.

The search of a fit and the native build before it are left out: its arguments are valid if the search begins.

python argument_values.py FOLDER [VALUE...]  prints JSON: [function, argument, value, outcome] for each call.
"""

import inspect
import json
import multiprocessing
import os
import sys
import tempfile
import warnings
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas

import harness

VALUES = {
    "0": 0,
    "-1": -1,
    "0.5": 0.5,
    "nan": float("nan"),
    "inf": float("inf"),
    "-inf": float("-inf"),
    "1e300": 1e300,
    "10**400": 10**400,
    "True": True,
    "''": "",
    "'x'": "x",
    "'8'": "8",
    "long text": "a" * 5000,
    "bytes": b"x",
    "bytearray": bytearray(b"1"),
    "[]": [],
    "[1]": [1],
    "[[0, 1], [2, 3]]": [[0, 1], [2, 3]],
    "[[0, 1], [2]]": [[0, 1], [2]],
    "[nan]": [float("nan")],
    "(None,)": (None,),
    "{}": {},
    "{'x': 5}": {"x": 5},
    "{'x': None}": {"x": None},
    "{1: 2}": {1: 2},
    "{'k': [nan]}": {"k": [float("nan")]},
    "set": {1},
    "object": object(),
    "function": len,
    "type": int,
    "complex": 1j,
    "None": None,
    "NUL": "a\0b",
    "surrogate": "\ud800",
    "0-d array": np.array(1.5),
    "2-d array": np.zeros((2, 2)),
    "np.bool": np.True_,
    "DataFrame": pandas.DataFrame({"a": ["b"]}),
    "Path": Path("nowhere"),
}
T = np.linspace(0.0, 6.0, 121)
X = np.exp(-0.1 * T) * np.cos(6.0 * T)
RECORD = pandas.DataFrame({"t [s]": T, "x [m]": X})
V = np.array([-0.3, -0.1, -0.03, -0.01, 0.01, 0.03, 0.1, 0.3])
CURVE = pandas.DataFrame({"v [m/s]": V, "F [N]": np.sign(V) + 2.0 * V})
CALLS = {  # valid arguments, in which one is replaced
    "simulate": {"source": "coulomb", "stop": 0.2},
    "compare": {"a": "coulomb", "b": "smd", "stop": 0.2},
    "identify_decay": {"record": T, "x": X, "unit": "m"},
    "identify_curve": {"record": CURVE},
    "fit": {"source": "smd", "records": RECORD, "free": {"k": (20.0, 60.0)}, "values": {"c": 0.2, "x0": 1.0}},
    "sweep": {"source": "coulomb", "grid": {"f": [0.5]}, "stop": 0.2},
    "sensitivity": {"source": "native/coulomb.fmu", "parameters": "f", "stop": 0.2},
    "orbit": {"source": "native/coulomb.fmu", "values": {"k": 100.0}},
    "map_motions": {"source": "native/coulomb.fmu", "over": {"k": [90.0, 100.0]}},
    "load_result": {"folder": "result"},
    "measure": {"t": T, "x": X, "v": X, "unit": "m"},
    "read_record": {"source": Path(__file__).parents[2] / "docs/records/spring.csv"},
    "describe": {"source": "coulomb"},
}
TIMEOUT = 60.0  # s for one call


class SearchBeganError(BaseException):
    """A fit has checked its arguments and records."""


def begin_search(*arguments):
    """Take the place of the search of a fit."""
    raise SearchBeganError


def call(function, argument, value):
    """Call a function with one argument replaced, and return the outcome."""
    arguments = CALLS[function] | {argument: VALUES[value]}
    if function == "identify_decay" and argument == "record":
        del arguments["x"]
    try:
        getattr(harness, function)(**arguments)
    except harness.HarnessError as error:
        return f"refused: {error}"
    except SearchBeganError:
        return "accepted"
    except BaseException as error:  # everything else is what the test looks for
        return f"{type(error).__name__}: {error}"[:300]
    return "accepted"


def answer(folder, connection):
    """Make the calls that the connection names, in a folder of its own."""
    warnings.simplefilter("ignore")
    os.chdir(tempfile.mkdtemp(dir=folder))
    for name in ("fmus", "native"):
        Path(name).symlink_to(Path(folder) / name)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    patch("harness.studies.fit.study.fit_records", begin_search).start()
    patch("harness.studies.fit.study.native_equivalent", lambda fmu: fmu).start()
    while True:
        connection.send(call(*connection.recv()))


def run(folder, values):
    """Yield each function, argument and value with the outcome of the call; replace a process that does not return."""
    context = multiprocessing.get_context("fork")
    process = None
    for function in CALLS:
        for argument in inspect.signature(getattr(harness, function)).parameters:
            for value in values:
                if process is None:
                    connection, other_end = context.Pipe()
                    process = context.Process(target=answer, args=(folder, other_end), daemon=True)
                    process.start()
                    other_end.close()
                connection.send((function, argument, value))
                outcome = "did not return"
                if connection.poll(TIMEOUT):
                    try:
                        outcome = connection.recv()
                    except EOFError:
                        outcome = "died"
                if outcome in ("did not return", "died"):
                    process.kill()
                    process.join()
                    process = None
                yield [function, argument, value, outcome]


if __name__ == "__main__":
    import fmpy
    import matplotlib.figure
    import scipy.integrate
    import scipy.optimize
    import xarray

    LIBRARIES = fmpy, matplotlib.figure, scipy.integrate, scipy.optimize, xarray  # once, before the forks
    root, *value_names = sys.argv[1:]
    for result in run(root, value_names or VALUES):
        print(json.dumps(result), flush=True)
