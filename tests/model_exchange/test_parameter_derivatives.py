"""Partial derivatives by parameters, of built native FMUs against central differences, and their declaration."""

import subprocess
from ctypes import CDLL, c_double, c_int
from itertools import product
from pathlib import Path
from random import Random

import fmi3_fixtures
import fmpy
import numpy as np
import pytest
from build_cache import build_user_model
from fmi3_as_fmi2 import Model, Slave
from fmpy.fmi2 import FMU2Model, FMU2Slave
from models import EXAMPLE_MODELS, LARGER_MODELS, MODELS, RODAS
from native_fmus import build_native_fmus
from native_host import compiler

INTERFACES = {  # version and interface -> class of instances
    "FMI 2.0 ME": FMU2Model,
    "FMI 2.0 CS": FMU2Slave,
    "FMI 3.0 ME": Model,
    "FMI 3.0 CS": Slave,
}
USER_MODELS = [path for path in (*EXAMPLE_MODELS, *LARGER_MODELS) if path.stem in ("bumper", "stacked")]
CASES = [*product(MODELS, INTERFACES), *product(USER_MODELS, ("FMI 2.0 ME", "FMI 2.0 CS"))]
H = 1e-4  # of a difference, relative to the value
SPEEDS = (0.3, -0.2, 0.0)  # forward, backward, at rest
COUNTING = """
#include "model.h"
int n_calls = 0;
static void count(Model *model, struct Solver *solver, struct Tangent *tangent, bool *fault)
{
    n_calls++;
    propagate_constant_tangent(model, solver, tangent, fault);
}
#define propagate_constant_tangent count
#include "fmi2.c"
"""


def fmu_file(name, interface):
    """Return the path of a native FMU."""
    if name not in MODELS:
        return build_user_model(name, "--native", "--platform", "linux64") / "native" / f"{name.stem}.fmu"
    return (fmi3_fixtures.build_fmi3_fmus() if "3.0" in interface else build_native_fmus()) / f"{name}.fmu"


@pytest.fixture(params=CASES, ids=lambda pair: f"{getattr(pair[0], 'stem', pair[0])}-{pair[1]}")
def instance(request, tmp_path):
    """An instance before initialisation, its interface and its description."""
    name, interface = request.param
    path = fmu_file(name, interface)
    description = fmpy.read_model_description(path)
    folder = str(fmpy.extract(path, tmp_path))
    fmu = INTERFACES[interface](
        guid=description.guid, unzipDirectory=folder, modelIdentifier=description.modelName, instanceName="test"
    )
    fmu.instantiate()
    yield fmu, interface, description
    fmu.freeInstance()


def is_known(variable):
    return variable.type in ("Real", "Float64") and variable.causality in ("parameter", "input")


def situations(description, count):
    """Yield the choices, in all combinations, and values of Real parameters and inputs around those of the model."""
    draw = Random(description.modelName)
    variables = description.modelVariables
    choices = {
        v.valueReference: [int(item.value) for item in v.declaredType.items]
        for v in variables
        if v.declaredType is not None and v.declaredType.items
    }
    names = {v.valueReference: v.name for v in variables}
    choices |= {reference: [RODAS] for reference in choices if names[reference] == "solver.method"}
    knowns = [v for v in variables if is_known(v) and "." not in v.name]
    for values in product(*choices.values()):
        for i in range(count):
            reals = {}
            for v in knowns:
                start = float(v.start) or (30.0 if v.name == "F_ext" and description.modelName == "stacked" else 0.01)
                reals[v.valueReference] = start * draw.uniform(0.95, 1.05)
                if v.name in ("v0", "omega0"):
                    reals[v.valueReference] = SPEEDS[i % len(SPEEDS)]
                elif v.name in ("x0", "theta0") and SPEEDS[i % len(SPEEDS)] == 0.0:
                    reals[v.valueReference] *= 0.01  # a body at rest sticks
            yield dict(zip(choices, values, strict=True)), reals


def enter_initialization(fmu, choices, reals):
    fmu.reset()
    fmu.setInteger(list(choices), list(choices.values()))
    fmu.setReal(list(reals), list(reals.values()))
    fmu.setupExperiment()
    fmu.enterInitializationMode()


