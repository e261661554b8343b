"""Requirements of FMI and physics that fmpy does not validate, checked for all variables of each FMU."""

import math
import operator
import re
import sys
from contextlib import nullcontext, suppress
from fractions import Fraction
from math import copysign, inf, isfinite, isnan, nextafter
from xml.etree import ElementTree
from zipfile import ZipFile

import native_fmus
import pytest
from models import (
    BODIES,
    CASES,
    EXACT,
    MODELS,
    ODE23,
    combinations,
    declarations_of,
    each_case,
    label,
    model_class,
    outputs,
    push,
    runtime,
    tunable,
)
from worker_client import FmiError

from fmus.compiler.lowering import component_name
from fmus.compiler.units import unit_of

# Numbers with a physical dimension, to check that equations are consistent with their units.
BASES = ("kg", "m", "s", "A", "K")
ANY_DIMENSION = (0.0, math.inf)  # zero and infinity match every dimension


class DimensionError(AssertionError):
    """Quantities of different dimensions were added or compared, or a function got an argument with a dimension."""


class Quantity:
    """A value in SI units with the exponents of the base units; angles are dimensionless."""

    def __init__(self, value, *powers):
        self.value, self.powers = value, (*powers, *(0,) * (len(BASES) - len(powers)))

    @classmethod
    def of(cls, value, symbol):
        """Return a value in a declared unit."""
        unit = unit_of(symbol, symbol)
        return cls(value, *(getattr(unit, base) for base in BASES))

    def __repr__(self):
        return f"{self.value!r} " + " ".join(f"{base}^{power}" for base, power in zip(BASES, self.powers, strict=True))

    def __float__(self):
        if any(self.powers):
            raise DimensionError(f"a function of numbers was given {self!r}")
        return self.value

    def like(self, other, operation):
        """Return the value of `other`, which must have the same dimension."""
        if not isinstance(other, Quantity):
            if abs(other) not in ANY_DIMENSION and any(self.powers):
                raise DimensionError(f"{operation.__name__} of {self!r} and the number {other!r}")
            return other
        if self.powers != other.powers:
            raise DimensionError(f"{operation.__name__} of {self!r} and {other!r}")
        return other.value


def _same_dimension(operation, is_swapped=False, answer=lambda value, powers: Quantity(value, *powers)):
    def method(self, other):
        pair = (self.value, self.like(other, operation))
        return answer(operation(*(reversed(pair) if is_swapped else pair)), self.powers)

    return method


def _product(operation, sign):
    def method(self, other):
        if not isinstance(other, Quantity) and other == 0.0:
            return 0.0
        value, powers = (other.value, other.powers) if isinstance(other, Quantity) else (other, (0,) * len(BASES))
        return Quantity(operation(self.value, value), *(p + sign * q for p, q in zip(self.powers, powers, strict=True)))

    return method


Quantity.__add__ = Quantity.__radd__ = _same_dimension(operator.add)
Quantity.__sub__, Quantity.__rsub__ = _same_dimension(operator.sub), _same_dimension(operator.sub, is_swapped=True)
Quantity.__mul__ = Quantity.__rmul__ = _product(operator.mul, 1)
Quantity.__truediv__ = _product(operator.truediv, -1)
Quantity.__rtruediv__ = lambda self, other: other and Quantity(other / self.value, *(-power for power in self.powers))
Quantity.__neg__ = lambda self: Quantity(-self.value, *self.powers)
for _name in ("lt", "le", "gt", "ge", "eq"):
    setattr(Quantity, f"__{_name}__", _same_dimension(getattr(operator, _name), answer=lambda value, powers: value))


def _sqrt(x):
    if not isinstance(x, Quantity):
        return math.sqrt(x)
    return Quantity(math.sqrt(x.value), *(Fraction(power) / 2 for power in x.powers))


def _fabs(x):
    return Quantity(abs(x.value), *x.powers) if isinstance(x, Quantity) else math.fabs(x)


def _copysign(x, y):
    sign = y.value if isinstance(y, Quantity) else y
    return Quantity(math.copysign(x.value, sign), *x.powers) if isinstance(x, Quantity) else math.copysign(x, sign)


def _atan2(y, x):
    return (
        math.atan2(y.value, y.like(x, math.atan2))
        if isinstance(y, Quantity) and isinstance(x, Quantity)
        else math.atan2(y, x)
    )


