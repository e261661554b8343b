"""One run of an FMU, step by step as told, to its end or to its refusal; what studies of stability and errors ask for.

Values go to the FMU as they are, unchecked: what it makes of NaN is the question.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from math import inf, isnan, nan
from time import perf_counter
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException

from ..errors import HarnessError
from ..scenes.fmus import fmu_of
from ..scenes.roles import roles
from .fmu import Heard, begin, described, loaded, put
from .specification import Specification
from .unpacked import kept
from .values import labels

Calls = list[tuple[float, float]]  # communication steps: from, size in s
Changes = dict[float, dict[str, float]]  # values by the time from which they hold, in s


@dataclass(frozen=True)
class Card:
    """What an FMU offers: its methods, the start value of every parameter and input, and the enumerations by label."""

    methods: tuple[str, ...]
    default: str  # method
    defaults: dict[str, float]
    choices: dict[str, dict[str, int]]
    stop: float

    def numbers(self, values: dict[str, Any]) -> dict[str, float]:
        """Values with their labels made numbers."""
        return {name: self.choices[name][value] if isinstance(value, str) else value for name, value in values.items()}


@dataclass(frozen=True)
class Setting:
    """What is set before a run; stop is None where the importer does not know it."""

    model: str
    values: dict[str, float]
    start: float = 0.0
    stop: float | None = None


@dataclass(frozen=True)
class Counts:
    """Changes of mode, internal steps accepted and refused, right-hand sides."""

    events: int
    steps: int
    rejected: int
    evaluations: int


@dataclass(frozen=True)
class Motion:
    """A run that came to its end: `x`, `v`, `energy` (n,) after each communication step, the start included; no energy
    where the FMU tells none.

    `t_last` is the time of the last event in s, the start where there was none.
    """

    x: np.ndarray
    v: np.ndarray
    energy: np.ndarray | None
    t_last: float
    counts: Counts
    seconds: float


@dataclass(frozen=True)
class Refusal:
    """A run that was refused: the FMU's sentence, and whether every calculated Real reads NaN."""

    sentence: str
    silent: bool


@dataclass(frozen=True)
class Refusals:
    """Many of them: how many were tried, and what went wrong."""

    tried: int
    wrong: tuple[str, ...]


def card(model: str) -> Card:
    """The card of a model's FMU."""
    description = described(Specification(fmu_of(model)))
    settable = [variable for variable in description.modelVariables if variable.causality in ("parameter", "input")]
    enumerations = {v.name: v for v in settable if v.type == "Enumeration"}
    choices = {name: {label: number for number, label in labels(v).items()} for name, v in enumerations.items()}
    defaults = {v.name: int(v.start) if v.name in choices else float(v.start) for v in settable}
    methods = {number: label for label, number in choices["solver.method"].items()}
    default = methods[int(defaults["solver.method"])]
    return Card(tuple(methods.values()), default, defaults, choices, float(description.defaultExperiment.stopTime))


class Probe:
    """An instance of an FMU that can be run anew and anew."""

    def __init__(self, description: Any, fmu: Any, heard: Heard) -> None:
        self.fmu, self.heard = fmu, heard
        self.variables = {variable.name: variable for variable in description.modelVariables}
        motion = roles(self.variables)
        if "velocity" not in motion:
            raise HarnessError(f"{description.modelName}: no output is the rate of a position, as derivative= says it")
        self.outputs = (motion["position"], motion["velocity"], *(["energy"] if "energy" in self.variables else []))

    def begin(self, setting: Setting) -> None:
        values = ((self.variables[name], value) for name, value in setting.values.items())
        begin(self.fmu, values, setting.start, setting.stop)

    def set(self, values: dict[str, float]) -> None:
        for name, value in values.items():
            put(self.fmu, self.variables[name], value)

    def reals(self, *causalities: str) -> list[str]:
        """The names of the Reals of some causalities."""
        return [v.name for v in self.variables.values() if v.type == "Real" and v.causality in causalities]

    def read(self, names: Iterable[str]) -> list[float]:
        return self.fmu.getReal([self.variables[name].valueReference for name in names])

    def count(self, name: str) -> int:
        return self.fmu.getInteger([self.variables[name].valueReference])[0] if name in self.variables else 0

    def refusal(self) -> Refusal:
        """What the FMU said when it refused."""
        return Refusal(self.heard.sentence, all(map(isnan, self.read(self.reals("output", "local")))))

    def forget(self) -> None:
        """A new beginning."""
        self.heard.forget()
        self.fmu.reset()


@contextmanager
def probe(model: str) -> Iterator[Probe]:
    """A fresh instance of a model's FMU, whose words are kept from the terminal."""
    wanted = Specification(fmu_of(model))
    found = described(wanted)
    with loaded(wanted, found, kept(wanted.fmu)) as (fmu, heard):
        yield Probe(found, fmu, heard)


def run(setting: Setting, calls: Calls, changes: Changes) -> Motion | Refusal:
    """Make the calls, with values changed at the times that `changes` holds; a row is read after each."""
    with probe(setting.model) as it:
        begun = perf_counter()
        try:
            it.begin(setting)
            rows = [it.read(it.outputs)]
            for t, h in calls:
                it.set(changes.get(t, {}))
                it.fmu.doStep(t, h)
                rows.append(it.read(it.outputs))
        except FMICallException:
            return it.refusal()
        seconds = perf_counter() - begun
        x, v, *energy = np.array(rows).T
        t_last = it.read(["events.t_last"])[0] if "events.t_last" in it.variables else setting.start
        counts = [it.count(name) for name in ("events.count", "solver.steps", "solver.rejected", "solver.evaluations")]
        return Motion(x, v, energy[0] if energy else None, t_last, Counts(*counts), seconds)


def poison(setting: Setting) -> Refusals:
    """NaN and both infinities in every Real that can be set, before the run and in the midst of it, one at a time.

    Each must be refused with a sentence that names it, and leave an FMU that runs again after a reset.
    """
    wrong, tried = [], 0
    with probe(setting.model) as it:
        for name, value, late in product(it.reals("parameter", "input"), (nan, inf, -inf), (False, True)):
            tried += 1
            it.forget()
            try:
                it.begin(setting if late else replace(setting, values={**setting.values, name: value}))
                it.fmu.doStep(0.0, 0.01)
                if late:
                    it.set({name: value})
                    it.fmu.doStep(0.01, 0.01)
                wrong.append(f"{name} = {value} was taken{' in mid-run' * late}")
            except FMICallException:
                refusal = it.refusal()
                if not (refusal.sentence.startswith(f"{name} = ") and refusal.silent):
                    wrong.append(f"{name} = {value}: {refusal.sentence or 'no sentence'}")
        it.forget()
        it.begin(setting)
        it.fmu.doStep(0.0, 0.01)
    return Refusals(tried, tuple(wrong))
