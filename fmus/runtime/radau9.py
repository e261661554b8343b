"""Radau IIA of 5 stages: collocation method of order 9, stiffly accurate, L-stable, with an interpolant of order 5.

The stages y + z_i satisfy z_i = h sum A_ij f(t + C_j h, y + z_j).  Simplified Newton iteration solves for w, z = T w,
where T diagonalizes the inverse of A: one real system with the shift 1/(GAMMA h) and two complex ones with the shifts
(ALPHA + i BETA)/h.  States whose rate is another state follow from the stages of that one.  The polynomial through the
stages of the last step predicts those of the next one, and is the interpolant.  The Jacobian is that of the predicted
fourth stage.  The step size follows K. Gustafsson's controller.

E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, IV.5 and IV.8; E. Hairer, G. Wanner, Stiff
differential equations solved by Radau methods, J. Comp. Appl. Math. 111 (1999) 93-111 (iteration, error estimate).
"""

from math import nan

from .rate_rounding import smallest_sizes
from .vectors import (
    ContactVector,
    StateVector,
    all_of,
    complete_rates,
    dynamic_part,
    elementwise_max,
    error_size,
    factorize,
    factorize_complex,
    inlined,
    kinematic_rates,
    magnitude,
    max_of,
    select_kinematic,
    solve_complex,
    solve_factored,
)

NUMBER, TEXT = 6, "Radau IIA 9(5), L-stable; for stiff friction curves and tight tolerances"
STAGES = 5  # evaluations of the right-hand side in an iteration; `propose` replaces it by those of a step
EXTRA = 0  # additional evaluations for the interpolant
OFFERED_WITH = ("rodas", "radau9")  # default methods of the models that offer it; others need --method radau9
POWER, SAFETY, SHRINK, GROW = 1.0 / 6.0, 0.9, 0.12, 4.0

MAX_ITERATIONS = 7
NEWTON_TOLERANCE = 0.1  # error of the iteration, in multiples of the tolerance
CAUTIOUS_STEPS, CAUTIOUS_GROWTH = 2, 1.5  # after a divergence of the iteration
CHANGE_ROUNDING = 100.0  # of a change in the iteration, to which 25 rates contribute; in rounding errors of a rate
HOPELESS, LARGE = 10.0, 1e100  # excess over it, predicted for the last iteration; change that ends the iteration

