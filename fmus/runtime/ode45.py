"""Dormand-Prince 5(4): local extrapolation, first same as last, interpolant of order 4.

J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comp. Appl. Math. 6 (1980) 19-26;
L. F. Shampine, Some practical Runge-Kutta formulas, Math. Comp. 46 (1986) 135-150 (the interpolant), in the form of
E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.6.
"""

from .vectors import ContactVector, StateVector

NUMBER, TEXT = 3, "Dormand-Prince 5(4), step control as in MATLAB; for moderate tolerances"
STAGES = 6  # evaluations of the right-hand side in a step; the last one serves the next step
EXTRA = 0  # additional evaluations for the interpolant
POWER, SAFETY, SHRINK, GROW = 1.0 / 5.0, 0.8, 0.1, 5.0

A21 = 1.0 / 5.0
A31, A32 = 3.0 / 40.0, 9.0 / 40.0
A41, A42, A43 = 44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0
A51, A52, A53, A54 = 19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0
A61, A62, A63, A64, A65 = 9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0
B1, B3, B4, B5, B6 = 35.0 / 384.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0
C2, C3, C4, C5 = 1.0 / 5.0, 3.0 / 10.0, 4.0 / 5.0, 8.0 / 9.0
E1, E3, E4 = 71.0 / 57600.0, -71.0 / 16695.0, 71.0 / 1920.0
E5, E6, E7 = -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0
D1, D3, D4 = -12715105075.0 / 11282082432.0, 87487479700.0 / 32700410799.0, -10690763975.0 / 1880347072.0
D5, D6, D7 = 701980252875.0 / 199316789632.0, -1453857185.0 / 822651844.0, 69997945.0 / 29380423.0


class Ode45:
    """Method with a quartic interpolant that matches values and slopes at both ends."""

    f3: StateVector
    f4: StateVector
    f5: StateVector
    f6: StateVector

    def __init__(self):
        self.f3 = self.f4 = self.f5 = self.f6 = 0.0

    def propose(
        self, model, step, modes: ContactVector, t, y: StateVector, f: StateVector, h
    ) -> tuple[StateVector, StateVector, StateVector]:
        """Propose a step of size h: return the new state, its rates, and e, where h e estimates the error."""
        y2 = y + h * A21 * f
        f2 = model.rates(t + C2 * h, y2, modes)
        y3 = y + h * (A31 * f + A32 * f2)
        f3 = model.rates(t + C3 * h, y3, modes)
        y4 = y + h * (A41 * f + A42 * f2 + A43 * f3)
        f4 = model.rates(t + C4 * h, y4, modes)
        y5 = y + h * (A51 * f + A52 * f2 + A53 * f3 + A54 * f4)
        f5 = model.rates(t + C5 * h, y5, modes)
        y6 = y + h * (A61 * f + A62 * f2 + A63 * f3 + A64 * f4 + A65 * f5)
        f6 = model.rates(t + h, y6, modes)
        y1 = y + h * (B1 * f + B3 * f3 + B4 * f4 + B5 * f5 + B6 * f6)
        f1 = model.rates(t + h, y1, modes)
        self.f3, self.f4, self.f5, self.f6 = f3, f4, f5, f6
        e = E1 * f + E3 * f3 + E4 * f4 + E5 * f5 + E6 * f6 + E7 * f1
        return y1, f1, e

    def build_interpolant(self, model, step):
        """Build the interpolant: the cubic Hermite polynomial plus D s^2 (1 - s)^2."""
        interpolant = step.interpolant
        interpolant.set_hermite_cubic(step)
        interpolant.degree = 4
        c4 = D1 * step.f0 + D3 * self.f3 + D4 * self.f4 + D5 * self.f5 + D6 * self.f6 + D7 * step.f1
        interpolant.c4 = step.h_full * c4