def central_differences(fmu, unknowns, known, value, handle_change):
    """Return the change of the unknowns with one known, with an error of fourth order."""

    def at(point):
        fmu.setReal([known], [point])
        handle_change()
        return np.array(fmu.getReal(unknowns))

    def difference(h):
        return (at(value + h) - at(value - h)) / (2.0 * h)

    step = H * abs(value)
    result = (4.0 * difference(step / 2.0) - difference(step)) / 3.0
    at(value)
    return result


def check_derivatives(fmu, unknowns, dependencies, reals, fixed_at, handle_change):
    """Compare the derivatives of the unknowns by all knowns with differences, and the zeros with what is declared.

    `dependencies` has the knowns of each unknown, and `fixed_at` the knowns that cannot change here in both directions.
    """
    slopes = {}
    scale = np.abs(np.array(fmu.getReal(unknowns))) + 1e-3
    for known, value in reals.items():
        slopes[known] = np.array(fmu.getDirectionalDerivative(unknowns, [known], [1.0]))
        assert [
            u for u, slope in zip(unknowns, slopes[known], strict=True) if slope and known not in dependencies[u]
        ] == []
        if known not in fixed_at:
            expected = central_differences(fmu, unknowns, known, value, handle_change)
            rounding = 1e-11 * scale / (H * abs(value))
            assert np.all(np.abs(slopes[known] - expected) <= 1e-8 * np.abs(expected) + rounding), known
    knowns, direction = list(reals), [(-1.0) ** i * (i + 1) for i in range(len(reals))]
    along = fmu.getDirectionalDerivative(unknowns, knowns, direction)
    jacobian = np.column_stack([slopes[known] for known in knowns])
    assert np.array(along) == pytest.approx(jacobian @ direction, rel=1e-9, abs=1e-9)
    if isinstance(fmu, (Model, Slave)):
        seed = [(-1.0) ** i / (i + 1) for i in range(len(unknowns))]
        adjoint = fmu.getAdjointDerivative(unknowns, knowns, seed, len(knowns))
        assert adjoint == pytest.approx(np.array(seed) @ jacobian, rel=1e-9, abs=1e-9)
    return jacobian


def real_unknowns(unknowns):
    """Return the references of the Real unknowns, and those of the knowns of each."""
    dependencies = {
        u.variable.valueReference: {known.valueReference for known in u.dependencies}
        for u in unknowns
        if u.variable.type in ("Real", "Float64")
    }
    return list(dependencies), dependencies


def references(description, *names):
    return [v.valueReference for v in description.modelVariables if v.name in names]


def has_kink(description, choices, speed):
    """Return whether a friction law without sticking depends on the sign of the speed, which is zero."""
    (law,) = references(description, "friction") or [None]
    return speed == 0.0 and choices.get(law, 1) != 1


def test_initial_unknowns_have_the_declared_derivatives_by_parameters_and_start_values(instance):
    fmu, _, description = instance
    unknowns, dependencies = real_unknowns(description.initialUnknowns)
    speeds = references(description, "v0", "omega0")
    solver_values = [v.valueReference for v in description.modelVariables if is_known(v) and "." in v.name]
    has_responded = set()
    for choices, reals in situations(description, 3):
        speed = next((reals[reference] for reference in speeds), 1.0)
        if has_kink(description, choices, speed):
            continue
        enter_initialization(fmu, choices, reals)
        at_rest = {*speeds} if speed == 0.0 else set()
        jacobian = check_derivatives(fmu, unknowns, dependencies, reals, at_rest, lambda: None)
        has_responded |= {(unknowns[i], list(reals)[j]) for i, j in zip(*np.nonzero(jacobian), strict=True)}
        assert not any(fmu.getDirectionalDerivative(unknowns, solver_values, [1.0] * len(solver_values)))
    start_values = references(description, "x0", "theta0", "m", "m_1")
    assert has_responded >= {(u, known) for u in unknowns for known in start_values if known in dependencies[u]}


