"""Each rule of an argument, wherever the API has it: a value that is none is refused in one sentence."""

import inspect
from collections import defaultdict
from math import inf, nan

import argument_values
import numpy as np
import pytest

import harness

NO_NUMBER = ["x", b"1", True, np.True_, nan, inf, -inf, 10**400, 1j, [1.0], np.ones(2), object()]
NO_WHOLE_NUMBER = [0.5, -1, True, "x", [1], object()]
NO_TEXT = ["", "a\0b", "\ud800", b"x", 1, ["x"], object()]
NO_MAPPING = ["x", 1, [1], {1: 2}, object()]
INVALID = {  # by the words of the rule
    "a finite number": NO_NUMBER,
    "a finite number above 0": [*NO_NUMBER, 0, -1.0],
    "a finite number of at least 0": [*NO_NUMBER, -1.0],
    "a whole number from 1 to 10000000": [*NO_WHOLE_NUMBER, 0, 10_000_001],
    "a whole number from 1 to 1024": [*NO_WHOLE_NUMBER, 0, 1025],
    "a whole number of at least 0": NO_WHOLE_NUMBER,
    "true or false": [0, 1, "true", None, [True], object()],
    "a text that is not empty": NO_TEXT,
    "a name or a number": ["", "a\0b", b"x", 1j, 0.5, True, object()],
    "a name or a path": [*NO_TEXT, "a" * 5000],
    "a name, a path, or a list of these": ["", 1, [1], object()],
    "a name, or a list of names": ["", 1, [1], {"x": 1}, object()],
    "a name, or a list of names that is not empty": ["", 1, [], [1], {"x": 1}, object()],
    "a mapping from names to numbers or texts": [*NO_MAPPING, {"k": nan}, {"k": None}],
    "a mapping from names to numbers": NO_MAPPING,
    "a mapping from names to finite numbers above 0": [*NO_MAPPING, {"x": 0.0}, {"x": -1.0}, {"x": "y"}],
    "a row of finite numbers, at least one, which increase": [
        [],
        [0.0, 0.0],
        [1.0, 0.0],
        [nan],
        ["x"],
        1j,
        np.ones((2, 2)),
    ],
    "a function of one number, or False": ["x", 1, object()],
    "one of CoSimulation, ModelExchange": ["", "coSimulation", 1, object()],
    "one of position, velocity, acceleration": ["", "speed", 1, object()],
}


def find_arguments():
    """Return the arguments of all functions of the API, by the words of their rules."""
    arguments = defaultdict(list)
    for name in argument_values.CALLS:
        rules = inspect.getclosurevars(getattr(harness, name)).nonlocals["rules"]
        for argument, rule in rules.items():
            arguments[rule.text].append((name, argument))
    return arguments


ARGUMENTS = find_arguments()


@pytest.mark.parametrize("rule", ARGUMENTS)
def test_an_argument_names_its_rule(rule):
    for name, argument in ARGUMENTS[rule]:
        function = getattr(harness, name)
        is_optional = inspect.signature(function).parameters[argument].default is None
        for value in INVALID.get(rule, [1j, object()]):
            if value is None and is_optional:
                continue
            with pytest.raises(harness.HarnessError) as refusal:
                function(**argument_values.CALLS[name] | {argument: value})
            message = str(refusal.value)
            names_argument = f"{argument} = " in message and f" must be {rule}" in message
            names_part = message.startswith((f"{argument}: ", "unknown "))  # of a mapping or a row; one of several
            assert names_argument or names_part, (name, argument, value, message)
            assert "\n" not in message
