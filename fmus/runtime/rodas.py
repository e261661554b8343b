"""RODAS4P2: a Rosenbrock method of order 4(3), stiffly accurate and L-stable, with an interpolant of order 3.

Every stage solves one linear system with the Jacobian J at the beginning of the step, and nothing is iterated:

    (1/(GAMMA h) - J) u_i = f(t + C_i h, y + sum A_ij u_j) + sum G_ij u_j/h + D_i h f_t,    i = 1 ... 6

Here y = (x, v), f = (v, a) and u_i = h (p_i, q_i).  The row of J that belongs to x is (0, 1), so p_i follows from q_i
and one division by a number is the whole linear algebra.  Stages 5, 6 and the new point differ by one u each.

E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, IV.7; G. Steinebach, Improvement of Rosenbrock-Wanner
method RODASP, in: Progress in Differential-Algebraic Equations II, Springer 2020, 165-184 (the numbers).
"""

from math import nan

STAGES = 6  # right-hand sides a step, and one Jacobian; the last is the first of the next step
EXTRA = 0  # right-hand sides that the interpolant needs on top
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
    """One step, and between its ends a cubic: Hermite's for the position, as the stages say for the speed."""

    def __init__(self):
        self.q1 = self.q2 = self.q3 = self.q4 = self.q5 = 0.0  # the u_i of the speed, over h

    def step(self, model, mode, t, x, v, a, h):
        """New x, v and acceleration, and the rates e_x, e_v of the error: the estimates are h e_x and h e_v."""
        a_t, a_x, a_v = model.jacobian(t, x, v, mode)
        drift, s = h * a_t, GAMMA * h * a_x
        pivot = 1.0 - GAMMA * h * (a_v + s)
        w = GAMMA / pivot if pivot != 0.0 else nan  # a step of just this size cannot be taken: NaN refuses it

        q1 = (a + D1 * drift + s * v) * w
        p1 = GAMMA * (v + h * q1)

        vs = v + h * A21 * q1
        r = vs + G21 * p1
        a2 = model.rates(t + C2 * h, x + h * A21 * p1, vs, mode)
        q2 = (a2 + G21 * q1 + D2 * drift + s * r) * w
        p2 = GAMMA * (r + h * q2)

        xs, vs = x + h * (A31 * p1 + A32 * p2), v + h * (A31 * q1 + A32 * q2)
        r = vs + G31 * p1 + G32 * p2
        a3 = model.rates(t + C3 * h, xs, vs, mode)
        q3 = (a3 + G31 * q1 + G32 * q2 + D3 * drift + s * r) * w
        p3 = GAMMA * (r + h * q3)

        xs, vs = x + h * (A41 * p1 + A42 * p2 + A43 * p3), v + h * (A41 * q1 + A42 * q2 + A43 * q3)
        r = vs + G41 * p1 + G42 * p2 + G43 * p3
        a4 = model.rates(t + C4 * h, xs, vs, mode)
        q4 = (a4 + G41 * q1 + G42 * q2 + G43 * q3 + D4 * drift + s * r) * w
        p4 = GAMMA * (r + h * q4)

        xs = x + h * (A51 * p1 + A52 * p2 + A53 * p3 + A54 * p4)
        vs = v + h * (A51 * q1 + A52 * q2 + A53 * q3 + A54 * q4)
        r = vs + G51 * p1 + G52 * p2 + G53 * p3 + G54 * p4
        a5 = model.rates(t + h, xs, vs, mode)
        q5 = (a5 + G51 * q1 + G52 * q2 + G53 * q3 + G54 * q4 + s * r) * w
        p5 = GAMMA * (r + h * q5)

        xs, vs = xs + h * p5, vs + h * q5
        r = vs + G61 * p1 + G62 * p2 + G63 * p3 + G64 * p4 + G65 * p5
        a6 = model.rates(t + h, xs, vs, mode)
        q6 = (a6 + G61 * q1 + G62 * q2 + G63 * q3 + G64 * q4 + G65 * q5 + s * r) * w
        p6 = GAMMA * (r + h * q6)

        self.q1, self.q2, self.q3 = q1, q2, q3
        self.q4, self.q5 = q4, q5
        xs, vs = xs + h * p6, vs + h * q6
        return xs, vs, model.rates(t + h, xs, vs, mode), p6, q6

    def expand(self, model, step):
        """The interpolant of the step just taken; slopes of the speed are of no use where the curve is stiff."""
        inside = step.interpolant
        h = step.span
        q1, q2, q3, q4, q5 = self.q1, self.q2, self.q3, self.q4, self.q5
        inside.meet_values(step)
        inside.q2 = h * (H21 * q1 + H22 * q2 + H23 * q3 + H24 * q4 + H25 * q5)
        inside.q3 = h * (H31 * q1 + H32 * q2 + H33 * q3 + H34 * q4 + H35 * q5)
