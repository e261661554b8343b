"""Bogacki-Shampine 3(2): local extrapolation, first same as last, cubic interpolant.

P. Bogacki, L. F. Shampine, A 3(2) pair of Runge-Kutta formulas, Appl. Math. Lett. 2 (1989) 321-325;
L. F. Shampine, M. W. Reichelt, The MATLAB ODE Suite, SIAM J. Sci. Comput. 18 (1997) 1-22.
"""

from .vectors import ContactVector, StateVector

NUMBER, TEXT = 2, "Bogacki-Shampine 3(2), step control as in MATLAB; for loose tolerances"
STAGES = 3  # evaluations of the right-hand side in a step; the last one serves the next step
EXTRA = 0  # additional evaluations for the interpolant
POWER, SAFETY, SHRINK, GROW = 1.0 / 3.0, 0.8, 0.5, 5.0


class Ode23:
    """Method with a cubic Hermite interpolant."""

    def propose(
        self, model, step, modes: ContactVector, t, y: StateVector, f: StateVector, h
    ) -> tuple[StateVector, StateVector, StateVector]:
        """Propose a step of size h: return the new state, its rates, and e, where h e estimates the error."""
        y2 = y + 0.5 * h * f
        f2 = model.rates(t + 0.5 * h, y2, modes)
        y3 = y + 0.75 * h * f2
        f3 = model.rates(t + 0.75 * h, y3, modes)
        y1 = y + h * (2.0 * f + 3.0 * f2 + 4.0 * f3) / 9.0
        f1 = model.rates(t + h, y1, modes)
        e = (-5.0 * f + 6.0 * f2 + 8.0 * f3 - 9.0 * f1) / 72.0
        return y1, f1, e

    def build_interpolant(self, model, step):
        """Build the interpolant of the step just computed."""
        step.interpolant.set_hermite_cubic(step)
