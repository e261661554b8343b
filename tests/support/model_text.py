"""Texts of model files that are put together from parts."""

import re


def remove_unused(text):
    """Return the text of a model file without unused parameters, inputs and tables, which are refused."""
    return "".join(line for line in text.splitlines(keepends=True) if not is_unused(line, text))


def is_unused(line, text):
    """Return whether a line declares a parameter, an input or a table that no other line uses."""
    declaration = re.match(r"    (\w+) = (Parameter|Input|Table)\(", line)
    code = re.sub('"[^"]*"', "", text)
    return declaration is not None and len(re.findall(rf"\b{declaration[1]}\b", code)) == 1


# a model with a table of forces, whose values are parameters
CURVE = '''from fmus import Model, Output, Parameter, State, Table


class Curve(Model):
    """A body with a force given by points."""

    m = Parameter(2.0, "kg", "mass", above=0.0)
    force = Table([0.0, 1.0, 3.0], [1.0, 5.0, 7.0], "m", "N", values="tunable")
    x = State("m", "position", start=0.25)
    v = State("m/s", "speed", rate_of=x)
    a = Output("m/s2", "acceleration", force(x) / m, rate_of=v)
'''

# a block that stops within the limit of its friction
BLOCK = '''from fmus import Contact, Mode, Model, Output, Parameter, State

class Block(Model):
    """Block on a spring, with dry friction."""

    f = Parameter(1.5, "N", "dry friction force", low=0.0)
    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(100.0, "N/m", "stiffness of the spring", low=0.0)
    x = State("m", "position", start=0.1)
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    F_friction = Contact("N", "friction force", mode=mode, slip=v, slide=f)
    a = Output("m/s2", "acceleration", (-k * x - F_friction) / m, rate_of=v)
    stop_time = 2.0
'''
PULSES = '''
from fmus import Contact, Mode, Model, Output, Parameter, State, cos, exp

class Pulses(Model):
    """Block whose holding limit dips over a phase that no clock gives, because its rate depends on itself."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    load = Parameter(3.0, "N", "load")
    limit = Parameter(5.0, "N", "holding limit", low=0.0)
    p = Parameter(2000.0, "1", "sharpness", low=0.0)
    Om = Parameter(2.0, "rad/s", "frequency")
    T = Parameter(1e12, "s", "time constant", above=0.0)
    phase = State("rad", "phase", start=0.5)
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    F = Contact("N", "friction", mode=mode, slip=v, slide=limit * (1.0 - 0.8 * exp(-p * (1.0 - cos(phase)))))
    phase_rate = Output("rad/s", "rate of the phase", Om - phase / T, rate_of=phase)
    a = Output("m/s2", "acceleration", (load - F) / m, rate_of=v)
    stop_time, method = 40.0, "dop853"
'''
