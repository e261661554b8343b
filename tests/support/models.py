"""The list that completeness walks: every model file, its declared variables, and every law with every method."""

from functools import cache
from itertools import combinations as choose
from itertools import product

import pytest
from build_cache import ROOT

from fmus.packaging.lowering import lowered_model, sibling_module
from fmus.packaging.model_lookup import find_model
from fmus.runtime.variable_declarations import Choice, Input, Output, Parameter, variables

MODELS = sorted(path.stem for path in (ROOT / "fmus").glob("*.py") if path.stem != "__init__")
BODIES = [
    name for name in MODELS if len(find_model(name).model().states) == 2
]  # position and speed are all their states
EXAMPLE_MODELS = sorted((ROOT / "tests" / "example_models").glob("*.py"))  # as users write them, in files of their own
LARGER_MODELS = sorted((ROOT / "tests" / "example_models" / "larger").glob("*.py"))  # of more states, or more contacts
EXACT, ODE23, ODE45, DOP853, RODAS = 1, 2, 3, 4, 5
HYBRID, SIGN, THRESHOLD = 1, 2, 3


def model_class(name):
    """The class of a model as it travels: written out."""
    return lowered_model(name)


def runtime(name, part):
    """A file of the runtime as it is written out for a model."""
    return sibling_module(lowered_model(name), f"runtime.{part}")


@cache
def declared(name):
    """Name and declaration of every variable of a model, in the order of the XML."""
    return dict(variables(find_model(name).model()))


def outputs(name):
    """Names of the outputs; position and speed come first."""
    return [v for v, d in declared(name).items() if isinstance(d, Output)]


def is_pushed(name):
    """Whether a model has an input and a mass m, and starts where and as fast as it is told."""
    x, v, *_ = outputs(name)
    return {"m", f"{x}0", f"{v}0"} <= {*declared(name)} and any(isinstance(d, Input) for d in declared(name).values())


PUSHED = [name for name in MODELS if is_pushed(name)]


def parameters(name):
    """Names and declarations of what takes a number: parameters and inputs, but no choices."""
    kinds = (Parameter, Input)
    return {v: d for v, d in declared(name).items() if isinstance(d, kinds) and not isinstance(d, Choice)}


def tunable(name):
    """Those of them that may change in mid-run."""
    return {v: d for v, d in parameters(name).items() if d.variability != "fixed"}


def is_allowed(choices):
    """Whether a combination of choices makes sense: the closed form needs the hybrid law."""
    return not (choices.get("solver.method") == EXACT and choices.get("friction", HYBRID) != HYBRID)


def combinations(name):
    """Every allowed combination of a model's choices, as values to set."""
    choices = {v: d for v, d in declared(name).items() if isinstance(d, Choice)}
    items = [[value for _, value, _ in declaration.items] for declaration in choices.values()]
    return [
        values for values in (dict(zip(choices, row, strict=True)) for row in product(*items)) if is_allowed(values)
    ]


def experiment(name, values):
    """One run that tests share: (model, values, stop time).

    Laws that chatter run as published, at rtol 1e-3, and not for long, nor do methods that are not for a stiff model,
    but beyond its first slip: where friction should hold, they take steps without number.
    """
    stop, method = find_model(name).model.stop_time, values["solver.method"]
    if values.get("friction", HYBRID) == HYBRID:
        stiff = declared(name)["solver.method"].start == RODAS != method
        return name, values if method == EXACT else {**values, "solver.rtol": 1e-5}, 0.4 * stop if stiff else stop
    return name, {**values, "solver.rtol": 1e-3, "solver.atol": 1e-6}, 0.4 * stop


def pairwise_cases(name, many=2):
    """A few combinations in which every so many choices meet: every two, though not every three."""
    groups = [(values, {*choose(values.items(), min(many, len(values)))}) for values in combinations(name)]
    kept, missing = [], set().union(*(each for _, each in groups))
    while missing:
        values, met = max(groups, key=lambda group: len(group[1] & missing))
        kept.append(values)
        missing -= met
    return kept


CASES = [experiment(name, values) for name in MODELS for values in pairwise_cases(name)]


def label(case):
    """A readable test id: the model and the labels of its choices."""
    name, values, _ = case
    names = [item[0] for v, value in values.items() for item in declared(name)[v].items if item[1] == value]
    return "-".join([name, *names])


def counts(name):
    """Names of the counts and of the time of the last event, where the model has them: a run's whole history."""
    wanted = ("solver.steps", "solver.rejected", "solver.evaluations", "solver.h", "events.count", "events.t_last")
    return [v for v in declared(name) if v in wanted]


def push(name):
    """The input of a model, and a size that overcomes its friction."""
    entry = next((v for v, d in declared(name).items() if isinstance(d, Input)), None)
    if entry is None:
        pytest.skip(f"{name} has no input")
    return entry, {"pendulum": 0.02}.get(name, 200.0)


def write_growing_friction_model(folder):
    """A file of the two sleds, in which the first one's sliding friction is not known beforehand: it grows with its
    way."""
    (sleds,) = (path for path in LARGER_MODELS if path.stem == "sleds")
    text = sleds.read_text().replace("import Contact", "import fabs, Contact")
    text = text.replace("    x1 =", '    wear = Parameter(1.0, "N/m", "how friction grows")\n    x1 =')
    (folder / "growing.py").write_text(
        text.replace("slide=slide1", "slide=slide1 + wear * fabs(x1)").replace("class Sleds", "class Growing")
    )
    return folder / "growing.py"
