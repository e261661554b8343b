"""Dispatch to the integration method that the user selects."""

from math import inf

from .codes import EXACT
from .linear_closed_form import LinearClosedForm
from .method_registry import methods
from .vectors import ContactVector, StateVector, elementwise_max, velocity_indices

EXACT_ITEM = ("exact", EXACT, "closed form of each linear segment, with events; hybrid law only")
SMALLEST_FLOOR = 1e-150  # is a divisor, so not zero; its inverse times an error does not overflow
METHOD_ITEMS = tuple((label, file.NUMBER, file.TEXT) for label, file, _ in methods)


class ActiveMethod:
    """Method of a run, with the parameters of its step-size control and the scale floor of its error norm.

    The error of a state is relative to its magnitude, but not below its floor: a share of its largest magnitude so far,
    or a constant if the user sets the absolute tolerance.
    """

    error_scale_floor: StateVector

    def __init__(self, model):
        self.error_scale_floor = 0.0
        self.floor_share, self.nominal_velocity = 0.0, inf  # share, 0.0 for a constant floor; limit for velocities
        if model.is_linear:
            self.exact = LinearClosedForm(model.has_input_derivatives)
        for label, _, Method in methods:
            setattr(self, label, Method())
        self.method_number = self.stages = self.extra = 0
        self.power = self.safety = self.shrink = self.grow = 0.0
        self.shrink_after_rejection = 1.0  # of a step that is accepted after a rejection

    def select(self, method):
        """Select a method by its number; the closed form has no step-size control."""
        self.method_number, self.shrink_after_rejection = method, 1.0
        for _, file, _ in methods:
            if method == file.NUMBER:
                self.stages, self.extra = file.STAGES, file.EXTRA
                self.power, self.safety, self.shrink, self.grow = file.POWER, file.SAFETY, file.SHRINK, file.GROW

    def raise_scale_floor(self, model, size: StateVector):
        """Raise the scale floor of the error norm to a share of the magnitudes of states that have been reached."""
        floor = self.floor_share * size
        self.error_scale_floor = elementwise_max(self.error_scale_floor, floor)
        if model.has_nominal_velocity and self.floor_share > 0.0:
            for i in velocity_indices:
                if self.error_scale_floor[i] > self.nominal_velocity:
                    self.error_scale_floor[i] = self.nominal_velocity

    def propose(
        self, model, step, modes: ContactVector, t, y: StateVector, f: StateVector, h
    ) -> tuple[StateVector, StateVector, StateVector]:
        """Propose a step of size h: return the new state, its rates, and e, where h e estimates the error."""
        method_number = self.method_number
        for label, file, _ in methods:
            if method_number == file.NUMBER:
                return getattr(self, label).propose(model, step, modes, t, y, f, h)

    def build_interpolant(self, model, step):
        """Build the interpolant of the step just computed."""
        for label, file, _ in methods:
            if self.method_number == file.NUMBER:
                getattr(self, label).build_interpolant(model, step)
