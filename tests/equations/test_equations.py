"""Code generated from declared equations, checked by direct evaluation of the equations."""

import ast
import math
import random
from itertools import product

import mpmath
import pytest
from models import EXAMPLE_MODELS, LARGER_MODELS, MODELS, ROOT, scalar_class

import fmus
from fmus.compiler.equations.algebra import ARITHMETIC, rounding_scale
from fmus.compiler.equations.dimensions import expression_text
from fmus.compiler.equations.expressions import FUNCTIONS, Term
from fmus.compiler.equations.model_declaration import (
    Choice,
    Contact,
    Model,
    Output,
    Parameter,
    Rule,
    SettableVariable,
    Variable,
)
from fmus.compiler.model_lookup import find_model

SOURCES = [*MODELS, *EXAMPLE_MODELS]
EVERY_SOURCE = pytest.mark.parametrize("source", SOURCES, ids=lambda source: getattr(source, "stem", source))
COMPARISONS = {"<": lambda a, b: a < b, "<=": lambda a, b: a <= b, ">": lambda a, b: a > b, ">=": lambda a, b: a >= b}
DIGITS = 50


class EquationEvaluator:
    """The declared equations of a model, evaluated directly, term by term, in floats or in many digits."""

    def __init__(self, analysis, values, functions):
        self.analysis, self.values, self.functions = analysis, values, functions

    def of(self, e):
        if isinstance(e, Output):
            return self.of(e.expression)
        if not isinstance(e, Term):
            return self.values[e.name] if isinstance(e, Variable) else self.number(e)
        if e.op == "choose":
            test, value, other_value = e.args
            return self.of(value if self.holds(test) else other_value)
        args = [self.of(arg) for arg in e.args]
        if e.op in ARITHMETIC:
            return ARITHMETIC[e.op](*args)
        return -args[0] if e.op == "neg" else getattr(self.functions, e.op)(*args)

    def holds(self, test):
        a, b = test.args
        return self.values[a.name] == b if test.op == "==" else COMPARISONS[test.op](self.of(a), self.of(b))

    def number(self, x):
        return mpmath.mpf(x) if self.functions is mpmath.mp else float(x)


def situations(analysis, model, count):
    """Yield values for all parameters, choices and inputs (also set in the model), and a time, states and a mode."""
    draw = random.Random(analysis.name)
    for _ in range(count):
        values = {}
        for e in (*analysis.parameters, *analysis.inputs):
            size = (e.start or 0.3) * draw.uniform(0.7, 1.3)
            values[e.name] = float(size if e.accepts(size) else e.start)
        for e in analysis.choices:
            values[e.name] = draw.choice(e.items)[1]
        for name, value in values.items():
            setattr(model, name, value)
        if model.prepare():
            continue
        t = draw.uniform(0.0, 10.0)
        if analysis.drivers:
            model.t_base, model.x_base = draw.uniform(0.0, 1.0), draw.uniform(-0.01, 0.01)
        at = {e.name: draw.uniform(-0.5, 0.5) for e in analysis.states}
        yield values, t, at, draw.choice((-1, 1))


def driver_positions(analysis, model, t):
    """Return the position of the driver."""
    return {d.name: model.x_base + getattr(model, d.constant_rate.name) * (t - model.t_base) for d in analysis.drivers}


def same_bits(a, b):
    return a == b and str(a) == str(b)


@EVERY_SOURCE
def test_generated_code_has_the_bits_of_the_declared_equations(source):
    """Rates and outputs while sliding and while stuck, and the load for which the rates vanish."""
    analysis, model = find_model(source).analysis, scalar_class(source)()
    modes = [m.name for m in analysis.modes]
    n_tried = 0
    for values, t, at, mode in situations(analysis, model, 300):
        values |= at | driver_positions(analysis, model, t) | dict.fromkeys(modes, mode)
        equations = EquationEvaluator(analysis, values, math)
        for c in analysis.contacts:
            values[c.name] = mode * equations.of(c.slide)
        model.compute_outputs(t, *at.values(), *[mode] * len(modes))
        for e in (*analysis.outputs, *analysis.contacts):
            assert same_bits(getattr(model, e.name) + 0.0, equations.of(e) + 0.0), e.name
        rate = model.rates(t, *at.values(), *[mode] * len(modes))
        assert same_bits(rate + 0.0, equations.of(analysis.rate_outputs[analysis.dynamic_states[0]]) + 0.0)
        for c in analysis.contacts:
            at[c.slip.name] = values[c.slip.name] = 0.0
            values[c.name], _, limit = model.stick_load(t, *at.values())
            size = sum(abs(equations.of(e)) for e in analysis.outputs) + abs(values[c.name])
            assert abs(equations.of(analysis.rate_outputs[c.slip])) < 1e-13 * size
            assert limit >= 0.0
            model.compute_outputs(t, *at.values(), 0)
            assert getattr(model, analysis.rate_outputs[c.slip].name) == 0.0
        n_tried += 1
    assert n_tried > 100