FUNCTIONS = {"sqrt": _sqrt, "fabs": _fabs, "copysign": _copysign, "atan2": _atan2}


def patch_functions(monkeypatch):
    """Make the emitted models and their runtime use math functions that accept quantities."""
    for name, module in list(sys.modules.items()):
        if name.startswith("lowered_"):
            for function, quantity_function in FUNCTIONS.items():
                if getattr(module, function, None) is getattr(math, function):
                    monkeypatch.setattr(module, function, quantity_function)


EVERY_MODEL = pytest.mark.parametrize("name", MODELS)
fmus = native_fmus.backend_fmus
FOLDERS = ("binaries", "documentation", "extra", "resources", "sources")  # FMI 2.0.4, section 2.3


@pytest.fixture
def description(fmus):
    """The root of a model description."""

    def read(name):
        with ZipFile(fmus / f"{name}.fmu") as archive:
            return ElementTree.fromstring(archive.read("modelDescription.xml"))

    return read


# ---- the description


@EVERY_MODEL
def test_the_archive_holds_only_files_named_by_fmi(fmus, name):
    with ZipFile(fmus / f"{name}.fmu") as archive:
        assert archive.testzip() is None
        top = {path.split("/")[0] for path in archive.namelist()}
        assert top - set(FOLDERS) <= {"modelDescription.xml", "model.png"}
        assert all(path.isascii() and ".." not in path and not path.startswith("/") for path in archive.namelist())
        assert len(set(archive.namelist())) == len(archive.namelist())


@EVERY_MODEL
def test_every_reference_in_the_xml_resolves(description, name):
    root = description(name)
    scalars = root.findall("ModelVariables/ScalarVariable")
    units = {unit.get("name"): unit for unit in root.findall("UnitDefinitions/Unit")}
    types = {kind.get("name"): kind[0] for kind in root.findall("TypeDefinitions/SimpleType")}
    assert len({scalar.get("name") for scalar in scalars}) == len(scalars)
    assert len({scalar.get("valueReference") for scalar in scalars}) == len(scalars)
    for scalar in scalars:
        kind = scalar[0]
        assert re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*|der\(\w+\)", scalar.get("name"))
        assert scalar.get("description")
        if kind.tag == "Real":
            display_units = [unit.get("name") for unit in units[kind.get("unit")].findall("DisplayUnit")]
            assert kind.get("displayUnit") in [None, *display_units]
            assert types[kind.get("declaredType")].get("unit") == kind.get("unit")
        if kind.tag in ("Real", "Enumeration"):
            assert types[kind.get("declaredType")].tag == kind.tag
    references = {scalar[0].get("unit") for scalar in scalars}, {scalar[0].get("declaredType") for scalar in scalars}
    assert set(units) == references[0] - {None}
    assert set(types) == references[1] - {None}


@EVERY_MODEL
def test_start_values_are_present_where_required_and_in_range(description, name):
    """FMI 2.0.4, section 2.2.7: calculated variables have none, all others one."""
    root = description(name)
    types = {kind.get("name"): kind[0] for kind in root.findall("TypeDefinitions/SimpleType")}
    for scalar in root.findall("ModelVariables/ScalarVariable"):
        kind, start = scalar[0], scalar[0].get("start")
        assert (start is None) == (scalar.get("initial") == "calculated")
        assert (scalar.get("initial") is None) == (scalar.get("causality") == "input")
        if kind.tag != "Real":
            assert scalar.get("variability") != "continuous"
        if start is None:
            continue
        assert float(kind.get("min", "-inf")) <= float(start) <= float(kind.get("max", "inf"))
        if kind.tag == "Enumeration":
            assert start in [item.get("value") for item in types[kind.get("declaredType")]]


@EVERY_MODEL
def test_the_range_of_a_variable_is_that_of_the_values_it_accepts(description, name):
    """FMI has no open bounds."""
    for scalar in description(name).findall("ModelVariables/ScalarVariable"):
        if scalar[0].tag != "Real" or scalar.get("causality") not in ("parameter", "input"):
            continue
        accepts = declarations_of(name)[scalar.get("name")].accepts
        for bound, outward in ("min", -inf), ("max", inf):
            if scalar[0].get(bound) is None:
                assert accepts(copysign(1e300, outward))
            else:
                end = float(scalar[0].get(bound))
                assert accepts(nextafter(end, -outward))
                assert not accepts(nextafter(end, outward))


