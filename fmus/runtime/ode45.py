"""Dormand-Prince 5(4), local extrapolation, first same as last, interpolant of order 4.

J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta formulae, J. Comp. Appl. Math. 6 (1980) 19-26;
L. F. Shampine, Some practical Runge-Kutta formulas, Math. Comp. 46 (1986) 135-150 (the interpolant), in the form of
E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.6.
"""

STAGES = 6  # right-hand sides a step; the last is the first of the next step
EXTRA = 0  # right-hand sides that the interpolant needs on top
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
    """One step, and the quartic that keeps values and slopes of both its ends."""

    def __init__(self):
        self.v3 = self.v4 = self.v5 = self.v6 = 0.0  # speeds and accelerations at the stages
        self.a3 = self.a4 = self.a5 = self.a6 = 0.0

    def step(self, model, mode, t, x, v, a, h):
        """New x, v and acceleration, and the rates e_x, e_v of the error: the estimates are h e_x and h e_v."""
        w = h * A21
        v2 = v + w * a
        a2 = model.rates(t + C2 * h, x + w * v, v2, mode)
        v3 = v + h * (A31 * a + A32 * a2)
        a3 = model.rates(t + C3 * h, x + h * (A31 * v + A32 * v2), v3, mode)
        v4 = v + h * (A41 * a + A42 * a2 + A43 * a3)
        a4 = model.rates(t + C4 * h, x + h * (A41 * v + A42 * v2 + A43 * v3), v4, mode)
        v5 = v + h * (A51 * a + A52 * a2 + A53 * a3 + A54 * a4)
        a5 = model.rates(t + C5 * h, x + h * (A51 * v + A52 * v2 + A53 * v3 + A54 * v4), v5, mode)
        x6 = x + h * (A61 * v + A62 * v2 + A63 * v3 + A64 * v4 + A65 * v5)
        v6 = v + h * (A61 * a + A62 * a2 + A63 * a3 + A64 * a4 + A65 * a5)
        a6 = model.rates(t + h, x6, v6, mode)
        x1 = x + h * (B1 * v + B3 * v3 + B4 * v4 + B5 * v5 + B6 * v6)
        v1 = v + h * (B1 * a + B3 * a3 + B4 * a4 + B5 * a5 + B6 * a6)
        a1 = model.rates(t + h, x1, v1, mode)
        self.v3, self.v4, self.v5, self.v6 = v3, v4, v5, v6
        self.a3, self.a4, self.a5, self.a6 = a3, a4, a5, a6
        return (
            x1,
            v1,
            a1,
            E1 * v + E3 * v3 + E4 * v4 + E5 * v5 + E6 * v6 + E7 * v1,
            E1 * a + E3 * a3 + E4 * a4 + E5 * a5 + E6 * a6 + E7 * a1,
        )

    def expand(self, model, step):
        """The interpolant of the step just taken: the cubic of ode23 and D s^2 (1 - s)^2."""
        inside = step.interpolant
        h, v, a, v1, a1 = step.span, step.v0, step.a0, step.v1, step.a1
        inside.meet(step)
        inside.degree = 4
        inside.p4 = h * (D1 * v + D3 * self.v3 + D4 * self.v4 + D5 * self.v5 + D6 * self.v6 + D7 * v1)
        inside.q4 = h * (D1 * a + D3 * self.a3 + D4 * self.a4 + D5 * self.a5 + D6 * self.a6 + D7 * a1)