@EVERY_SOURCE
def test_the_rounding_scale_of_loads_and_rates_bounds_them_and_their_rounding_errors(source):
    """Also where large terms cancel; the rounding error is the difference from fifty digits."""
    analysis, model = find_model(source).analysis, scalar_class(source)()
    for values, t, at, mode in situations(analysis, model, 60):
        values |= at | driver_positions(analysis, model, t) | {m.name: mode for m in analysis.modes}
        values |= {c.name: mode * EquationEvaluator(analysis, values, math).of(c.slide) for c in analysis.contacts}
        floats, exact = EquationEvaluator(analysis, values, math), EquationEvaluator(analysis, values, mpmath.mp)
        for e in (*analysis.load.values(), *analysis.rate_outputs.values()):
            scale = floats.of(rounding_scale(e))
            assert abs(floats.of(e)) <= scale * (1.0 + 1e-12)
            with mpmath.workdps(DIGITS):
                exact.values = {name: mpmath.mpf(value) for name, value in values.items()}
                assert abs(exact.of(e) - floats.of(e)) <= 16 * 2.0**-52 * scale


GUIDED_BODY = """
from fmus import Choice, Model, Output, Parameter, State, cos

class GuidedBody(Model):
    'A body pulled by a guide.'

    m = Parameter(2.0, "kg", "mass", above=0.0)
    k = Parameter(3.0, "N/m", "stiffness", low=0.0)
    wave = Parameter(0.7, "1/m", "wave number", low=0.0)
    u = Parameter(0.2, "m/s", "speed of the guide")
    guide = State("m", "position of the guide", rate=u)
    law = Choice("law", plain="a spring", wavy="a spring with ripples")
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    pull = k * (guide - x)
    a = Output("m/s2", "acceleration", law.choose(plain=pull, wavy=pull + pull * cos(wave * guide)) / m, rate_of=v)
    stop_time = 1.0
"""


def test_magnitudes_of_rates_depend_on_a_choice_and_on_a_driver(tmp_path):
    """They have the driver's own magnitude, and its position where a function takes it."""
    file = tmp_path / "guided.py"
    file.write_text(GUIDED_BODY)
    analysis, model = find_model(file).analysis, scalar_class(file)()
    for values, t, at, _ in situations(analysis, model, 20):
        guide = driver_positions(analysis, model, t)["guide"]
        size = abs(model.x_base) + abs(model.u) * (abs(t) + abs(model.t_base))
        pull, phase = model.k * (size + abs(at["x"])), model.wave * guide
        ripple = abs(math.cos(phase)) + abs(math.sin(phase)) * model.wave * size
        wavy = pull * (1.0 + abs(math.cos(phase))) + abs(model.k * (guide - at["x"])) * ripple
        sizes = {"plain": pull, "wavy": wavy}
        (label,) = (label for label, number, *_ in analysis.choices[0].items if number == values["law"])
        magnitude = model.rate_magnitudes(t, *at.values())
        magnitude = magnitude[0] if isinstance(magnitude, tuple) else magnitude
        assert magnitude == pytest.approx(sizes[label] / model.m, rel=1e-12)


@EVERY_SOURCE
def test_jacobians_agree_with_differences_in_fifty_digits(source):
    """By time and by each state, sliding either way, from direct evaluation of the equations."""
    analysis, model, differences = find_model(source).analysis, scalar_class(source)(), []
    for values, t, at, mode in situations(analysis, model, 40):
        point = values | at | driver_positions(analysis, model, t) | {m.name: mode for m in analysis.modes}
        differences += zip(
            model.jacobian(t, *at.values(), *[mode] * len(analysis.modes)), slopes(analysis, point), strict=True
        )
    size = max(abs(true) for _, true in differences)
    assert all(abs(slope - true) <= 1e-12 * abs(true) + 1e-15 * size for slope, true in differences)