@EVERY_MODEL
def test_the_structure_lists_every_output_and_derivative_once_and_in_order(description, name):
    root = description(name)
    scalars = root.findall("ModelVariables/ScalarVariable")
    expected = [str(i) for i, scalar in enumerate(scalars, 1) if scalar.get("causality") == "output"]
    unknowns = {
        part: [unknown.get("index") for unknown in root.findall(f"ModelStructure/{part}/Unknown")]
        for part in ("Outputs", "Derivatives", "InitialUnknowns")
    }
    assert unknowns["Outputs"] == expected
    assert unknowns["InitialUnknowns"] == sorted({*expected, *unknowns["Derivatives"]}, key=int)


# ---- the units


@pytest.fixture
def physics(monkeypatch):
    """A model whose values carry their declared dimension, a time, and a forward motion."""

    def equip(name, values):
        model = model_class(name)()
        patch_functions(monkeypatch)
        for variable, d in declarations_of(name).items():
            if d.type == "Real" and d.causality in ("parameter", "input") and "." not in variable:
                setattr(model, variable, Quantity.of(d.start or 0.1, d.unit))
        for variable, value in values.items():
            if "." not in variable:
                setattr(model, variable, value)
        t, x, v = (
            Quantity.of(0.7, unit) for unit in ("s", *(declarations_of(name)[v].unit for v in outputs(name)[:2]))
        )
        assert model.prepare() == 0
        model.initial_state(t)
        model.rebase(t)
        return model, t, x, v

    return equip


def assert_dimension(quantity, expected):
    """Assert that a value has the dimension of another; zero matches every dimension."""
    return quantity == 0.0 if not isinstance(quantity, Quantity) else quantity.powers == expected.powers


PHYSICS = [(name, values) for name in BODIES for values in combinations(name) if values["solver.method"] == ODE23]


@pytest.mark.parametrize(("name", "values"), PHYSICS, ids=[label((*case, 0)) for case in PHYSICS])
def test_the_equations_agree_with_the_declared_units(physics, name, values):
    """Position, speed and acceleration, loads, derivatives and outputs, in every mode, with the code that runs in
    the FMU."""
    model, t, x, v = physics(name, values)
    for mode in (-1, 0, 1):
        modes = [mode] if model.has_dry_friction else []
        a = model.rates(t, x, v, *modes)
        assert assert_dimension(a, Quantity.of(1.0, declarations_of(name)[outputs(name)[2]].unit))
        assert assert_dimension(a, v / t)
        assert assert_dimension(v, x / t)
        for slope, by in zip(model.jacobian(t, x, v, *modes), (t, x, v), strict=True):
            assert assert_dimension(slope, a / by)
        if model.is_linear:
            assert assert_dimension(model.applied_acceleration(t, *modes), a)
        if model.rests_when_stuck:
            load, rate, limit = model.stick_load(t, x, v)
            assert assert_dimension(rate, load / t)
            assert assert_dimension(limit, load)
            assert assert_dimension(model.load_magnitude(t, x, v), load)
            assert assert_dimension(model.breakaway_acceleration(t, x, v, 1), a)
        with suppress(DimensionError):  # it sums up all that may overflow
            model.compute_outputs(t, x, v, *modes)
        for output in outputs(name):
            if declarations_of(name)[output].type == "Real":
                assert assert_dimension(getattr(model, output), Quantity.of(1.0, declarations_of(name)[output].unit)), (
                    output
                )


