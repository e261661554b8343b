"""Directional derivatives of the built FMUs against central differences, and adjoint ones against their transpose."""

from ctypes import c_double
from itertools import product
from random import Random

import fmi3_fixtures
import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model
from models import MODELS, RODAS, model_class
from native_fmus import build_native_fmus

POINTS, H = 12, 1e-4


class Fmi3Instance(FMU3Model):
    """FMI 3.0 instances with the method names of FMI 2.0."""

    newDiscreteStates, getReal, setReal = FMU3Model.updateDiscreteStates, FMU3Model.getFloat64, FMU3Model.setFloat64

    def adjoint(self, unknowns, knowns, seed):
        return self.getAdjointDerivative(unknowns, knowns, seed, len(knowns))


def begin(fmu, choices):
    if isinstance(fmu, Fmi3Instance):
        fmu.setInt64(list(choices), list(choices.values()))
    else:
        fmu.setInteger(list(choices), list(choices.values()))
        fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()


KINDS = {2: (build_native_fmus, FMU2Model), 3: (fmi3_fixtures.build_fmi3_fmus, Fmi3Instance)}


@pytest.fixture(params=product(MODELS, KINDS), ids=lambda pair: f"{pair[0]}-FMI {pair[1]}.0")
def model(request, tmp_path):
    """A model-exchange instance before initialisation, and its description."""
    name, version = request.param
    folder, kind = KINDS[version]
    path = folder() / f"{name}.fmu"
    description = fmpy.read_model_description(path)
    fmu = kind(guid=description.guid, unzipDirectory=str(fmpy.extract(path, tmp_path)), modelIdentifier=name)
    fmu.instantiate()
    yield name, fmu, description
    fmu.freeInstance()


def choices(name, description):
    """Return every combination of law and load, by reference; the method is unused but must match the law."""
    by_name = {variable.name: variable for variable in description.modelVariables}
    names = [choice for choice in ("friction", "pin_load") if choice in by_name]
    items = [[int(item.value) for item in by_name[choice].declaredType.items] for choice in names]
    for values in product(*items):
        yield {
            by_name[choice].valueReference: value
            for choice, value in zip((*names, "solver.method"), (*values, RODAS), strict=True)
        }


def settle(fmu):
    fmu.newDiscreteStates()
    fmu.enterContinuousTimeMode()


def test_directional_derivatives_agree_with_central_differences(model):
    """Under every law, away from kinks of the force; differences of fourth order are accurate to 1e-8."""
    name, fmu, description = model
    states = [unknown.variable.derivative for unknown in description.derivatives]
    inputs = [v for v in description.modelVariables if v.causality == "input"]
    outputs = [v for v in description.modelVariables if v.causality == "output" and v.variability == "continuous"]
    rates = [unknown.variable for unknown in description.derivatives if unknown.variable.name.startswith("der(")]
    knowns, unknowns = ([v.valueReference for v in group] for group in ((*states, *inputs), (*outputs, *rates)))
    pushes, size, chance = [v.valueReference for v in inputs], len(states), Random(3)

    def at(point):
        fmu.setTime(1.0)
        fmu.setContinuousStates((c_double * size)(*point[:size]), size)
        fmu.setReal(pushes, list(point[size:]))
        return np.array(fmu.getReal(unknowns))

    for choice_values in choices(name, description):
        begin(fmu, choice_values)
        settle(fmu)
        for i in range(POINTS):
            speed = (0.3, -0.2, 0.0)[i % 3] if model_class(name).contacts else (0.3, -0.2, 0.05)[i % 3]
            centre = [chance.uniform(-1e-3, 1e-3), speed, chance.uniform(-1e-3, 1e-3)][:size]
            point = np.array([*centre, *(chance.uniform(-1e-3, 1e-3) for _ in inputs)])
            at(point)
            fmu.enterEventMode()
            settle(fmu)
            if (
                speed == 0.0
                and fmu.getReal([states[1].valueReference])[0] == 0.0
                and 1 not in list(choice_values.values())[:1]
            ):
                continue  # a law that depends on the sign of the speed has a kink there
            pairs = []
            for known in knowns:
                at(point)
                pairs.append(fmu.getDirectionalDerivative(unknowns, [known], [1.0]))
            for number, slopes in enumerate(pairs):
                if speed == 0.0 and number == 1:
                    continue  # no body moves while it is stuck

                def difference(h, number=number, point=point):
                    step = h * np.eye(len(point))[number]
                    return (at(point + step) - at(point - step)) / (2.0 * h)

                expected = (4.0 * difference(H / 2) - difference(H)) / 3.0
                assert slopes == pytest.approx(expected, rel=1e-8, abs=1e-8)
            at(point)
            direction = [chance.uniform(-1.0, 1.0) for _ in knowns]
            along = fmu.getDirectionalDerivative(unknowns, knowns, direction)
            assert along == pytest.approx(np.array(direction) @ np.array(pairs), rel=1e-12, abs=1e-12)
            if isinstance(fmu, Fmi3Instance):
                seed = [chance.uniform(-1.0, 1.0) for _ in unknowns]
                adjoint = fmu.adjoint(unknowns, knowns, seed)
                assert adjoint == pytest.approx(np.array(pairs) @ np.array(seed), rel=1e-12, abs=1e-12)
        fmu.reset()


def test_nondifferentiable_variables_are_refused(model, capfd):
    _, fmu, description = model
    begin(fmu, {})
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    state = description.derivatives[0].variable.derivative.valueReference
    for unknown, input_reference in (
        (state, references["solver.method"]),
        (references["m"], state),
        (references["solver.steps"], state),
        (10**6, state),
    ):
        with pytest.raises(FMICallException):
            fmu.getDirectionalDerivative([unknown], [input_reference], [1.0])
        assert "has no such partial derivative; knowns are Real states, inputs and parameters" in capfd.readouterr().err
