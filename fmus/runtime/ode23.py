"""Bogacki-Shampine 3(2), local extrapolation, first same as last, cubic interpolant.

P. Bogacki, L. F. Shampine, A 3(2) pair of Runge-Kutta formulas, Appl. Math. Lett. 2 (1989) 321-325;
L. F. Shampine, M. W. Reichelt, The MATLAB ODE Suite, SIAM J. Sci. Comput. 18 (1997) 1-22.
"""

STAGES = 3  # right-hand sides a step; the last is the first of the next step
EXTRA = 0  # right-hand sides that the interpolant needs on top
POWER, SAFETY, SHRINK, GROW = 1.0 / 3.0, 0.8, 0.5, 5.0


class Ode23:
    """One step, and the cubic through values and slopes of both its ends."""

    def step(self, model, mode, t, x, v, a, h):
        """New x, v and acceleration, and the rates e_x, e_v of the error: the estimates are h e_x and h e_v."""
        v2 = v + 0.5 * h * a
        a2 = model.rates(t + 0.5 * h, x + 0.5 * h * v, v2, mode)
        v3 = v + 0.75 * h * a2
        a3 = model.rates(t + 0.75 * h, x + 0.75 * h * v2, v3, mode)
        x1 = x + h * (2.0 * v + 3.0 * v2 + 4.0 * v3) / 9.0
        v1 = v + h * (2.0 * a + 3.0 * a2 + 4.0 * a3) / 9.0
        a1 = model.rates(t + h, x1, v1, mode)
        return (
            x1,
            v1,
            a1,
            (-5.0 * v + 6.0 * v2 + 8.0 * v3 - 9.0 * v1) / 72.0,
            (-5.0 * a + 6.0 * a2 + 8.0 * a3 - 9.0 * a1) / 72.0,
        )

    def expand(self, model, step):
        """The interpolant of the step just taken."""
        step.interpolant.meet(step)