@pytest.mark.parametrize(  # the friction of the belt takes the sign of its slip from the mode
    "source", [path for path in LARGER_MODELS if path.stem != "belt"], ids=lambda source: source.stem
)
def test_any_number_of_states_and_contacts_is_derived(source):
    """Rates and Jacobian in every mode, for three states and for two contacts; bodies stuck to the ground do not
    move."""
    analysis = find_model(source).analysis
    model = scalar_class(source)()
    for values, t, at, _ in situations(analysis, model, 12):
        for modes in product((-1, 0, 1), repeat=len(analysis.modes)):
            situation = values | at | driver_positions(analysis, model, t)
            situation |= {m.name: mode for m, mode in zip(analysis.modes, modes, strict=True)}
            point = t, *at.values(), *modes
            rates = model.rates(*point)
            for state, value in zip(
                analysis.dynamic_states, rates if len(analysis.dynamic_states) > 1 else [rates], strict=True
            ):
                true = converged_law(analysis, analysis.rate_outputs[state], situation)
                assert abs(value - true) < 1e-12 * (1 + abs(true))
                stuck_contacts = [
                    c for c in analysis.independent_contacts if c.slip is state and situation[c.mode.name] == 0
                ]
                assert value == 0.0 or not stuck_contacts
            for value, true in zip(model.jacobian(*point), slopes(analysis, situation), strict=True):
                assert abs(value - true) < 1e-11 * (1 + abs(true))


def slopes(analysis, values):
    """Return the derivatives of each law by time and by each state, as differences in many digits."""
    by_time = {d.name: values[d.constant_rate.name] for d in analysis.drivers}
    directions = [by_time, *({s.name: 1} for s in analysis.states)]
    with mpmath.workdps(DIGITS):
        h = mpmath.mpf(10) ** -20

        def shift_values(direction, step):
            return values | {name: values[name] + step * mpmath.mpf(speed) for name, speed in direction.items()}

        pairs = (
            [converged_law(analysis, analysis.rate_outputs[s], shift_values(direction, d)) for d in (h, -h)]
            for s in analysis.dynamic_states
            for direction in directions
        )
        return [(ahead - behind) / (2 * h) for ahead, behind in pairs]


@mpmath.workdps(DIGITS)
def converged_law(analysis, law, variables):
    """Return the law in many digits, with the force of each contact: sliding friction, or the force that keeps its
    slip.

    Slips are linear in the speeds, and their rates in the forces, so that differences give the coefficients.
    """
    modes = {m.name for m in analysis.modes}
    values = {name: value if name in modes else mpmath.mpf(value) for name, value in variables.items()}
    equations = EquationEvaluator(analysis, values, mpmath.mp)
    stuck_contacts = [c for c in analysis.contacts if values[c.mode.name] == 0]
    for c in analysis.contacts:
        values[c.name] = values[c.mode.name] * equations.of(c.slide) + mpmath.mpf(0)

    def rates():
        h = mpmath.mpf(10) ** -15
        flow = {s.name: h * equations.of(analysis.rate[s]) for s in analysis.states}
        flow |= {d.name: h * values[d.constant_rate.name] for d in analysis.drivers}
        later = EquationEvaluator(
            analysis, values | {name: values[name] + rate for name, rate in flow.items()}, mpmath.mp
        )
        return [(later.of(c.slip) - equations.of(c.slip)) / h for c in stuck_contacts]

    if stuck_contacts:
        without, columns = rates(), []
        for c in stuck_contacts:
            values[c.name] = mpmath.mpf(1)
            columns.append([b - a for a, b in zip(rates(), without, strict=True)])
            values[c.name] = mpmath.mpf(0)
        forces = mpmath.lu_solve(mpmath.matrix(columns).T, mpmath.matrix(without))
        values |= {c.name: force for c, force in zip(stuck_contacts, forces, strict=True)}
    return equations.of(law)


@EVERY_SOURCE
def test_a_model_uses_only_the_public_api(source):
    """So that user models can do the same."""
    tree = ast.parse(find_model(source).source)
    for node in ast.walk(tree):
        assert not isinstance(node, ast.Import)
        if isinstance(node, ast.ImportFrom):
            assert (node.module, node.level) in (("fmus", 0), ("math", 0))
            assert node.module == "math" or {alias.name for alias in node.names} <= set(fmus.__all__)