def test_outputs_have_the_declared_derivatives_by_parameters_after_initialisation(instance):
    """In event mode and at communication points. FMI 2.0 declares dependencies on states and inputs only."""
    fmu, interface, description = instance
    derivatives = [u for u in description.derivatives if u.variable.causality != "output"]
    unknowns, dependencies = real_unknowns([*description.outputs, *derivatives])
    starts = [v.valueReference for v in description.modelVariables if v.variability == "fixed"]
    if "2.0" in interface:
        dependencies = dict.fromkeys(unknowns, references(description, *(v.name for v in description.modelVariables)))
    masses = references(description, "m", "m_1")
    accelerations = [reference for reference in unknowns if reference in references(description, "a", "alpha", "a_1")]
    slopes = []
    for choices, reals in situations(description, 3):
        if has_kink(
            description, choices, next((reals[reference] for reference in starts if reals.get(reference) == 0.0), 1.0)
        ):
            continue
        enter_initialization(fmu, choices, reals)
        fmu.exitInitializationMode()
        if interface.endswith("CS"):
            fmu.doStep(0.0, 1e-3)
        jacobian = check_derivatives(fmu, unknowns, dependencies, reals, starts, lambda: None)
        for number, known in enumerate(reals):
            assert known not in starts or not jacobian[:, number].any()
        slopes += fmu.getDirectionalDerivative(accelerations, masses, [1.0])
    assert any(slopes)


def test_both_interfaces_have_the_same_partial_derivatives(tmp_path):
    """By states, inputs and parameters, of outputs and of derivatives of states, at one point."""
    path = fmu_file("pendulum", "FMI 3.0 CS")
    description = fmpy.read_model_description(path)
    folder = str(fmpy.extract(path, tmp_path))
    arguments = {"guid": description.guid, "unzipDirectory": folder, "modelIdentifier": "pendulum"}
    unknowns, _ = real_unknowns([*description.outputs, *description.derivatives])
    states = [u.variable.derivative.valueReference for u in description.derivatives]
    knowns = [*states, *(v.valueReference for v in description.modelVariables if is_known(v))]
    jacobians, point = [], [0.1, 1.0]
    for kind in (Slave, Model):
        fmu = kind(instanceName="test", **arguments)
        fmu.instantiate()
        fmu.setupExperiment()
        fmu.setReal(references(description, "theta0", "omega0"), point)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        if kind is Slave:
            fmu.doStep(0.0, 0.02)
            point = fmu.getReal(states)
        jacobians.append([fmu.getDirectionalDerivative(unknowns, [known], [1.0]) for known in knowns])
        fmu.freeInstance()
    assert jacobians[0] == jacobians[1]


def test_derivatives_of_constants_are_calculated_once_until_a_parameter_changes(tmp_path):
    """They are those of a new instance after each change of a parameter, also by a reset or a saved state."""
    path = fmu_file("pacejka", "FMI 2.0 ME")
    description = fmpy.read_model_description(path)
    folder = Path(fmpy.extract(path, tmp_path))
    binary = folder / "binaries" / "linux64" / "pacejka.so"
    (folder / "sources" / "counting.c").write_text(COUNTING)
    subprocess.run([compiler(), "-shared", "-fPIC", "-o", binary, folder / "sources" / "counting.c", "-lm"], check=True)
    knowns = [v.valueReference for v in description.modelVariables if v.causality == "parameter" and is_known(v)]
    mu_s, force, acceleration = (references(description, name) for name in ("mu_s", "F_ext", "a"))
    calls = c_int.in_dll(CDLL(str(binary)), "n_calls")

    def begin(fmu, static):
        enter_initialization(fmu, {}, {mu_s[0]: static})
        fmu.exitInitializationMode()
        fmu.newDiscreteStates()
        fmu.enterContinuousTimeMode()

    def slopes(fmu):
        fmu.setContinuousStates((c_double * 3)(0.0, 0.02, 0.1), 3)
        return [fmu.getDirectionalDerivative(acceleration, [known], [1.0]) for known in knowns]

    fmu, other = (
        FMU2Model(guid=description.guid, unzipDirectory=str(folder), modelIdentifier="pacejka", instanceName=name)
        for name in ("one", "other")
    )
    for instance, static in ((fmu, 0.9), (other, 1.0)):
        instance.instantiate()
        begin(instance, static)
    first, changed_slopes = slopes(fmu), slopes(other)
    assert (calls.value, first != changed_slopes) == (2 * len(knowns), True)
    for value in (1.0, 0.0):
        fmu.setReal(force, [value])
        last_results = slopes(fmu), slopes(other), calls.value
    assert last_results == (first, changed_slopes, 2 * len(knowns))
    state = fmu.getFMUState()
    fmu.setReal(mu_s, [1.0])
    assert (slopes(fmu), calls.value) == (changed_slopes, 3 * len(knowns))
    fmu.setFMUState(state)
    begin(other, 0.9)
    assert (slopes(fmu), slopes(other)) == (first, first)
    fmu.freeFMUState(state)
    for instance in (fmu, other):
        instance.freeInstance()
