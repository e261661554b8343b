"""Names of variables: those of attributes of generated models are refused, all others are right in every backend."""

import ast
from inspect import get_annotations

import numpy as np
import pytest
from build_cache import build_user_model
from models import scalar_class
from native_fmus import require_compiler
from variants import campaign_after

import fmus
import harness
from fmus.compiler import BuildError
from fmus.compiler.lowering import lowered_model
from fmus.compiler.model_lookup import find_model

HEAD = """from fmus import HYBRID, SIGN, Contact, Input, Mode, Model, Output, Parameter, State, choose

class Names(Model):
    '''Sleds on a belt.'''
    m = Parameter(1.0, "kg", "mass", above=0)
    k = Parameter(100.0, "N/m", "stiffness", low=0)
    f = Parameter(1.5, "N", "dry friction force", low=0)
    b = Parameter(0.05, "m", "position of a stop")
    x = State("m", "position", start=0.1)
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
"""
ONE_CONTACT = """    F = Contact("N", "friction force", mode=mode, slip=v, slide=f, hold=1.2 * f, laws=(HYBRID, SIGN))
    a = Output("m/s2", "acceleration", (-k * x - choose(x > b, k * (x - b), 0.0) - F{more}) / m, rate_of=v)
"""
TWO_CONTACTS = """    a_belt = Input(0.1, "m/s2", "acceleration of the belt")
    v_belt = Input(0.2, "m/s", "speed of the belt", rate=a_belt)
    v_drive = Parameter(0.1, "m/s", "speed of the driver")
    x_drive = State("m", "position of the driver", rate=v_drive)
    w = State("m/s", "speed of the upper sled")
    upper = Mode()
    F = Contact("N", "friction force", mode=mode, slip=v - v_belt, slide=f)
    G = Contact("N", "friction between the sleds", mode=upper, slip=w - v, slide=0.5 * f, hold=f)
    push = k * (x_drive - x) - choose(x > b, k * (x - b), 0.0) - F + G{more}
    a = Output("m/s2", "acceleration", push / m, rate_of=v)
    c = Output("m/s2", "acceleration of the upper sled", -G / m, rate_of=w)
"""
ROLES = {
    "parameter": '{name} = Parameter(0.1, "N", "ours")',
    "input": '{name} = Input(0.2, "N", "ours")',
    "state": '{name} = State("N", "ours", start=0.3, rate=-0.5)',
    "output": '{name} = Output("N", "ours", -0.25 * k * x)',
}
REFUSALS = (
    " is reserved by the solver or by C: choose another name.",
    " is reserved for the derivatives of v_belt: choose another name.",
)
LINUX = ("--platform", "linux64")
OTHER_CASES = [("", 1), ("", 2), ("", 3), ("native", 0), ("native/fmi3", 1)]
BACKENDS = {
    "": (),
    "native": ("--native", *LINUX),
    "native/fmi3": ("--fmi", "3", *LINUX),
}


def write(folder, body, **roles):
    """Write the model with forces of these names and roles, and return its path."""
    path = folder / "names.py"
    lines = [f"    {ROLES[role].format(name=name)}\n" for name, role in roles.items()]
    path.write_text(HEAD + "".join(lines) + body.format(more="".join(f" + {name}" for name in roles)))
    return path


def public_attributes(model):
    """Return the names of all attributes of a class and its instances, also of those that are only annotated."""
    annotated_names = {name for base in model.__mro__ for name in get_annotations(base)}
    return {name for name in {*dir(model), *vars(model()), *annotated_names} if not name.startswith("_")}


def used_names(body, folder):
    """Return the attributes of the class generated for a model, and the names in its methods, without its variables."""
    source = find_model(write(folder, body))
    names = {
        node.id.rstrip("123456789") for node in ast.walk(ast.parse(source.generated_source)) if hasattr(node, "id")
    }
    attributes = public_attributes(scalar_class(source)) | public_attributes(lowered_model(source))
    variable_names = {e.name for e in source.analysis.variables}
    return sorted(attributes - variable_names), sorted(names - attributes - variable_names - {*fmus.__all__})


def refusal(name, role, body, folder):
    """Return the message that refuses a variable, or an empty text."""
    try:
        find_model(write(folder, body, **{name: role})).generated_source  # noqa: B018
    except BuildError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("body", campaign_after(1, [ONE_CONTACT, TWO_CONTACTS]))
def test_an_attribute_of_a_generated_class_is_no_name_of_a_variable(body, tmp_path):
    """But the names of constants, as limit or A_F_F, are those that no variable has."""
    attributes, _ = used_names(body, tmp_path)
    refusals = {(name, role): refusal(name, role, body, tmp_path) for name in attributes for role in ROLES}
    assert all(message.endswith(REFUSALS) for message in refusals.values() if message)
    accepted_names = {name for (name, _), message in refusals.items() if not message}
    assert accepted_names == {name for name in attributes if name.startswith(("limit", "A_", "slide"))}
    assert {"rates", "stop_time", "condition_texts", "inconsistent_input"} <= {*attributes} - accepted_names


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("backend", "turn"),
    [("", 0), *(pytest.param(*case, marks=pytest.mark.campaign) for case in OTHER_CASES)],
)
def test_any_other_name_gives_the_same_motion(backend, turn, tmp_path):
    """Each name that the generated methods use, in each role."""
    if backend:
        require_compiler()
    attributes, others = used_names(TWO_CONTACTS, tmp_path)
    names = [name for name in attributes + others if not refusal(name, "input", TWO_CONTACTS, tmp_path)]
    roles = {name: [*ROLES][(index + turn) % len(ROLES)] for index, name in enumerate(names)}
    assert {"u", "A_F_F", "impulse_F", "scale_of_x_drive"} <= roles.keys()
    plain = {f"ours{index}": role for index, role in enumerate(roles.values())}
    columns = []
    for variant in roles, plain:
        path = write(tmp_path, TWO_CONTACTS, **variant)
        fmu = build_user_model(path, *BACKENDS[backend], "--method", "ode45") / backend / "names.fmu"
        result = harness.simulate(fmu, times=np.linspace(0.0, 0.5, 51))
        outputs = [name for name, role in variant.items() if role in ("state", "output")]
        columns.append([result[name] for name in ("x", "v", "w", "F", *outputs)])
    assert np.array_equal(*columns)
