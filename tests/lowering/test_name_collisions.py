"""The results do not depend on the names of the variables of a model."""

import re

import pytest
from build_cache import build_user_model
from internal_steps import prepared_run, start
from models import DOP853, LARGER_MODELS, RODAS, scalar_class

from fmus.compiler.lowering import LAWS, METHODS, lowered_model, select_features, sibling_module
from fmus.compiler.model_lookup import find_model
from fmus.packaging.fmi_variables import declared_variables, fixed_choices
from fmus.packaging.native.model_header import render_model_header

BELT = '''"""A model."""
from fmus import Contact, Mode, Model, Output, Parameter, State


class Mine(Model):
    """Sled on a belt."""

    m = Parameter(1.3, "kg", "mass", above=0.0)
    k = Parameter(100.0, "N/m", "stiffness")
    f = Parameter(1.0, "N", "friction", low=0.0)
    u = Parameter(0.3, "m/s", "speed of a driver")
    POSITION = State("m", "position", start=0.1)
    SPEED = State("m/s", "speed", rate_of=POSITION)
    driver = State("m", "driver", rate=u)
    MODE = Mode()
    F = Contact("N", "friction", mode=MODE, slip=SPEED - 0.5 * u, slide=f, hold=1.3 * f)
    RATE = Output("m/s2", "acceleration", (k * (driver - POSITION) - F) / m, rate_of=SPEED)
'''
SLED = BELT.replace(" - 0.5 * u", "")
# For position, speed, rate and mode: local names, attributes, constants, stages of each other, names in the C code.
NAMES = {
    SLED: [("y", "v", "e", "modes"), ("x", "x1", "x0", "x_1"), ("y_1", "y_2", "f_1", "modes_a")],
    BELT: [
        ("h", "size", "end", "i"),
        ("OVERFLOW_LIMIT", "d_x", "to", "tie_tolerance"),
        ("x", "x_", "y_x", "end_x"),  # underscores, as between a vector and its component
    ],
}
NATIVE = ("--native", "--platform", "linux64")
INDICATORS = [f"events.{kind}_mode_{n}" for kind in ("to_rest", "to_break_away") for n in (1, 2)]
CHOICE_FORMATS = '{}="stiffer {} times"', "{}={}.0"  # an item, and its case


def numbers(path, model, names):
    """Return ends of steps, and the values of these names there, by two methods."""
    results, rules = [], sibling_module(lowered_model(path), "runtime.call_sequence")
    for method in DOP853, RODAS:
        run = prepared_run(model, {"solver.method": method, "solver.rtol": 1e-6})
        start(model, run, model.initial_state(0.0), 2.0)
        solver = run.solver
        while solver.t < 1.5:
            solver.update_t_next(model)
            assert solver.advance(model, solver.t_next) == 0
            rules.set_outputs(run, model)
            results.append((solver.t, *(getattr(model, name) for name in names)))
    return results


@pytest.mark.campaign
@pytest.mark.parametrize("text", NAMES, ids=["sled", "belt"])
def test_names_used_inside_the_numerics_change_nothing(tmp_path, text):
    default_names, path = ("POSITION", "SPEED", "RATE", "MODE"), tmp_path / "mine.py"
    path.write_text(text)
    expected = numbers(path, lowered_model(path)(), default_names)
    assert len(expected) > 20
    for names in NAMES[text]:
        changed_text = text
        for old, new in zip(default_names, names, strict=True):
            changed_text = changed_text.replace(old, new)
        path.write_text(changed_text)
        assert numbers(path, lowered_model(path)(), names) == expected, names
    assert text == SLED or "typedef struct Mine Model;" in render_model_header(
        lowered_model(path), "3"
    )  # with a slope of d_x


def test_author_choices_named_like_an_unavailable_method_or_law_are_kept(tmp_path):
    path, labels = tmp_path / "mine.py", [*METHODS, *LAWS]
    items, cases = (
        ", ".join(item.format(*pair) for pair in zip(labels, "123456789", strict=True)) for item in CHOICE_FORMATS
    )
    text = SLED.replace("import Contact", "import Choice, Contact").replace("- F)", f"* kind.choose({cases}) - F)")
    path.write_text(text.replace("    m =", f'    kind = Choice("kind", {items})\n    m ='))
    source = find_model(path)
    model_class = lowered_model(source, select_features(source, ["ode45"], ["hybrid"]))
    choices = [*declared_variables(model_class), *fixed_choices(model_class)]
    labels_by_name = {name: [label for label, _, _ in meaning.items] for name, meaning in choices if meaning.items}
    assert labels_by_name == {"kind": labels, "friction": ["hybrid"], "solver.method": ["ode45"]}
    model, rates = model_class(), set()
    for model.kind in range(1, 9):
        assert model.prepare() == 0
        rates.add(model.rates(0.0, 0.1, 0.0, 1))
    assert len(rates) == 8


def test_names_used_by_the_contact_solver_change_nothing(tmp_path):
    """Two blocks whose modes are named like entries of their matrix."""
    (blocks,) = (path for path in LARGER_MODELS if path.stem == "stacked")
    path, rates = tmp_path / "blocks.py", []
    for names in ("mode_1", "mode_2"), ("row_F_1_F_2", "row_F_2_F_1"):
        path.write_text(blocks.read_text().replace("mode_1", names[0]).replace("mode_2", names[1]))
        model = scalar_class(path)()
        assert model.prepare() == 0
        rates.append([model.rates(0.3, 0.1, 0.2, -0.1, 0.1, *modes) for modes in ((0, 0), (0, 1), (1, 0), (1, -1))])
    assert rates[0] == rates[1]


@pytest.mark.campaign
def test_event_indicators_of_a_native_fmu_do_not_depend_on_names(tmp_path, worker):
    """Two blocks, one of whose positions is named like a step size of the numerics."""
    (blocks,) = (path for path in LARGER_MODELS if path.stem == "stacked")
    results = []
    for name in "place", "h":
        path = tmp_path / f"blocks_{name}.py"
        path.write_text(re.sub(r"\bx_1\b", name, blocks.read_text()))
        fmu = worker.instantiate(build_user_model(path, *NATIVE) / "native" / f"{path.stem}.fmu").begin(stop=2.0)
        results.append(fmu.run([0.01 * i for i in range(200)], [name, *INDICATORS]))
        fmu.free()
    assert results[0] == results[1]
    assert len({value for row in results[0] for value in row[1:]}) > 10
