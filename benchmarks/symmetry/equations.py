"""The model class inside a Python FMU: whether it scales with its units, and which variables are odd in a mirror.

The equations are evaluated at random states, before and after a change of values.
"""

import random
from collections.abc import Iterator, Mapping
from itertools import product
from math import pi
from pathlib import Path
from typing import Any, cast

from harness.simulation.embedded_model import OK, load_model_class
from harness.simulation.variable_values import convert_value

from .changes import scale_values
from .motion import FmuRuns

N_POINTS = 8  # random states
MAX_CANDIDATES = 14  # variables whose sign is searched for
CHECKED_SCALE = (7, 11, -5)  # exponents of 2 of mass, length and time; no unit of the models has the factor 1
ROUNDING = 1e-9  # relative; a number with a hidden unit changes rates by far more

Numbers = tuple[float, ...]
Point = tuple[float, Numbers, Numbers]  # time in s, states and modes


class Equations:
    """Rates, slips and start values of the model in a Python FMU.

    Parameters
    ----------
    fmu : pathlib.Path
        Python FMU of the model.

    Raises
    ------
    HarnessError
        If it is not a Python FMU of this project.
    """

    def __init__(self, fmu: Path) -> None:
        self.model = cast(Any, load_model_class(fmu))
        rates: dict[str, str] = self.model.states
        self.states = list(rates)
        self.positions = {name: rate for name, rate in rates.items() if rate in rates}  # whose rates are states
        self.rate_indices = [i for i, name in enumerate(self.states) if name not in self.positions]

    def instantiate(self, values: Mapping[str, Any]) -> Any | None:
        """Return the model with these values, or None if it refuses them."""
        model = self.model()
        for name, value in values.items():
            if hasattr(model, name):
                setattr(model, name, value)
        return model if model.prepare() == OK else None

    def start_states(self, values: Mapping[str, Any]) -> Numbers:
        """Return the states at the start of a run; none if the model refuses the values."""
        model = self.instantiate(values)
        return () if model is None else as_tuple(model.initial_state(0.0))

    def evaluate(self, model: Any, point: Point) -> tuple[Numbers, Numbers]:
        """Return the rates that are no states, and the slips of coupled contacts; none if they are undefined."""
        t, states, modes = point
        try:
            slips = as_tuple(model.slip_velocities(t, *states)) if model.is_coupled else ()
            return as_tuple(model.rates(t, *states, *map(int, modes))), slips
        except (ArithmeticError, ValueError):
            return (), ()

    def random_points(self) -> Iterator[Point]:
        """Yield random times, states and modes."""
        rng = random.Random(1)
        for _ in range(N_POINTS):
            states = tuple(rng.uniform(-1.0, 1.0) for _ in self.states)
            yield rng.uniform(0.0, 1.0), states, tuple(rng.choice((-1.0, 1.0)) for _ in self.model.contacts)

    def find_hidden_unit(self, runs: FmuRuns, values: Mapping[str, Any]) -> str:
        """Return why the equations do not scale with the units of the variables; empty if they do."""
        scaled_values, factors = scale_values(runs, values, CHECKED_SCALE)
        seconds = 2.0 ** CHECKED_SCALE[2]
        original, scaled_model = (
            self.instantiate(model_values(runs, settings)) for settings in (values, scaled_values)
        )
        if original is None or scaled_model is None:
            return "the model refuses scaled values"
        units = [factors[name] for name in self.states]
        starts = as_tuple(original.initial_state(0.0)), as_tuple(scaled_model.initial_state(0.0))
        for name, factor, a, b in zip(self.states, units, *starts, strict=True):
            if not is_close(b, a * factor):
                return f"the start value of {name} is a number with a unit"
        slip_factors: dict[int, float] = {}
        for t, states, modes in self.random_points():
            rates, slips = self.evaluate(original, (t, states, modes))
            scaled_point = t * seconds, multiply(units, states), modes
            scaled_rates, scaled_slips = self.evaluate(scaled_model, scaled_point)
            if not (rates and scaled_rates):
                continue
            for a, b, i in zip(rates, scaled_rates, self.rate_indices, strict=True):
                if not is_close(b, a * units[i] / seconds):
                    return f"the rate of {self.states[i]} contains a number with a unit"
            for k, (a, b) in enumerate(zip(slips, scaled_slips, strict=True)):
                if a != 0.0 and not is_close(b, a * slip_factors.setdefault(k, b / a)):
                    return "a slip contains a number with a unit"
        return ""

    def find_angles(self, runs: FmuRuns, values: Mapping[str, Any]) -> dict[str, str]:
        """Return the angles of which whole revolutions change no rate, slip and margin, each with its start parameter.

        The parameter sets the start value of one angle and enters no equation.
        """
        start, turn, angles = model_values(runs, values), 2.0 * pi, {}
        for setter in (name for name in start if getattr(runs.variables[name], "unit", None) == "rad"):
            model, turned_model = self.instantiate(start), self.instantiate(start | {setter: start[setter] + turn})
            if model is None or turned_model is None:
                continue
            starts = as_tuple(model.initial_state(0.0)), as_tuple(turned_model.initial_state(0.0))
            shifts = [b - a for a, b in zip(*starts, strict=True)]
            if sorted(shifts)[:-1] != [0.0] * (len(shifts) - 1) or not is_close(max(shifts), turn):
                continue
            index = shifts.index(max(shifts))
            points = list(self.random_points())
            images = [(t, (*y[:index], y[index] + turn, *y[index + 1 :]), modes) for t, y, modes in points]
            if all(
                self.are_equal(self.evaluate_all(model, a), self.evaluate_all(turned_model, b))
                for a, b in zip(points, images, strict=True)
            ):
                angles[self.states[index]] = setter
        return angles

    def evaluate_all(self, model: Any, point: Point) -> Numbers:
        """Return rates, slips and margins of conditions; none if they are undefined."""
        t, states, modes = point
        rates, slips = self.evaluate(model, point)
        if not model.has_conditions or not rates:
            return rates + slips
        margins = model.condition_margins(t, *states, *map(int, modes))
        return rates + slips + margins[: len(margins) // 2]

    @staticmethod
    def are_equal(a: Numbers, b: Numbers) -> bool:
        """Return whether numbers are equal up to rounding, relative to the largest."""
        size = max(map(abs, a), default=0.0)
        return len(a) == len(b) and all(abs(x - y) <= ROUNDING * size for x, y in zip(a, b, strict=True))

    def find_odd_variables(self, runs: FmuRuns, values: Mapping[str, Any]) -> tuple[list[str], dict[str, int]] | str:
        """Return the parameters and inputs to invert, and the signs of the states; or why there is no mirror image.

        The signs s satisfy rates(s y, s p, -modes) = s rates(y, p, modes), and slips likewise with the sign -1, at
        random states y and values p.
        """
        candidates = [
            name
            for name, variable in runs.variables.items()
            if variable.causality in ("parameter", "input")
            and name in runs.exponents
            and not name.startswith("solver.")
            and not (variable.min is not None and float(variable.min) >= 0.0)
        ]
        free = [self.states[i] for i in self.rate_indices]  # a position has the sign of its speed
        if len(candidates) + len(free) > MAX_CANDIDATES:
            return f"more than {MAX_CANDIDATES} variables may be odd"
        rng = random.Random(2)
        start = model_values(runs, values)
        drawn_values = {name: rng.uniform(0.1, 1.0) for name in candidates}  # because zero has no sign
        points = list(self.random_points())
        original = self.instantiate(start | drawn_values)
        if original is None:
            return "the model refuses random values"
        expected = [self.evaluate(original, point) for point in points]
        for parameter_signs in product((1, -1), repeat=len(candidates)):
            inverted_values = {
                name: sign * drawn_values[name] for name, sign in zip(candidates, parameter_signs, strict=True)
            }
            model = self.instantiate(start | inverted_values)
            if model is None:
                continue
            for free_signs in product((-1, 1), repeat=len(free)):
                signs = dict(zip(free, free_signs, strict=True))
                for name in reversed(self.positions):
                    signs[name] = signs[self.positions[name]]
                factors = [signs[name] for name in self.states]
                if -1 in factors and self.is_mirror(model, factors, points, expected):
                    odd = [name for name, sign in zip(candidates, parameter_signs, strict=True) if sign < 0]
                    odd = self.add_start_values(start, odd, candidates, signs)
                    images = self.start_states(start | {name: -start[name] for name in odd})
                    if images != multiply(factors, self.start_states(start)):
                        return "a start value that is a number cannot be inverted"
                    return odd, signs
        return "the equations have none"

    def is_mirror(
        self, model: Any, factors: list[int], points: list[Point], expected: list[tuple[Numbers, Numbers]]
    ) -> bool:
        """Return whether the inverted states have the inverted rates and slips."""
        for (t, states, modes), (rates, slips) in zip(points, expected, strict=True):
            found_rates, found_slips = self.evaluate(
                model, (t, multiply(factors, states), tuple(-mode for mode in modes))
            )
            inverted_rates = multiply([factors[i] for i in self.rate_indices], rates) if rates else ()
            if not rates or found_rates != inverted_rates or found_slips != tuple(-slip for slip in slips):
                return False
        return True

    def add_start_values(
        self, start: dict[str, Any], odd: list[str], candidates: list[str], signs: Mapping[str, int]
    ) -> list[str]:
        """Return the odd variables with those that set the start values of odd states, which no rate contains."""
        equal = start | dict.fromkeys(candidates, 0.5)
        for candidate in candidates:
            starts = self.start_states(equal), self.start_states(equal | {candidate: 0.75})
            if all(starts):
                is_set = {name for name, a, b in zip(self.states, *starts, strict=True) if a != b}
                if candidate not in odd and any(signs[name] < 0 for name in is_set):
                    odd = [*odd, candidate]
        return odd


def as_tuple(numbers: Any) -> Numbers:
    """Return the result of a function that returns a number for a single value."""
    return numbers if isinstance(numbers, tuple) else (numbers,)


def multiply(factors: list[float] | list[int], numbers: Numbers) -> Numbers:
    """Return the products of factors and numbers."""
    return tuple(factor * number for factor, number in zip(factors, numbers, strict=True))


def is_close(value: float, expected: float) -> bool:
    """Return whether two numbers are equal up to rounding."""
    return abs(value - expected) <= ROUNDING * max(abs(value), abs(expected))


def model_values(runs: FmuRuns, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of all parameters and inputs of the model: Reals, and numbers of enumerations."""
    return {
        name: convert_value(variable, values[name]) if name in values else runs.start_value(name)
        for name, variable in runs.variables.items()
        if variable.causality in ("parameter", "input") and "." not in name
    }
