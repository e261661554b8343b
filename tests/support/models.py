"""Lists of all models, their variables, and combinations of laws and methods that tests iterate over."""

from copy import copy
from functools import cache
from itertools import combinations as choose
from itertools import product
from types import ModuleType

import pytest
from build_cache import ROOT
from variants import slow_after

from fmus.compiler.equations.model_file import ModelFile
from fmus.compiler.lowering import lowered_model, select_features, sibling_module
from fmus.compiler.model_lookup import find_model
from fmus.packaging.fmi_variables import declared_variables


def scalar_class(model):
    """Return the generated class of a model, by name, path or file object, whose runtime is not lowered."""
    source = model if isinstance(model, ModelFile) else find_model(model)
    module = ModuleType(f"fmus.generated_{source.name}")
    module.__package__ = "fmus"
    exec(compile(source.generated_source, f"{source.name}.py", "exec"), vars(module))
    return vars(module)[source.class_name]


MODELS = sorted(path.stem for path in (ROOT / "fmus").glob("*.py") if path.stem != "__init__")
BODIES = [name for name in MODELS if len(scalar_class(name)().states) == 2]  # position and speed are all their states
STICKSLIP_IN_CI = [  # the other models run in campaigns
    pytest.param(name, marks=() if name == "stickslip" else pytest.mark.campaign) for name in MODELS
]
EXAMPLE_MODELS = sorted((ROOT / "tests" / "example_models").glob("*.py"))  # as users write them, in files of their own
LARGER_MODELS = [  # with more states, more contacts, or limits that vary
    *(ROOT / "fmus" / "more" / f"{name}.py" for name in ("belt", "clutch", "lugre", "sleds", "stacked")),
    *sorted((ROOT / "tests" / "example_models" / "larger").glob("*.py")),
]
EXACT, ODE23, ODE45, DOP853, RODAS, RADAU9 = 1, 2, 3, 4, 5, 6
HYBRID, SIGN, THRESHOLD = 1, 2, 3


def model_class(name):
    """Return the class of a model as it is packed in the FMU (lowered to scalars)."""
    return lowered_model(name)


def runtime(name, part):
    """Return a runtime module as it is emitted for a model."""
    return sibling_module(lowered_model(name), f"runtime.{part}")


@cache
def declarations_of(name):
    """Return name and declaration of every variable of a model, in the order of the XML.

    They are those of the model before it is lowered, which takes a second, with the methods that its FMU has.
    """
    source = find_model(name)
    variables = dict(declared_variables(scalar_class(source)))
    method = variables["solver.method"] = copy(variables["solver.method"])
    methods = select_features(source).methods
    method.items = tuple(item for item in method.items if item[0] in methods)
    return variables


def outputs(name):
    """Return the names of the outputs; position and speed come first."""
    return [v for v, d in declarations_of(name).items() if d.causality == "output"]


def parameters(name):
    """Return names and declarations of the numeric parameters and inputs (no choices)."""
    return {v: d for v, d in declarations_of(name).items() if d.causality in ("parameter", "input") and not d.items}


def tunable(name):
    """Return those that may change during a run."""
    return {v: d for v, d in parameters(name).items() if d.variability != "fixed"}


def is_allowed(choices):
    """Return whether a combination of choices is valid: the closed form requires the hybrid law."""
    return not (choices.get("solver.method") == EXACT and choices.get("friction", HYBRID) != HYBRID)


def combinations(name):
    """Return every valid combination of the choices of a model, as values to set."""
    choices = {v: d for v, d in declarations_of(name).items() if d.items}
    items = [[value for _, value, _ in declaration.items] for declaration in choices.values()]
    return [
        values for values in (dict(zip(choices, row, strict=True)) for row in product(*items)) if is_allowed(values)
    ]


def experiment(name, values):
    """Return the run of a model for a combination of choices, as (model, values, stop time).

    Laws that chatter run as published, at rtol 1e-3, and only for a short time. So do non-stiff methods on a stiff
    model, which stop after its first slip: where friction should hold, they take arbitrarily many steps.
    """
    stop, method = scalar_class(name).stop_time, values["solver.method"]
    if values.get("friction", HYBRID) == HYBRID:
        is_stiff = declarations_of(name)["solver.method"].start in (RODAS, RADAU9)
        short = is_stiff and method not in (RODAS, RADAU9)
        return name, values if method == EXACT else {**values, "solver.rtol": 1e-5}, 0.4 * stop if short else stop
    return name, {**values, "solver.rtol": 1e-3, "solver.atol": 1e-6}, 0.4 * stop


def cover(groups):
    """Return a few of these cases, given with their properties, that have every property."""
    cases, missing_properties = [], set().union(*(properties for _, properties in groups))
    while missing_properties:
        case, properties = max(groups, key=lambda group: len(group[1] & missing_properties))
        cases.append(case)
        missing_properties -= properties
    return cases


def pairwise_cases(name, size=2):
    """Return a few combinations that contain every pair (`size` = 2) of choices."""
    return cover([(values, {*choose(values.items(), min(size, len(values)))}) for values in combinations(name)])


def traits(case):
    """Return what a case adds to others: the model with its law, the other choices, and a law in closed form."""
    name, values, _ = case
    law, method = values.get("friction"), values["solver.method"]
    return {(name, law), ("method", method), ("pin_load", values.get("pin_load")), (law, method == EXACT)}


CASES = [experiment(name, values) for name in MODELS for values in pairwise_cases(name)]  # every pair of choices
FEW_CASES = cover([(case, traits(case)) for case in CASES])  # every model, law and method


def label(case):
    """Return a readable test id: the model and the labels of its choices."""
    name, values, _ = case
    names = [item[0] for v, value in values.items() for item in declarations_of(name)[v].items if item[1] == value]
    return "-".join([name, *names])


def counts(name):
    """Return the names of the counters and of the last event time, as far as the model has them."""
    counters = ("solver.steps", "solver.rejected", "solver.evaluations", "solver.h", "events.count", "events.t_last")
    return [v for v in declarations_of(name) if v in counters]


def push(name):
    """Return the input of a model and a value that overcomes its friction."""
    entry = next((v for v, d in declarations_of(name).items() if d.causality == "input"), None)
    if entry is None:
        pytest.skip(f"{name} has no input")
    return entry, {"pendulum": 0.02}.get(name, 200.0)


# by default five cases, which have every model but smd and every method but radau9; all of them in CI
each_case = pytest.mark.parametrize("case", slow_after(5, [(case,) for case in FEW_CASES]), ids=label)
