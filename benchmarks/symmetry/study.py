"""All runs of a model under all changes."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import floor
from pathlib import Path
from typing import Any

from fmus.packaging import BuildError
from fmus.packaging.model_lookup import MORE, model_names, more_model_names
from harness.errors import HarnessError
from harness.running.variable_values import enumeration_labels

from .builds import PYTHON, build
from .changes import MIRROR, ORDER, TIME, UNITS, Change, invert_signs, scale_units, shift_start
from .equations import Equations
from .model_text import reverse_declarations
from .motion import FmuRuns, Motion, TooManyStepsError, find_difference

MAX_STEPS = 4000  # of a run; longer ones are shortened
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


def model_label(source: Path) -> str:
    """Return the name of a model; with its folder, if a shipped model has the same name."""
    name = source.stem
    is_shipped = source.suffix == ".fmu" or source.parent in (MORE, MORE.parent)
    return f"{source.parent.name}/{name}" if not is_shipped and name in model_names() + more_model_names() else name


def list_choices(runs: FmuRuns, methods: Iterable[str] = ()) -> list[dict[str, str]]:
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
    for _ in range(8):
        try:
            return runs.run(values, 0.0, duration, max_steps), duration
        except TooManyStepsError as error:
            share = 0.8 * error.share * duration
            unit = 2.0 ** floor(-10 + 0.0) if share > 0.1 else 2.0**-30
            duration = max(unit, floor(share / unit) * unit)  # its sum with a start time is exact
    return runs.run(values, 0.0, duration, 10 * max_steps), duration


def effective_rtol(runs: FmuRuns, values: Mapping[str, Any]) -> float:
    """Return the relative tolerance of a run."""
    if values.get("solver.method") == "exact":
        return ROUNDING
    return float(values.get("solver.rtol", 0.0)) or float(runs.description.defaultExperiment.tolerance)


def run_model(
    source: Path,
    backend: str,
    folder: Path,
    kinds: Iterable[str],
    methods: Iterable[str] = (),
    max_steps: int = MAX_STEPS,
) -> Iterator[Outcome]:
    """Run one model under all changes, for each combination of its choices.

    Parameters
    ----------
    source : path
        Model file, or an FMU.
    backend : str
        One of BACKENDS.
    folder : path
        Folder of the built FMUs.
    kinds : iterable of str
        Symmetries to examine.
    methods : iterable of str
        Integration methods; empty for all.
    max_steps : int
        Steps after which a run is shortened.
    """
    kinds = [*kinds]
    if source.suffix == ".fmu":
        fmu = python_fmu = source
        other: Path | str = "needs the model file"
    else:
        fmu, python_fmu = build(source, backend, folder), build(source, PYTHON, folder)
        other = build_variant(source, backend, folder) if ORDER in kinds else ""
    try:
        equations: Equations | str = Equations(python_fmu)
    except HarnessError as error:
        equations = str(error)
    with FmuRuns(fmu) as runs:
        for values in list_choices(runs, methods):
            law = ", ".join(value for name, value in values.items() if name != "solver.method")
            outcome = partial(Outcome, model_label(source), backend, values["solver.method"], law)
            base, duration = run_shortened(runs, values, max_steps)
            if base.failure:
                yield outcome("", "", reason=base.failure)
                continue
            changes: list[Change] = shift_start(values, duration) if TIME in kinds else []
            if UNITS in kinds:
                hidden = equations if isinstance(equations, str) else equations.find_hidden_unit(runs, values)
                if hidden:
                    yield outcome(UNITS, "", reason=f"not scalable: {hidden}")
                else:
                    changes += scale_units(runs, values, duration)
            if MIRROR in kinds:
                odd = equations if isinstance(equations, str) else equations.find_odd_variables(runs, values)
                if isinstance(odd, str):
                    yield outcome(MIRROR, "", reason=f"no mirror image: {odd}")
                else:
                    changes.append(invert_signs(runs, values, duration, *odd))
            states = [name for name in ([] if isinstance(equations, str) else equations.states) if name in runs.outputs]
            compare = partial(compare_motions, base=base, states=states, rtol=effective_rtol(runs, values))
            for change in changes:
                yield outcome(change.kind, change.text, compare(runs, change, max_steps=4 * max_steps))
            if ORDER in kinds:
                if isinstance(other, str):
                    yield outcome(ORDER, "", reason=other)
                    continue
                change = Change(ORDER, "declarations reversed", values, 0.0, duration, slack=100.0)
                with FmuRuns(other) as other_runs:
                    yield outcome(ORDER, change.text, compare(other_runs, change, max_steps=4 * max_steps))


def compare_motions(runs: FmuRuns, change: Change, base: Motion, states: list[str], rtol: float, max_steps: int) -> str:
    """Return the first difference between a motion and what it must be after a change; empty if there is none."""
    try:
        changed = runs.run(change.values, change.start, change.stop, max_steps)
    except TooManyStepsError as error:
        return f"stalls: {error}"
    return find_difference(base, changed, change, states, rtol)


def build_variant(source: Path, backend: str, folder: Path) -> Path | str:
    """Return the FMU of a model whose declarations are in another order, or why there is none."""
    text = reverse_declarations(source.read_text())
    variant = folder / "reversed" / source.parent.name / source.name
    variant.parent.mkdir(parents=True, exist_ok=True)
    variant.write_text(text)
    try:
        return build(variant, backend, folder)
    except BuildError as error:
        return f"no other order: {error}"