@pytest.mark.parametrize("name", BODIES)
def test_the_methods_preserve_dimensions(physics, name):
    """One step of each method, its error estimates, and its interpolant; the closed form too."""
    model, t, x, v = physics(name, {})
    modes = [1] if model.has_dry_friction else []
    a, h = model.rates(t, x, v, *modes), Quantity(1e-4, 0, 0, 1)
    for file in [item for item, number, _ in declarations_of(name)["solver.method"].items if number != EXACT]:
        method = getattr(runtime(name, file), file.capitalize())()
        step = runtime(name, "internal_step").InternalStep(model)
        x1, v1, *rates1, e_x, e_v = method.propose(model, step, *modes, t, x, v, v, a, h)
        ends = (x1, x), (v1, v), *zip(rates1, (v, a), strict=True), (e_x, x / h), (e_v, v / h)
        assert [assert_dimension(*pair) for pair in ends] == [True] * 6
        for vector, values in {"y0": (x, v), "f0": (v, a), "y1": (x1, v1), "f1": rates1}.items():
            for state, value in zip(model.states, values, strict=True):
                setattr(step, component_name(vector, state), value)
        step.t0, step.modes0_mode, step.h_full = t, 1, h
        method.build_interpolant(model, step)
        assert [assert_dimension(*pair) for pair in zip(step.interpolant.evaluate(0.3 * h), (x, v), strict=True)] == [
            True
        ] * 2
    if model.is_linear:
        exact = runtime(name, "linear_closed_form").LinearClosedForm(True)
        exact.prepare(*model.linear_coefficients())
        exact.start_segment(x, v, a, model.applied_acceleration(t, *modes), x)
        assert [assert_dimension(*pair) for pair in zip(exact.evaluate(h), (x, v), strict=True)] == [True] * 2
        if model.has_dry_friction:
            exact.start_segment(x, v, -a, model.applied_acceleration(t, *modes), x)
            assert assert_dimension(exact.next_standstill(1), t)
            assert [assert_dimension(*pair) for pair in zip(exact.state_at_standstill(h), (x, v, x), strict=True)] == [
                True
            ] * 3


@pytest.mark.parametrize("name", BODIES)
def test_a_wrong_unit_would_be_detected(physics, name):
    """Each parameter of the motion is given another unit."""
    for variable, d in tunable(name).items():
        model, t, x, v = physics(name, {})
        setattr(model, variable, Quantity.of(1.0, d.unit) * Quantity(1.0, 1, 2, 3))

        def move(model=model, t=t, x=x, v=v):
            model.prepare()
            a = [model.rates(t, x, v, *modes) for modes in (((1,), (0,)) if model.has_dry_friction else ((),))]
            assert all(assert_dimension(value, v / t) for value in a)

        if variable == "eps":
            continue
        with pytest.raises((DimensionError, AssertionError)):
            move()


# ---- the values


def numbers(fmu, name):
    """Read every variable."""
    return dict(zip(declarations_of(name), fmu.get(*declarations_of(name)), strict=True))


def infinite(values):
    """Return the variables that do not read as a finite number."""
    return [v for v, x in values.items() if not isfinite(x)]


@pytest.mark.parametrize("stop", [None, 7.0])
@each_case
def test_a_healthy_run_has_only_finite_values(launch, case, stop):
    """Importers drop other rows. Without a limit, the reported step is that of a default run, or up to the stop
    time."""
    name, values, _ = case
    fmu, t = launch(name, {**values, "solver.rtol": 1e-3}, start=-1.0, stop=stop), -1.0
    for h in (1e-9, 0.1, 0.3, 2.5):
        readings = numbers(fmu, name)
        assert infinite(readings) == []
        latest = nextafter(t + model_class(name).stop_time, inf) if stop is None else stop  # the sum rounds
        assert t < readings["solver.t_next"] <= latest
        assert readings["events.t_last"] == -1.0 or readings["events.count"] > 0
        fmu.step(t, h)
        t += h


@EVERY_MODEL
def test_every_variable_is_readable_in_every_phase(worker, fmus, name):
    fmu = worker.instantiate(fmus / f"{name}.fmu")
    assert set(numbers(fmu, name)) == set(declarations_of(name))
    fmu.setup(0.0, 1.0, None)
    assert infinite(numbers(fmu, name)) == []
    fmu.enter()
    ahead = numbers(fmu, name)
    assert infinite(ahead) == []
    fmu.exit()
    assert infinite(numbers(fmu, name)) == []
    assert {v: ahead[v] for v in outputs(name)} == {v: numbers(fmu, name)[v] for v in outputs(name)}
    fmu.step(0.0, 0.5)
    running = numbers(fmu, name)
    assert infinite(running) == []
    fmu.terminate()
    assert repr(numbers(fmu, name)) == repr(running)
    fmu.reset()
    assert set(numbers(fmu, name)) == set(declarations_of(name))
    fmu.begin({"m": 1e-300, push(name)[0]: 1e300})  # valid values, but the run diverges
    with pytest.raises(FmiError):
        fmu.step(0.0, 0.1)
    failed_values = numbers(fmu, name)
    calculated_variables = [
        v for v, d in declarations_of(name).items() if d.type == "Real" and d.causality in ("output", "local")
    ]
    assert [v for v in calculated_variables if not isnan(failed_values[v])] == []
    fmu.free()