# fmt: off
C1, C2, C3, C4 = 0.05710419611451768, 0.2768430136381238, 0.5835904323689168, 0.8602401356562195
A11, A12, A13, A14 = 0.07299886431790333, -0.02673533110794557, 0.018676929763984353, -0.01287910609330644
A15 = 0.005042839233882015
A21, A22, A23, A24 = 0.15377523147918246, 0.14621486784749352, -0.03644456890512809, 0.02123306311930472
A25 = -0.007935579902728777
A31, A32, A33, A34 = 0.14006304568480987, 0.29896712949128346, 0.16758507013524895, -0.03396910168661774
A35 = 0.010944288744192253
A41, A42, A43, A44 = 0.14489430810953477, 0.2765000687601592, 0.32579792291042103, 0.12875675325490976
A45 = -0.015708917378805327
A51, A52, A53, A54, A55 = 0.14371356079122594, 0.28135601514946207, 0.31182652297574126, 0.22310390108357075, 0.04
GAMMA, ALPHA1, BETA1, ALPHA2 = 0.15906584442746913, 5.70095329867179, -3.2102656003085497, 3.655694325463572
BETA2 = -6.543736899360077
T11, T12, T13, T14 = 0.013576867344947943, -0.011478515255229515, 0.01401985889287541, -0.010242047817908826
T15 = -0.04767387729029572
T21, T22, T23, T24 = 0.0016179004017190875, -0.007668830749180163, -0.024708578426518527, 0.05017286451737106
T25 = 0.09433181918161143
T31, T32, T33, T34 = 0.07915785334744721, 0.01939846399882895, -0.08180035370375117, -0.23053953404341795
T35 = -0.1027030453801259
T41, T42, T43, T44 = 0.41225608268046143, 0.40760117128019907, -0.19968242788680252, 0.37789390224886127
T45 = -0.46674413033249434
S11, S12, S13, S14 = 27.697693775684087, 12.783337911304406, 3.20848938671343, -0.9514904122489162
S15 = 0.7415504960259897
S21, S22, S23, S24 = -33.041880213519, -17.376953479063566, -0.17212906325400557, -0.09916977798254265
S25 = 0.5312281158383066
S31, S32, S33, S34 = 8.611443979875292, -9.699991409528808, -1.9147286396968743, -2.41869200608494
S35 = 1.0474634879353375
S41, S42, S43, S44 = 5.344186437834912, 4.593615567759161, -3.0363603234594243, 1.050660190231459
S45 = -0.27277861186429625
S51, S52, S53, S54 = -3.748059807439805, 3.984965736343885, 1.0444156416080188, -1.1840985681379486
S55 = 0.44991777015678036
E1, E2, E3, E4, E5 = -27.78093394406464, 3.641478498049213, -1.2525477211691187, 0.5920031671845428, -0.2
Q1, Q2, Q3, Q4, Q5 = -1.5864079001863283, 1.008117881498373, -0.7309748661597875, 0.5092648848477427, -0.2
L1, L2, L3, L4, L5 = 8.41242422359429, -6.970256116656661, 8.777114204150473, -18.2192823110881, 13.0
H21, H22, H23, H24, H25 = 27.78093394406464, -3.641478498049213, 1.2525477211691187, -0.5920031671845428, -0.8
H31, H32, H33, H34, H35 = -36.19335816765893, 10.611734614705874, -10.029661925319592, 18.811285478272644, -11.2
H41, H42, H43, H44, H45 = -144.05356518917776, 63.63016294236274, -17.885204671340986, -5.291393081843982, 5.6
H51, H52, H53, H54, H55 = 199.88739542347736, -127.022853068795, 92.10283313613321, -64.16737549081559, 25.2
# fmt: on


@inlined
def stage_change(h, f, c, a1, a2, a3, a4, a5, z1, z2, z3, z4, z5, z):
    """Return the change up to a stage: z; for states whose rate is a state, it follows from the stages of that one."""
    return select_kinematic(
        h
        * (
            c * f
            + a1 * kinematic_rates(z1)
            + a2 * kinematic_rates(z2)
            + a3 * kinematic_rates(z3)
            + a4 * kinematic_rates(z4)
            + a5 * kinematic_rates(z5)
        ),
        z,
    )


@inlined
def continuation(ahead, place, p1, p2, p3, p4, p5):
    """Return the change that the polynomial of the step before predicts."""
    return dynamic_part(ahead * (p1 - place * (p2 + place * (p3 - ahead * (p4 + place * p5)))))


