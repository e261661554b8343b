"""RODAS4P2: Rosenbrock method of order 4(3), stiffly accurate, L-stable, with an interpolant of order 3.

Every stage solves one linear system with the Jacobian J at the start of the step; there is no iteration:

    (1/(GAMMA h) - J) u_i = f(t + C_i h, y + sum A_ij u_j) + sum G_ij u_j/h + D_i h f_t,    i = 1 ... 6

Here u_i = h k_i.  Gaussian elimination is unrolled for the states of a model.  States whose rate is another state are
eliminated first, so one body costs one division.  Stages 5, 6 and the new state differ by one u each.

E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, IV.7; G. Steinebach, Improvement of Rosenbrock-Wanner
method RODASP, in: Progress in Differential-Algebraic Equations II, Springer 2020, 165-184 (coefficients).
"""

from .vectors import ContactVector, StateVector, factorize, select_kinematic, solve_factored

NUMBER, TEXT = 5, "Rosenbrock 4(3), L-stable; for stiff friction curves"
STAGES = 6  # evaluations of the right-hand side in a step, besides one Jacobian; the last one serves the next step
EXTRA = 0  # additional evaluations for the interpolant
POWER, SAFETY, SHRINK, GROW = 1.0 / 4.0, 0.9, 0.1, 6.0

GAMMA = 0.25
C2, C3, C4 = 0.75, 0.321448134013046, 0.519745732277726
D1, D2, D3, D4 = 0.25, -0.5, -0.189532918363016, 0.085612108792769
A21 = 3.0
A31, A32 = 0.906377755268814, -0.189707390391685
A41, A42, A43 = 3.758617027739064, 1.161741776019525, -0.849258085312803
A51, A52, A53, A54 = 7.089566927282776, 4.573591406461604, -8.423496976860259, -0.959280113459775
G21 = -12.0
G31, G32 = -6.354581592719008, 0.338972550544623
G41, G42, G43 = -8.575016317114033, -7.606483992117508, 12.224997650124820
G51, G52, G53, G54 = -5.888975457523102, -8.157396617841821, 24.805546872612922, 12.790401512796979
G61, G62, G63, G64, G65 = (
    -4.408651676063871,
    -6.692003137674639,
    24.625568527593117,
    16.627521966636085,
    -5.714285714285718,
)
H21, H22, H23 = -5.323528268423303, -10.042123754867493, 17.175254928256965
H24, H25 = -5.079931171878093, -0.016185991706112
H31, H32, H33 = 6.984505741529879, 6.914061169603662, -0.849178943070653
H34, H35 = 18.104410789349338, -3.516963011559032


class Rodas:
    """Method with a cubic interpolant: Hermite for states whose rate is a state, else from the stages."""

    k1: StateVector
    k2: StateVector
    k3: StateVector
    k4: StateVector
    k5: StateVector

    def __init__(self):
        self.k1 = self.k2 = self.k3 = self.k4 = self.k5 = 0.0

    def propose(
        self, model, step, modes: ContactVector, t, y: StateVector, f: StateVector, h
    ) -> tuple[StateVector, StateVector, StateVector]:
        """Propose a step of size h: return the new state, its rates, and e, where h e estimates the error."""
        f_t, J = model.jacobian(t, y, modes)
        drift = h * f_t
        s = factorize(GAMMA, h, J)

        r = f + D1 * drift
        k1 = solve_factored(s, r)

        y2 = y + h * A21 * k1
        f2 = model.rates(t + C2 * h, y2, modes)
        r = f2 + G21 * k1 + D2 * drift
        k2 = solve_factored(s, r)

        y3 = y + h * (A31 * k1 + A32 * k2)
        f3 = model.rates(t + C3 * h, y3, modes)
        r = f3 + G31 * k1 + G32 * k2 + D3 * drift
        k3 = solve_factored(s, r)

        y4 = y + h * (A41 * k1 + A42 * k2 + A43 * k3)
        f4 = model.rates(t + C4 * h, y4, modes)
        r = f4 + G41 * k1 + G42 * k2 + G43 * k3 + D4 * drift
        k4 = solve_factored(s, r)

        y5 = y + h * (A51 * k1 + A52 * k2 + A53 * k3 + A54 * k4)
        f5 = model.rates(t + h, y5, modes)
        r = f5 + G51 * k1 + G52 * k2 + G53 * k3 + G54 * k4
        k5 = solve_factored(s, r)

        y6 = y5 + h * k5
        f6 = model.rates(t + h, y6, modes)
        r = f6 + G61 * k1 + G62 * k2 + G63 * k3 + G64 * k4 + G65 * k5
        e = solve_factored(s, r)

        y1 = y6 + h * e
        f1 = model.rates(t + h, y1, modes)
        self.k1, self.k2, self.k3, self.k4, self.k5 = k1, k2, k3, k4, k5
        return y1, f1, e

    def build_interpolant(self, model, step):
        """Build the interpolant; the end slopes are unusable where the problem is stiff."""
        interpolant = step.interpolant
        interpolant.set_hermite_cubic(step)
        h = step.h_full
        interpolant.c2 = select_kinematic(
            interpolant.c2, h * (H21 * self.k1 + H22 * self.k2 + H23 * self.k3 + H24 * self.k4 + H25 * self.k5)
        )
        interpolant.c3 = select_kinematic(
            interpolant.c3, h * (H31 * self.k1 + H32 * self.k2 + H33 * self.k3 + H34 * self.k4 + H35 * self.k5)
        )
