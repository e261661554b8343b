"""Every structure of a model translates to C: contacts, laws, conditions, tables and inputs, in pairs."""

from dataclasses import replace

import pytest
from model_text import remove_unused
from variants import campaign_after

from fmus.compiler.lowering import lowered_model
from fmus.compiler.lowering.feature_selection import select_features
from fmus.compiler.model_lookup import find_model
from fmus.packaging.native.native_fmu import collect_sources

MODEL = """from fmus import HYBRID, SIGN, THRESHOLD, choose, fabs
from fmus import Contact, Input, Mode, Model, Output, Parameter, State, Table


class Block(Model):
    \"\"\"A block on a table that moves.\"\"\"

    m = Parameter(2.0, "kg", "mass", above=0.0)
    k = Parameter(500.0, "N/m", "stiffness", low=0.0)
    f = Parameter(5.0, "N", "friction", low=0.0)
    eps = Parameter(1e-3, "m/s", "speed below which the law `threshold` holds", above=0.0)
    F_ext = Input(0.0, "N", "force on the block")
    mu = Table([0.0, 0.1, 1.0], [5.0, 4.0, 4.5], "m/s", "N")

    x = State("m", "position", start=0.1)
    v = State("m/s", "speed", rate_of=x)
    z = State("m", "position of the table")
    w = State("m/s", "speed of the table", rate_of=z)
    mode = Mode()
    spring = Output("N", "force of the spring", {spring})
    F_friction = Contact("N", "friction force", mode=mode, slip={slip}, slide={slide}{laws})
    a = Output("m/s2", "acceleration", (F_ext - spring - F_friction) / m, rate_of=v)
    b = Output("m/s2", "acceleration of the table", {table_force} / m, rate_of=w)
"""
SLIPS = {"alone": ("v", "-k * z"), "coupled": ("v - w", "(F_friction - k * z)")}
LAWS = {
    "hybrid": "",
    "sign": ", laws=(HYBRID, SIGN)",
    "threshold": ", laws=(HYBRID, THRESHOLD), eps=eps",
}
SPRINGS = ("k * x", "choose(x > 0.0, k * x, 2.0 * k * x)")
SLIDES = ("f", "mu(fabs({}))")
PAIRS = {  # pairs of slip and law with pairs of spring and sliding force, so that any two of the four meet
    ("coupled", "threshold"): ((0, 1), (1, 0)),
    ("alone", "hybrid"): ((0, 0), (1, 1)),
    ("alone", "sign"): ((0, 1), (1, 0)),
    ("alone", "threshold"): ((0, 0), (1, 1)),
    ("coupled", "hybrid"): ((0, 1), (1, 0)),
    ("coupled", "sign"): ((0, 0), (1, 1)),
}


@pytest.mark.parametrize(("slip", "laws"), campaign_after(1, PAIRS))
def test_every_structure_translates_to_c(tmp_path, slip, laws):
    """Otherwise the build refuses the model: some conditions are known when a model is built, others in a run only."""
    speed, table_force = SLIPS[slip]
    for n, (spring, slide) in enumerate(PAIRS[slip, laws]):
        file = tmp_path / f"block{n}.py"
        forces = {"spring": SPRINGS[spring], "slide": SLIDES[slide].format(speed)}
        words = forces | {"slip": speed, "table_force": table_force}
        file.write_text(remove_unused(MODEL.format(laws=LAWS[laws], **words)))
        source = replace(find_model(file), has_input_derivatives=True)
        assert collect_sources(lowered_model(source, select_features(source)), "2")