class Radau9:
    """Method with the polynomial through its stages as interpolant.

    `z1` ... `z5` are the changes up to the stages of the step proposed last, zero for states whose rate is a state;
    `f_start` and `f_end` are the rates at its ends.  `p1` ... `p5` are the coefficients of the polynomial of the step
    before, zero if there is none.
    """

    z1: StateVector
    z2: StateVector
    z3: StateVector
    z4: StateVector
    z5: StateVector
    p1: StateVector
    p2: StateVector
    p3: StateVector
    p4: StateVector
    p5: StateVector
    f_start: StateVector
    f_end: StateVector

    def __init__(self):
        self.z1 = self.z2 = self.z3 = self.z4 = self.z5 = 0.0
        self.p1 = self.p2 = self.p3 = self.p4 = self.p5 = 0.0
        self.f_start = self.f_end = 0.0
        self.t0 = self.t1 = self.h = self.error = 0.0  # of the step proposed last
        self.n_cautious = 0  # steps after a divergence of the iteration that may hardly grow
        self.h_last = self.error_last = 0.0  # of the step before; 0.0 if there is none

    def start_anew(self):
        """Discard the polynomial of the step before."""
        self.p1 = self.p2 = self.p3 = self.p4 = self.p5 = 0.0
        self.h_last = 0.0

    def propose(
        self, model, step, modes: ContactVector, t, y: StateVector, f: StateVector, h
    ) -> tuple[StateVector, StateVector, StateVector]:
        """Propose a step of size h: return the new state, its rates, and e, where h e estimates the error.

        e is NaN if the iteration does not converge.
        """
        control = step.active_method
        is_repeated = False
        if step.n_accepted > 0 and t == self.t1 and all_of(f == self.f_end):
            # the step proposed last was accepted
            self.p1 = dynamic_part(self.z5)
            self.p2 = dynamic_part(H21 * self.z1 + H22 * self.z2 + H23 * self.z3 + H24 * self.z4 + H25 * self.z5)
            self.p3 = dynamic_part(H31 * self.z1 + H32 * self.z2 + H33 * self.z3 + H34 * self.z4 + H35 * self.z5)
            self.p4 = dynamic_part(H41 * self.z1 + H42 * self.z2 + H43 * self.z3 + H44 * self.z4 + H45 * self.z5)
            self.p5 = dynamic_part(H51 * self.z1 + H52 * self.z2 + H53 * self.z3 + H54 * self.z4 + H55 * self.z5)
            self.h_last, self.error_last = self.h, self.error
        elif step.n_accepted > 0 and t == self.t0 and all_of(f == self.f_start):
            is_repeated = True
        else:
            self.start_anew()
        self.t0, self.f_start = t, f

        ratio = h / self.h_last if self.h_last > 0.0 else 0.0
        ahead = C1 * ratio
        place = 1.0 + ahead
        z1 = continuation(ahead, place, self.p1, self.p2, self.p3, self.p4, self.p5)
        ahead = C2 * ratio
        place = 1.0 + ahead
        z2 = continuation(ahead, place, self.p1, self.p2, self.p3, self.p4, self.p5)
        ahead = C3 * ratio
        place = 1.0 + ahead
        z3 = continuation(ahead, place, self.p1, self.p2, self.p3, self.p4, self.p5)
        ahead = C4 * ratio
        place = 1.0 + ahead
        z4 = continuation(ahead, place, self.p1, self.p2, self.p3, self.p4, self.p5)
        place = 1.0 + ratio
        z5 = continuation(ratio, place, self.p1, self.p2, self.p3, self.p4, self.p5)
        w1 = S11 * z1 + S12 * z2 + S13 * z3 + S14 * z4 + S15 * z5
        w2 = S21 * z1 + S22 * z2 + S23 * z3 + S24 * z4 + S25 * z5
        w3 = S31 * z1 + S32 * z2 + S33 * z3 + S34 * z4 + S35 * z5
        w4 = S41 * z1 + S42 * z2 + S43 * z3 + S44 * z4 + S45 * z5
        w5 = S51 * z1 + S52 * z2 + S53 * z3 + S54 * z4 + S55 * z5

        y7 = y + stage_change(h, f, C4, A41, A42, A43, A44, A45, z1, z2, z3, z4, z5, z4)
        _f_t, J = model.jacobian(t + C4 * h, y7, modes)
        re_1, im_1, re_2, im_2 = ALPHA1 / h, BETA1 / h, ALPHA2 / h, BETA2 / h  # of the complex shifts
        real = factorize(GAMMA, h, J)
        pair1 = factorize_complex(re_1, im_1, J)
        pair2 = factorize_complex(re_2, im_2, J)
        shift = 1.0 / (GAMMA * h)
        scale = error_size(y)
        scale = elementwise_max(control.error_scale_floor, scale)
        tolerance = NEWTON_TOLERANCE * step.tolerance
        u1 = w1
        has_converged, last_change, quotient, share, iterations = False, 1.0, 1.0, 1.0, 0
        for turn in range(MAX_ITERATIONS):
            y1 = y + stage_change(h, f, C1, A11, A12, A13, A14, A15, z1, z2, z3, z4, z5, z1)
            f1 = model.rates(t + C1 * h, y1, modes)
            y2 = y + stage_change(h, f, C2, A21, A22, A23, A24, A25, z1, z2, z3, z4, z5, z2)
            f2 = model.rates(t + C2 * h, y2, modes)
            y3 = y + stage_change(h, f, C3, A31, A32, A33, A34, A35, z1, z2, z3, z4, z5, z3)
            f3 = model.rates(t + C3 * h, y3, modes)
            y4 = y + stage_change(h, f, C4, A41, A42, A43, A44, A45, z1, z2, z3, z4, z5, z4)
            f4 = model.rates(t + C4 * h, y4, modes)
            y5 = y + stage_change(h, f, 1.0, A51, A52, A53, A54, A55, z1, z2, z3, z4, z5, z5)
            f5 = model.rates(t + h, y5, modes)
            iterations += 1
            r1 = dynamic_part(S11 * f1 + S12 * f2 + S13 * f3 + S14 * f4 + S15 * f5) - shift * w1
            r2 = dynamic_part(S21 * f1 + S22 * f2 + S23 * f3 + S24 * f4 + S25 * f5) - (re_1 * w2 - im_1 * w3)
            r3 = dynamic_part(S31 * f1 + S32 * f2 + S33 * f3 + S34 * f4 + S35 * f5) - (re_1 * w3 + im_1 * w2)
            r4 = dynamic_part(S41 * f1 + S42 * f2 + S43 * f3 + S44 * f4 + S45 * f5) - (re_2 * w4 - im_2 * w5)
            r5 = dynamic_part(S51 * f1 + S52 * f2 + S53 * f3 + S54 * f4 + S55 * f5) - (re_2 * w5 + im_2 * w4)
            k1 = solve_factored(real, r1)
            u1 = dynamic_part(h * k1)
            u2, u3 = solve_complex(pair1, r2, r3)
            u4, u5 = solve_complex(pair2, r4, r5)
            w1 = w1 + u1
            w2 = w2 + u2
            w3 = w3 + u3
            w4 = w4 + u4
            w5 = w5 + u5
            z1 = T11 * w1 + T12 * w2 + T13 * w3 + T14 * w4 + T15 * w5
            z2 = T21 * w1 + T22 * w2 + T23 * w3 + T24 * w4 + T25 * w5
            z3 = T31 * w1 + T32 * w2 + T33 * w3 + T34 * w4 + T35 * w5
            z4 = T41 * w1 + T42 * w2 + T43 * w3 + T44 * w4 + T45 * w5
            z5 = w1 + w2 + w4
            if turn == 0:  # a state that starts at zero has no other magnitude
                change5 = dynamic_part(control.floor_share * magnitude(z5))
                scale = elementwise_max(scale, change5)
            u1 = dynamic_part(magnitude(u1))
            u2 = dynamic_part(magnitude(u2))
            u3 = dynamic_part(magnitude(u3))
            u4 = dynamic_part(magnitude(u4))
            u5 = dynamic_part(magnitude(u5))
            u1 = dynamic_part(u1 + u2 + u3 + u4 + u5)
            u2 = dynamic_part(u1 / scale)
            change = max_of(u2) / tolerance
            if not change < LARGE:  # also for NaN
                break
            if turn > 0:
                quotient = change / last_change
                if quotient > 0.99:
                    quotient = 0.99
                    if change > 1.0:
                        break
                share = quotient / (1.0 - quotient)
            if share * change <= 1.0:
                has_converged = True
                break
            if turn > 0 and share * change * quotient ** (MAX_ITERATIONS - 2.0 - turn) > HOPELESS:
                break
            last_change = change
        control.stages = STAGES * iterations
        if not has_converged and control.floor_share > 0.0:
            # while all contacts stick, rates are rounding errors, and no iteration makes its change smaller
            least = smallest_sizes(model, step, t + h, y, modes, h)
            least = CHANGE_ROUNDING / NEWTON_TOLERANCE * least
            u1 = dynamic_part(u1 / elementwise_max(scale, least))
            has_converged = max_of(u1) <= tolerance
        if not has_converged:
            self.n_cautious = CAUTIOUS_STEPS
            e = nan * y
            return y, f, e

        # the end of the step
        y6 = y + stage_change(h, f, 1.0, A51, A52, A53, A54, A55, z1, z2, z3, z4, z5, z5)
        r = select_kinematic(
            Q1 * kinematic_rates(z1)
            + Q2 * kinematic_rates(z2)
            + Q3 * kinematic_rates(z3)
            + Q4 * kinematic_rates(z4)
            + Q5 * kinematic_rates(z5),
            f + (E1 * z1 + E2 * z2 + E3 * z3 + E4 * z4 + E5 * z5) / h,
        )
        e = solve_factored(real, r)
        size = error_size(y6)
        size = elementwise_max(size, scale)
        d = magnitude(e)
        d = d / size
        error = h * max_of(d) / step.tolerance
        if error > 1.0 and (is_repeated or self.h_last == 0.0):  # a filtered estimate is less pessimistic
            y8 = y + h * e
            f8 = model.rates(t, y8, modes)
            control.stages += 1
            r = r + (f8 - f)
            e = solve_factored(real, r)
            d = magnitude(e)
            d = d / size
            error = h * max_of(d) / step.tolerance
        if error > 1.0 and control.floor_share > 0.0:  # as in method_step
            least = smallest_sizes(model, step, t + h, y, modes, h)
            size = elementwise_max(size, least)
            d = magnitude(e)
            d = d / size
            error = h * max_of(d) / step.tolerance
        f6 = complete_rates(y6, (L1 * z1 + L2 * z2 + L3 * z3 + L4 * z4 + L5 * z5) / h)

        # factors of the step size, for step_control
        safety = SAFETY * (2.0 * MAX_ITERATIONS + 1.0) / (2.0 * MAX_ITERATIONS + iterations)
        growth, error_floor = GROW, error if error > 1e-9 else 1e-9
        if self.h_last > 0.0:
            error_last = self.error_last if self.error_last > 0.01 else 0.01
            growth = safety * h / self.h_last * (error_last / (error_floor * error_floor)) ** POWER
            growth = 0.2 if growth < 0.2 else growth if growth < GROW else GROW
        if self.n_cautious > 0:
            self.n_cautious -= 1
            growth = growth if growth < CAUTIOUS_GROWTH else CAUTIOUS_GROWTH
        control.safety, control.grow = safety, growth
        shrink = safety * error_floor**-POWER
        shrink = shrink if shrink < growth else growth
        control.shrink_after_rejection = shrink if shrink < 1.0 else 1.0
        self.z1, self.z2, self.z3, self.z4, self.z5 = z1, z2, z3, z4, z5
        self.t1 = t + (step.roundoff.t0 + h)  # as in step_control
        self.f_end, self.h, self.error = f6, h, error
        return y6, f6, e

    def build_interpolant(self, model, step):
        """Build the interpolant: the polynomial through the stages."""
        interpolant = step.interpolant
        h = step.h_full
        z1 = stage_change(h, step.f0, C1, A11, A12, A13, A14, A15, self.z1, self.z2, self.z3, self.z4, self.z5, self.z1)
        z2 = stage_change(h, step.f0, C2, A21, A22, A23, A24, A25, self.z1, self.z2, self.z3, self.z4, self.z5, self.z2)
        z3 = stage_change(h, step.f0, C3, A31, A32, A33, A34, A35, self.z1, self.z2, self.z3, self.z4, self.z5, self.z3)
        z4 = stage_change(h, step.f0, C4, A41, A42, A43, A44, A45, self.z1, self.z2, self.z3, self.z4, self.z5, self.z4)
        z5 = stage_change(
            h, step.f0, 1.0, A51, A52, A53, A54, A55, self.z1, self.z2, self.z3, self.z4, self.z5, self.z5
        )
        interpolant.is_ready, interpolant.h, interpolant.degree = True, h, 7
        interpolant.c0 = step.y0
        interpolant.c1 = step.y1 - step.y0
        interpolant.c2 = H21 * z1 + H22 * z2 + H23 * z3 + H24 * z4 + H25 * z5
        interpolant.c3 = H31 * z1 + H32 * z2 + H33 * z3 + H34 * z4 + H35 * z5
        interpolant.c4 = H41 * z1 + H42 * z2 + H43 * z3 + H44 * z4 + H45 * z5
        interpolant.c5 = H51 * z1 + H52 * z2 + H53 * z3 + H54 * z4 + H55 * z5
        interpolant.c6 = interpolant.c7 = 0.0