@EVERY_MODEL
def test_start_values_are_read_back_bit_for_bit(worker, fmus, description, name):
    """Before the run, after initialisation, and after a reset."""
    starts = {}
    for scalar in description(name).findall("ModelVariables/ScalarVariable"):
        start, number = scalar[0].get("start"), float if scalar[0].tag == "Real" else int
        if start is not None:
            starts[scalar.get("name")] = number(start)
    fmu = worker.instantiate(fmus / f"{name}.fmu")
    for state in (lambda: None, fmu.begin, fmu.reset):
        state()
        assert dict(zip(starts, fmu.get(*starts), strict=True)) == starts
    fmu.free()


def find_other_value(declaration):
    """Return a valid value other than the start value."""
    if declaration.items:
        return next((value for _, value, _ in declaration.items if value != declaration.start), declaration.start)
    return next(
        value
        for value in (1.25 * declaration.start, 0.8 * declaration.start, 0.0123)
        if value != declaration.start and declaration.accepts(value)
    )


@EVERY_MODEL
def test_every_settable_variable_can_be_set_individually(launch, name):
    """It reads back, before the run and, if tunable, during the run; otherwise it is refused. The run continues."""
    for variable, d in declarations_of(name).items():
        if d.causality not in ("parameter", "input") or len(d.items) == 1:
            continue
        value = find_other_value(d)
        choices = {"solver.method": 2} if variable == "friction" else {}
        if name == "stickslip" and variable == "mu_d":
            choices = {"mu_s": 1.0}
        fmu = launch(name, {**choices, variable: value}, stop=0.2)
        fmu.step(0.0, 0.1)
        assert fmu.get(variable) == value
        fmu.reset()
        fmu.begin(choices, stop=0.2)
        fmu.step(0.0, 0.1)
        with pytest.raises(FmiError) if d.variability == "fixed" else nullcontext():
            fmu.set({variable: value})  # refused by a native FMU
            fmu.step(0.1, 0.05)  # refused by a Python FMU, whose layer can refuse steps only
        assert fmu.get(variable) == (d.start if d.variability == "fixed" else value)
        fmu.step(0.1 if d.variability == "fixed" else 0.15, 0.05)
        fmu.reset()
        assert fmu.get(variable) == d.start


@EVERY_MODEL
def test_outputs_depend_on_the_input_as_declared(launch, description, name):
    """The declared ones respond directly in some state; the others keep every bit in every state. FMUs with model
    exchange also declare dependencies on states."""
    root = description(name)
    scalars = root.findall("ModelVariables/ScalarVariable")
    names = [scalar.get("name") for scalar in scalars]
    entry, size = push(name)
    declared_dependencies = {}
    for unknown in root.findall("ModelStructure/Outputs/Unknown"):
        knowns = [scalars[int(i) - 1] for i in unknown.get("dependencies").split()]
        inputs = [scalar.get("name") for scalar in knowns if scalar.get("causality") == "input"]
        assert inputs in ([], [entry])
        declared_dependencies[names[int(unknown.get("index")) - 1]] = bool(inputs)
    responding_outputs = set()
    for case in CASES:
        if case[0] != name:
            continue
        fmu = launch(name, case[1], stop=case[2])
        for turn in range(6):
            t = turn * case[2] / 8
            before = fmu.get(*declared_dependencies)
            for value in (0.1 * size, -3.0 * size, 3.0 * size):
                fmu.set({entry: value})
                after = fmu.get(*declared_dependencies)
                changed_outputs = {
                    v for v, a, b in zip(declared_dependencies, before, after, strict=True) if repr(a) != repr(b)
                }
                assert not [v for v in changed_outputs if not declared_dependencies[v]], label(case)
                responding_outputs |= changed_outputs
            fmu.set({entry: 0.0})
            assert repr(fmu.get(*declared_dependencies)) == repr(before)
            fmu.step(t, case[2] / 8)
    assert responding_outputs == {v for v, direct in declared_dependencies.items() if direct}


@EVERY_MODEL
def test_every_choice_has_a_description_and_a_position(name):
    """Items count from 1, or from the number of the method."""
    for d in declarations_of(name).values():
        if d.items:
            values = [value for _, value, _ in d.items]
            assert values == sorted(set(values))
            assert all(sentence for _, _, sentence in d.items)
