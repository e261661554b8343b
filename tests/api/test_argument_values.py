"""Every argument of every public function is used, or refused in one sentence."""

import inspect
import json
import os
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import argument_values
import commands
import pytest
from native_fmus import build_native_fmus

import harness

pytest.importorskip("pandas")
pytest.importorskip("xarray")

ABOVE_ZERO = {"0.5", "1e300", "0-d array"}
FINITE = {"0", "-1", *ABOVE_ZERO}
FLAG = {"True", "np.bool"}
NO_NAMES = {"[]", "{}"}  # of names
ACCEPTED_VALUES = {  # arguments by function, and the values that they may have; None as well if it is the default
    "simulate": {
        "values": {"{}"},
        "start": FINITE,
        "stop": ABOVE_ZERO,
        "interval": ABOVE_ZERO,
        "outputs": {"'x'"},
        "rtol": ABOVE_ZERO,
        "inputs": {"{}"},
        "timeout": ABOVE_ZERO,
        "lenient": FLAG,
        "progress": {"type"},
    },
    "compare": {"stop": ABOVE_ZERO, "rtol": ABOVE_ZERO, "timeout": ABOVE_ZERO, "lenient": FLAG, "progress": {"type"}},
    "identify_decay": {
        "unit": {"'x'", "'8'", "long text"},  # a unit that is not known is that of a sensor
        "k": ABOVE_ZERO,
        "mass": ABOVE_ZERO,
        "pendulum": FLAG,
        "drag": FLAG,
        "drift": FLAG,
        "begin": FINITE,
        "end": ABOVE_ZERO,
        "rate": ABOVE_ZERO,
        "progress": {"type"},
    },
    "identify_curve": {
        "points": FLAG,
        "mass": ABOVE_ZERO,
        "bias": {"0", "0.5", "-1", "0-d array"},
        "backlash": {"0"},
    },
    "fit": {
        "observe": {"'x'", *NO_NAMES},
        "inputs": NO_NAMES,
        "values": {"{}"},
        "sigma": {"{}", "{'x': 5}"},
        "start": {"{}"},
        "each": {"[]"},
        "against": {"[]"},
        "validate": {"[]"},
        "robust": FLAG,
        "rate": ABOVE_ZERO,
        "begin": FINITE,
        "end": ABOVE_ZERO,
        "timeout": ABOVE_ZERO,
        "progress": {"type", "function"},
    },
    "sweep": {
        "values": {"{}"},
        "seed": {"0", "10**400"},
        "measures": {"[]"},
        "stop": ABOVE_ZERO,
        "rtol": ABOVE_ZERO,
        "timeout": ABOVE_ZERO,
        "lenient": FLAG,
        "folder": {"'x'", "'8'", "Path"},
        "progress": {"type"},
    },
    "sensitivity": {
        "values": {"{}"},
        "start": FINITE,
        "stop": ABOVE_ZERO,
        "outputs": {"'x'"},
        "rtol": ABOVE_ZERO,
        "inputs": {"{}"},
        "timeout": ABOVE_ZERO,
        "lenient": FLAG,
        "progress": {"type"},
    },
    "orbit": {"values": {"{}"}, "inputs": {"{}"}, "section": {"'x'"}, "progress": {"type"}},
    "map_motions": {"values": {"{}"}, "inputs": {"{}"}, "section": {"'x'"}, "progress": {"type"}},
    "load_result": {},
    "measure": {"unit": {"'x'", "'8'", "long text"}},
    "read_record": {
        "unit": {"'x'", "'8'", "long text"},
        "rate": ABOVE_ZERO,
        "begin": FINITE,
        "end": ABOVE_ZERO,
    },
    "describe": {},
}


def test_all_functions_are_called():
    functions = {name for name in harness.__all__ if inspect.isfunction(getattr(harness, name))}
    assert functions == set(ACCEPTED_VALUES) == set(argument_values.CALLS)


@pytest.mark.campaign
def test_a_value_is_used_or_refused_in_one_sentence(fmus, tmp_path):
    """A refusal is a HarnessError within the time limit; nothing else is raised, and no process dies."""
    (tmp_path / "fmus").symlink_to(fmus)
    (tmp_path / "native").symlink_to(build_native_fmus())
    program = [sys.executable, Path(__file__).with_name("argument_values.py"), tmp_path]
    environment = os.environ | {"PYTHONPATH": str(commands.ROOT)}
    result = subprocess.run(program, env=environment, capture_output=True, text=True, timeout=3600)
    assert result.returncode == 0, result.stderr
    accepted_values, failures = defaultdict(set), []
    parameters = {
        (function, name): parameter
        for function in ACCEPTED_VALUES
        for name, parameter in inspect.signature(getattr(harness, function)).parameters.items()
    }
    results = [json.loads(line) for line in result.stdout.splitlines()]
    assert len(results) == len(parameters) * len(argument_values.VALUES)
    for function, argument, value, outcome in results:
        raised_by_user = (argument, value) == ("progress", "function") and outcome.startswith(
            "TypeError: object of type"
        )
        if outcome == "accepted":
            accepted_values[function, argument].add(value)
        elif not raised_by_user and (not outcome.startswith("refused: ") or "\n" in outcome):
            failures.append((function, argument, value, outcome))
    assert failures == []
    for (function, argument), parameter in parameters.items():
        optional = {"None"} if parameter.default is None else set()
        assert accepted_values[function, argument] <= ACCEPTED_VALUES[function].get(argument, set()) | optional, (
            argument
        )
