"""Time scale of a motion, from its states, rates and accepted steps; the length of the run has no influence."""

from math import fabs, inf, sqrt

from .vectors import (
    ContactVector,
    StateVector,
    elementwise,
    elementwise_max,
    error_size,
    magnitude,
    max_of,
    multiply,
)


def initial_step(model, step, t, y: StateVector, f: StateVector, modes: ContactVector) -> tuple[float, StateVector]:
    """Estimate the first step at t, and how far it moves the states.

    The estimate uses the rates at t and their derivatives along the linearized motion; with an absolute tolerance of
    the user only the rates, as in MATLAB.
    """
    method = step.active_method
    f2, f3, f4 = derivatives(model, t, y, f, modes)
    size = error_size(y)
    size = elementwise_max(size, method.error_scale_floor)
    relative_rate = magnitude(f) / size
    if method.floor_share > 0.0:
        relative_rate = rate_of_change(y, size, f, f2, f3, f4)
    rate = max_of(relative_rate)
    clock_rate = model.fastest_clock(t, y, modes)
    if method.floor_share > 0.0:
        rate = larger_of(rate, clock_rate)
    h = method.safety * step.tolerance**method.power
    h = h / rate if h < rate * step.h_max else step.h_max
    if rate == 0.0:
        return h, 0.0 * size
    size1, size2, size3 = magnitude(f), magnitude(f2), magnitude(f3)
    distance = h * (size1 + h / 2.0 * (size2 + h / 3.0 * size3))
    size = error_size(distance)
    return h, size


def smooth_rate(model, t, y: StateVector, f: StateVector, modes: ContactVector):
    """Return the reciprocal of the time in which the rates of the linearized motion change."""
    f2, f3, f4 = derivatives(model, t, y, f, modes)
    changes = rate_of_rate(f, f2, f3, f4)
    clock_rate = model.fastest_clock(t, y, modes)
    return larger_of(max_of(changes), clock_rate)


def derivatives(
    model, t, y: StateVector, f: StateVector, modes: ContactVector
) -> tuple[StateVector, StateVector, StateVector]:
    """Return the second to fourth derivatives of the states along the linearized motion."""
    f_t, J = model.jacobian(t, y, modes)
    product = multiply(J, f)
    f2 = product + f_t
    f3 = multiply(J, f2)
    f4 = multiply(J, f3)
    return f2, f3, f4


@elementwise
def rate_of_change(value, size, f1, f2, f3, f4):
    """Return the reciprocal of the time in which a state changes by its own size, given its derivatives.

    A state that starts at zero has the size that it reaches before its rate changes.
    """
    if f1 == 0.0 and f2 == 0.0:
        return 0.0
    rate = fabs(f1) / size if f1 != 0.0 else sqrt(fabs(f2) / size)
    change = slower_change(f1, f2, f3, f4)
    return change if value == 0.0 or 0.0 < change < rate else rate


@elementwise
def rate_of_rate(f1, f2, f3, f4):
    """Return the reciprocal of the time in which the rate of a state changes by its own size; 0 without a rate."""
    return slower_change(f1, f2, f3, f4) if f1 != 0.0 or f2 != 0.0 else 0.0


def slower_change(f1, f2, f3, f4):
    """Return the lowest of the relative changes of the derivatives, of which the first ones may be rounding errors."""
    change = larger_of(fabs(f2 / f1), sqrt(fabs(f3 / f1))) if f1 != 0.0 else inf
    if f2 != 0.0:
        later_change = larger_of(fabs(f3 / f2), sqrt(fabs(f4 / f2)))
        change = later_change if later_change < change else change
    if f1 == 0.0 and f3 != 0.0:  # of a position at rest; that of its speed counts as well
        latest_change = fabs(f4 / f3)
        change = latest_change if latest_change < change else change
    return change


def larger_of(a, b):
    """Return the larger of two numbers."""
    return a if a > b else b


def time_scale(model, step, t, y: StateVector, modes: ContactVector):
    """Return the time in which the motion changes by its own size: the step to try at a relative tolerance of 1.

    It follows the accepted steps and the clocks.  Where no step was tried, the rates in these modes give it.
    """
    method = step.active_method
    h = step.h_next
    if h == 0.0:
        f = model.rates(t, y, modes)
        h, _size = initial_step(model, step, t, y, f, modes)
    scale = h / (method.safety * step.tolerance**method.power)
    scale = scale if scale < step.h_max else step.h_max
    clock_rate = model.fastest_clock(t, y, modes)
    return 1.0 / clock_rate if clock_rate * scale > 1.0 else scale