def test_the_public_api_is_complete():
    """Every variable that can be declared, every function that has a derivative, tables, and no other names."""
    bases = Variable, SettableVariable, Contact
    classes = {cls for base in bases for cls in base.__subclasses__()} - {SettableVariable}
    kinds = {cls.__name__ for cls in classes} | {Model.__name__, Rule.__name__}
    assert set(fmus.__all__) == kinds | {*FUNCTIONS, "Table", "choose", "pi", "HYBRID", "SIGN", "THRESHOLD"}
    assert len(fmus.__all__) == len(set(fmus.__all__))
    assert all(hasattr(fmus, name) for name in fmus.__all__)
    assert fmus.pi == math.pi
    for name in FUNCTIONS:
        assert math.isfinite(getattr(fmus, name)(0.5))


@EVERY_SOURCE
def test_generated_source_is_deterministic(source):
    """Builds are compared by their bytes; reading a file again changes nothing."""
    first = find_model(source)
    reread = type(first)(first.path, first.source)
    analysis = reread.analysis
    for slope in ({e: 1.0} for e in analysis.states):  # earlier queries change nothing
        analysis.derivative_while_sliding(analysis.rate_outputs[analysis.dynamic_states[0]], slope)
    assert reread.generated_source == first.generated_source
    assert f"Generated from the equations in {first.path.name}" in first.generated_source


def test_a_changed_file_is_read_again(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text((ROOT / "fmus" / "smd.py").read_text())
    first = find_model(path)
    assert find_model(path) is first
    path.write_text(path.read_text().replace("157.9", "158.0"))
    assert scalar_class(path)().k == 158.0


def test_subclassed_variable_types_behave_like_their_base(tmp_path):
    """They are instances of it."""
    path = tmp_path / "mine.py"
    text = (
        (ROOT / "fmus" / "smd.py").read_text().replace("class Smd", "class Mass(Parameter):\n    pass\n\n\nclass Smd")
    )
    path.write_text(text.replace('m = Parameter(1.0, "kg"', 'm = Mass(1.0, "kg"'))
    assert find_model(path).generated_source == find_model("smd").generated_source.replace("smd.py", "mine.py")


@pytest.mark.parametrize("moving_variable", ["x", "driver"])
def test_a_discontinuous_law_has_no_closed_form_even_with_linear_slopes(tmp_path, moving_variable):
    """Where a condition moves, slopes determine neither the motion nor the load at rest."""
    text = f'''"""A model."""
from fmus import Contact, Mode, Model, Output, Parameter, State, choose


class Jump(Model):
    """A sled on a spring that is longer from some place on."""

    k = Parameter(100.0, "N/m", "stiffness")
    f = Parameter(1.0, "N", "friction")
    m = Parameter(1.0, "kg", "mass", above=0.0)
    u = Parameter(0.1, "m/s", "speed")
    edge = Parameter(0.02, "m", "place")
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    driver = State("m", "driver", rate=u)
    mode = Mode()
    F = Contact("N", "friction", mode=mode, slip=v, slide=f)
    a = Output("m/s2", "acceleration", (k * (driver - x) + choose({moving_variable} > edge, f, -f) - F) / m, rate_of=v)
'''
    (tmp_path / "jump.py").write_text(text)
    analysis = find_model(tmp_path / "jump.py").analysis
    assert analysis.closed_form is None
    assert analysis.rests_when_stuck == (moving_variable == "x")
    (tmp_path / "jump.py").write_text(text.replace(f"choose({moving_variable} > edge, f, -f)", "f"))
    assert find_model(tmp_path / "jump.py").analysis.closed_form is not None


def test_the_test_models_have_choices_and_contacts():
    """The models used here cover them."""
    kinds = {type(e) for source in SOURCES for e in find_model(source).analysis.variables}
    assert {Choice, Contact} <= kinds
    functions = {name for source in SOURCES for name in FUNCTIONS if f"{name}(" in find_model(source).generated_source}
    assert functions == {*FUNCTIONS}


@pytest.mark.parametrize(
    "text",
    [
        *("a - (b - c)", "a - (b + c)", "a - b - c", "a + b - c", "a / (b / c)", "a / (b * c)", "a / b / c"),
        *("a * (b - c)", "a - b * c", "-(a + b) * c", "-a / b", "a - -b"),
    ],
)
def test_the_text_of_an_expression_has_the_parentheses_that_it_needs(text):
    names = {name: Parameter(1.0, "1", "a number") for name in "abc"}
    for name, parameter in names.items():
        parameter.name = name
    assert expression_text(eval(text, names)) == text
