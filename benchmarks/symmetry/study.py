"""All runs of a model under all changes."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import floor
from pathlib import Path
from typing import Any

from fmus.compiler import BuildError
from harness.errors import HarnessError
from harness.process.temporary_directory import temporary_directory
from harness.simulation.fmu_instance import capture_stderr
from harness.simulation.variable_values import enumeration_labels

from .builds import PYTHON, model_label
from .changes import (
    FRAME,
    LARGEST_STEP,
    LONG,
    ORDER,
    ORDER_SLACK,
    REVOLUTIONS,
    SCALES,
    START_TIMES,
    TIME,
    UNITS,
    Change,
    add_revolutions,
    invert_signs,
    move_to_frame,
    raise_largest_step,
    scale_units,
    shift_start,
)
from .equations import Equations
from .long_run import DURATION, find_irregular_period, record_events
from .model_text import move_frame, reverse_declarations
from .motion import FmuRuns, Motion, TooManyStepsError, find_difference

HYBRID = "hybrid"  # law of friction
STIFF = ("rodas", "radau9")  # methods for stiff problems
TIME_UNIT = 2.0**-30  # s; the sum of a multiple and a start time is exact
LONG_RUN_TOLERANCE = 0.01  # of the relative tolerance of other runs
MAX_CUTS = 8  # of a run that needs too many steps
UNCHANGEABLE = {ORDER: "declarations need each other", FRAME: "no state is a velocity"}
ROUNDING = 1e-12  # relative tolerance of the closed form


@dataclass(frozen=True)
class Outcome:
    """What one change does to one run.

    Attributes
    ----------
    model, backend, method, law : str
        The run; `law` has the friction law and the other choices of the model.
    kind, text : str
        The symmetry and the change.
    difference : str
        First difference from the motion without the change; empty if there is none.
    reason : str
        Why the change does not apply; empty if it does.
    """

    model: str
    backend: str
    method: str
    law: str
    kind: str
    text: str
    difference: str = ""
    reason: str = ""


@dataclass(frozen=True)
class Options:
    """What is run: steps after which a run is shortened, changes of start and units, and the length of a long run.

    `starts` are in s, `scales` the exponents of 2 of mass, length and time, `long_run` in s.
    """

    max_steps: int = 4000
    starts: Sequence[float] = START_TIMES
    scales: Sequence[tuple[int, int, int]] = SCALES
    long_run: float = DURATION


DEFAULT = Options()
BuildFunction = Callable[[Path, str], Path]


def list_choices(runs: FmuRuns, methods: Sequence[str] = ()) -> list[dict[str, str]]:
    """Return all combinations of the enumerations of an FMU, by label; only these methods if any are given."""
    labels = {
        name: list(enumeration_labels(variable).values())
        for name, variable in runs.variables.items()
        if variable.causality == "parameter" and variable.type == "Enumeration"
    }
    if methods:
        labels["solver.method"] = [label for label in labels["solver.method"] if label in set(methods)]
    return [dict(zip(labels, row, strict=True)) for row in product(*labels.values())]


def run_shortened(runs: FmuRuns, values: Mapping[str, Any], max_steps: int) -> tuple[Motion, float]:
    """Run from 0 s; return the motion and its duration in s, which is shortened if it needs too many steps."""
    duration = runs.stop
    for _ in range(MAX_CUTS):
        try:
            return runs.run(values, 0.0, duration, max_steps), duration
        except TooManyStepsError as error:
            duration = floor(0.8 * error.share * duration / TIME_UNIT) * TIME_UNIT
    return Motion.from_failure(f"it needs more than {max_steps} steps for {duration} s"), duration


def effective_rtol(runs: FmuRuns, values: Mapping[str, Any]) -> float:
    """Return the relative tolerance of a run."""
    if values.get("solver.method") == "exact":
        return ROUNDING
    return float(values.get("solver.rtol", 0.0)) or float(runs.description.defaultExperiment.tolerance)


def run_model(
    source: Path,
    backend: str,
    build: BuildFunction,
    kinds: Sequence[str],
    methods: Sequence[str] = (),
    options: Options = DEFAULT,
) -> list[Outcome]:
    """Run one model under all changes, for each combination of its choices.

    Parameters
    ----------
    source : path
        Model file, or an FMU.
    backend : str
        One of BACKENDS.
    build : callable
        Returns the FMU of a model file for a backend.
    kinds : sequence of str
        Symmetries to examine.
    methods : sequence of str
        Integration methods; empty for all.
    options : Options

    Raises
    ------
    HarnessError
        If the model cannot be built.
    """
    with ExitStack() as stack:
        stack.enter_context(capture_stderr())
        try:
            model = Model(source, backend, build, kinds, options, stack)
        except BuildError as error:
            raise HarnessError(str(error)) from None
        return [outcome for values in list_choices(model.runs, methods) for outcome in model.examine(values)]


class Model:
    """The FMUs of a model: as it is, with declarations in another order, and in a moving frame.

    Parameters
    ----------
    source, backend, build, kinds, options
        As in `run_model`.
    stack : contextlib.ExitStack
        Closes the FMUs.
    """

    def __init__(
        self,
        source: Path,
        backend: str,
        build: BuildFunction,
        kinds: Sequence[str],
        options: Options,
        stack: ExitStack,
    ) -> None:
        self.label, self.backend, self.kinds, self.options = model_label(source), backend, kinds, options
        is_source = source.suffix == ".py"
        self.runs = stack.enter_context(FmuRuns(build(source, backend) if is_source else source))
        self.equations: Equations | str
        try:
            self.equations = Equations(build(source, PYTHON) if is_source else source)
        except HarnessError as error:
            self.equations = str(error)
        text = source.read_text() if is_source else ""
        self.frame = move_frame(text) if is_source else None
        texts = {ORDER: reverse_declarations(text) if is_source else "", FRAME: self.frame.text if self.frame else ""}
        folder = stack.enter_context(temporary_directory("symmetry-"))
        self.others: dict[str, FmuRuns | str] = {}
        for kind in (kind for kind in texts if kind in kinds):
            if not texts[kind]:
                self.others[kind] = UNCHANGEABLE[kind] if is_source else f"{source.name} is no model file"
                continue
            variant = folder / kind / source.name
            variant.parent.mkdir()
            variant.write_text(texts[kind])
            try:
                self.others[kind] = stack.enter_context(FmuRuns(build(variant, backend)))
            except BuildError as error:
                self.others[kind] = str(error)

    def examine(self, values: Mapping[str, Any]) -> Iterator[Outcome]:
        """Run with one combination of choices under all changes."""
        law = ", ".join(str(value) for name, value in values.items() if name != "solver.method")
        outcome = partial(Outcome, self.label, self.backend, values["solver.method"], law)
        base, duration = run_shortened(self.runs, values, self.options.max_steps)
        if base.failure:
            yield outcome("", "", reason=base.failure)
            return
        states = [] if isinstance(self.equations, str) else self.equations.states
        rtol = effective_rtol(self.runs, values)
        for kind in self.kinds:
            if kind == LONG:
                if values["solver.method"] == self.runs.default_method:
                    yield self.examine_long_run(outcome, values, rtol)
                continue
            changes = self.list_changes(kind, values, base, duration)
            if isinstance(changes, str):
                yield outcome(kind, "", reason=changes)
                continue
            for runs, change in changes:
                try:
                    changed_motion = runs.run(change.values, change.start, change.stop, 4 * self.options.max_steps)
                    difference = find_difference(base, changed_motion, change, states, rtol)
                except TooManyStepsError as error:
                    difference = f"stalls: {error}"
                yield outcome(kind, change.text, difference)

    def examine_long_run(self, outcome: Callable[..., Outcome], values: Mapping[str, Any], rtol: float) -> Outcome:
        """Run for a long time and compare the periods."""
        if not self.runs.modes or values.get("friction", HYBRID) != HYBRID:
            return outcome(LONG, "", reason="there are no events")
        # the error of a position that drifts with its driver is relative to its size, far above the motion in a period
        values = {**values, "solver.rtol": LONG_RUN_TOLERANCE * rtol}
        try:
            times, modes = record_events(self.runs, values, self.options.long_run)
        except HarnessError as error:
            if "diverges" in str(error):
                return outcome(LONG, "", reason="the motion diverges")
            return outcome(LONG, f"{self.options.long_run:g} s", f"fails: {error}")
        difference, has_period = find_irregular_period(times, modes, self.options.long_run, rtol)
        if not has_period:
            return outcome(LONG, "", reason="the motion has no period")
        return outcome(LONG, f"{self.options.long_run:g} s", difference)

    def list_changes(
        self, kind: str, values: Mapping[str, Any], base: Motion, duration: float
    ) -> list[tuple[FmuRuns, Change]] | str:
        """Return the changes of a run, each with the FMU that is run; or why there are none."""
        runs, law = self.runs, values.get("friction", HYBRID)
        if kind == TIME:
            return [(runs, change) for change in shift_start(values, duration, self.options.starts)]
        if kind == LARGEST_STEP:
            if law != HYBRID:
                return f"the law {law} chatters"
            return [(runs, change) for change in raise_largest_step(values, duration)]
        if kind in self.others:
            other = self.others[kind]
            if isinstance(other, str):
                return other
            if values["solver.method"] not in other.methods:
                return f"the changed model has no method {values['solver.method']}"
            if kind == ORDER:
                return [(other, Change(ORDER, "declarations reversed", values, 0.0, duration, slack=ORDER_SLACK))]
            assert self.frame
            if law != HYBRID:
                return f"the law {law} chatters"
            if other.default_method in STIFF and values["solver.method"] not in STIFF:
                return "a method for problems that are not stiff takes steps at the limit of its stability"
            return [(other, move_to_frame(other, self.frame, base, values, duration))]
        if isinstance(self.equations, str):
            return self.equations
        if kind == REVOLUTIONS:
            angles = self.equations.find_angles(runs, values)
            if law != HYBRID:
                return f"the law {law} chatters"
            if not angles:
                return "no start value is an angle that enters the equations by periodic functions only"
            return [(runs, change) for change in add_revolutions(runs, values, duration, angles)]
        if kind == UNITS:
            hidden_unit = self.equations.find_hidden_unit(runs, values)
            if hidden_unit:
                return f"not scalable: {hidden_unit}"
            return [(runs, scale_units(runs, values, duration, scale)) for scale in self.options.scales]
        odd = self.equations.find_odd_variables(runs, values)
        return odd if isinstance(odd, str) else [(runs, invert_signs(runs, values, duration, *odd))]
