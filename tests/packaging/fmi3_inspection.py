"""Inspect built FMI 3.0 FMUs in a process that does not import the sources.

python fmi3_inspection.py call_each '[[[FUNCTION, ARGUMENT, ...], ...]]'
"""

import json
import random
import sys
from contextlib import contextmanager
from ctypes import c_double
from itertools import product
from shutil import rmtree

from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Model

STEP = 1e-3


@contextmanager
def instance(path):
    """Yield a model-exchange instance, its description and its folder, and clean up afterwards."""
    folder = str(extract(path))
    description = read_model_description(folder)
    fmu = FMU3Model(guid=description.guid, unzipDirectory=folder, modelIdentifier=description.modelName)
    fmu.instantiate()
    yield fmu, description, folder
    fmu.freeInstance()
    rmtree(folder)


def read(fmu, variable):
    get_values = fmu.getFloat64 if variable.type == "Float64" else fmu.getInt64
    return get_values([variable.valueReference])[0]


def write(fmu, variable, value):
    set_values = fmu.setFloat64 if variable.type == "Float64" else fmu.setInt64
    set_values([variable.valueReference], [value])


def variables(path):
    """Read every variable before and after setting it."""
    with instance(path) as (fmu, description, _):
        starts, after = {}, {}
        model_variables = description.modelVariables
        for variable in model_variables:
            starts[variable.name] = repr(read(fmu, variable))
        for variable in model_variables:
            if variable.causality in ("parameter", "input"):
                value = read(fmu, variable)
                write(fmu, variable, value if variable.type == "Enumeration" else 0.5 * value + 0.0625)
                after[variable.name] = repr(read(fmu, variable))
    return {"starts": starts, "after": after}


def factors(path, parameters):
    """Measure how all continuous calculated variables respond to small changes of each state and input.

    Returns {reference of the unknown: {reference of the known: [factors]}} with one factor for each point at which the
    unknown responded. The points are at rest and in motion, for every choice of friction law.
    """
    responses = {}
    with instance(path) as (fmu, description, _):
        by_name = {variable.name: variable for variable in description.modelVariables}
        smooth = [v for v in description.modelVariables if v.variability == "continuous" and v.initial == "calculated"]
        states = [rate.variable.derivative for rate in description.derivatives]
        (force_input,) = [v for v in description.modelVariables if v.causality == "input"]
        knowns = [*states, force_input]
        names = [name for name in ("friction", "pin_load") if name in by_name]
        choices = product(*([int(item.value) for item in by_name[name].declaredType.items] for name in names))
        chance = random.Random(5)
        for values in choices:
            fmu.reset()
            for name, value in zip(names, values, strict=True):
                write(fmu, by_name[name], value)
            for name, value in parameters.items():
                write(fmu, by_name[name], value)
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            handle_event(fmu)
            for i in range(12):
                point = [chance.uniform(-0.3, 0.3), [0.0, 1e-8, 0.2, -0.2][i % 4], chance.uniform(-0.3, 0.3)]
                force = chance.uniform(-0.1, 0.1)
                set_point(fmu, force_input, [*point[: len(states)], force])
                fmu.enterEventMode()
                handle_event(fmu)  # sets the mode, which the small changes keep
                point = (c_double * len(states))()
                fmu.getContinuousStates(point, len(states))
                point = [*point, force]
                values_at_point = read_unknowns(fmu, smooth, force_input, point)
                for index, known in enumerate(knowns):
                    shifted_point = [value + STEP * (number == index) for number, value in enumerate(point)]
                    shifted_values = read_unknowns(fmu, smooth, force_input, shifted_point)
                    for unknown, a, b in zip(smooth, values_at_point, shifted_values, strict=True):
                        if a != b:
                            row = responses.setdefault(unknown.valueReference, {})
                            row.setdefault(known.valueReference, []).append((b - a) / STEP)
    return responses


def nominals(path, variable, value):
    """Return the event flag and the nominal values before, at and after an event that sets a variable."""
    with instance(path) as (fmu, description, _):
        by_name = {variable.name: variable for variable in description.modelVariables}
        sizes = (c_double * len(description.derivatives))()
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        events = []
        for change in (False, True, False):
            if change:
                write(fmu, by_name[variable], value)
            _, _, has_new_nominals, *_ = fmu.updateDiscreteStates()
            fmu.getNominalsOfContinuousStates(sizes, len(sizes))
            events.append((has_new_nominals, list(sizes)))
    return events


def handle_event(fmu):
    """Handle an event and continue."""
    fmu.updateDiscreteStates()
    fmu.enterContinuousTimeMode()


def set_point(fmu, force_input, point):
    """Set states and input to a point."""
    *states, force = point
    write(fmu, force_input, force)
    fmu.setTime(1.0)
    fmu.setContinuousStates((c_double * len(states))(*states), len(states))


def read_unknowns(fmu, smooth, force_input, point):
    """Read the unknowns at a point."""
    set_point(fmu, force_input, point)
    return [read(fmu, variable) for variable in smooth]


def call_each(requests):
    """Call functions of this module one after another and return their results."""
    return [globals()[function](*arguments) for function, *arguments in requests]


if __name__ == "__main__":
    function, arguments = sys.argv[1], json.loads(sys.argv[2])
    print(json.dumps(globals()[function](*arguments)))
