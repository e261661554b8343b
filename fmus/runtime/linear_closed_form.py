"""Closed form of a linear segment, m x'' + c x' + k x = F + (m q + k u) t, and the time of its next standstill.

With z = c/(2 m), n^2 = k/m, p = F/m and the impulse response G (G'' + 2 z G' + n^2 G = 0, G(0) = 0, G'(0) = 1)

    x = x0 (G' + 2 z G) + v0 G + p I + q J  I = integral of G, J = integral of I
    v = -n^2 x0 G + v0 G' + p G + q I

Each damping regime has its own form of G, G', I and J, which keeps full precision near critical damping and with a weak
spring or none (L. Meirovitch, Fundamentals of Vibrations, chapters 2 and 4, has the usual forms).  An equilibrium that
moves at the velocity u (a driver that pulls the spring) is supported without damping only.  The rate q of the force is
zero unless inputs have rates.

With negative damping or stiffness the motion grows, and x = x0 + v0 G + (p - n^2 x0) I + q J is used instead, because a
body in an equilibrium then stays there exactly.  q includes the moving equilibrium, n^2 u.
"""

from math import atan2, copysign, cos, exp, expm1, fabs, fmod, inf, log1p, pi, sin, sqrt

from .codes import EPSILON, ROUNDOFF_MARGIN
from .vectors import StateVector

UNDAMPED, UNDERDAMPED, OVERDAMPED, FREE, GROWING = 1, 2, 3, 4, 5
MAX_ITERATIONS, MAX_DOUBLINGS = 200, 1000
MAX_LOG_GROWTH = 30.0  # of a growing motion in one segment, so that a divergence is noticed before any overflow


class LinearClosedForm:
    """Constants of the oscillator, and the current segment, which starts at x0, v0 with the acceleration a0."""

    def __init__(self, has_input_derivatives):
        self.regime = UNDAMPED
        self.has_input_derivatives = has_input_derivatives
        self.z = self.n2 = self.drift = self.q = 0.0
        self.w = self.upper_root = self.lower_root = 0.0
        self.oscillates = self.is_steady = False
        self.max_rate = 0.0  # bound of the magnitudes of the roots of s^2 + 2 z s + n^2
        self.max_duration = self.horizon = inf  # of a segment that grows, and of the current one
        self.may_end_early = False  # the next segment need not reach a standstill
        self.x0 = self.v0 = self.a0 = self.p = self.net = self.x_roundoff = 0.0

    def prepare(self, m, c, k, drift):
        """Set the coefficients.

        Parameters
        ----------
        m, c, k
            Mass in kg, damping in N s/m, stiffness in N/m.
        drift
            Velocity of the equilibrium in m/s.
        """
        self.z, self.n2, self.drift = 0.5 * c / m, k / m, drift
        z, n = self.z, sqrt(fabs(self.n2))
        square = (n - z) * (n + z) if self.n2 >= 0.0 else -(z * z + n * n)
        self.w = sqrt(fabs(square))
        self.oscillates = square > 0.0
        self.max_rate = fabs(z) + self.w
        self.upper_root = self.q = 0.0
        self.max_duration = self.horizon = inf
        if z < 0.0 or self.n2 < 0.0:
            self.prepare_growth()
        elif z == 0.0:
            self.regime = UNDAMPED if n > 0.0 else FREE
        elif square > 0.0:
            self.regime = UNDERDAMPED
        else:
            self.regime = OVERDAMPED
            self.upper_root = -self.n2 / (z + self.w)  # slow root of s^2 + 2 z s + n^2, without cancellation

    def prepare_growth(self):
        """Set the constants of a motion with negative damping or stiffness."""
        self.regime = GROWING
        self.q = self.n2 * self.drift
        growth_rate = -self.z
        if not self.oscillates:  # two real roots, the larger one positive, without cancellation
            if self.z > 0.0:
                self.lower_root = -self.max_rate
                self.upper_root = self.n2 / self.lower_root
            else:
                self.upper_root = self.max_rate
                self.lower_root = self.n2 / self.upper_root
            growth_rate = self.upper_root
        if growth_rate > 0.0:  # it may underflow to zero
            self.max_duration = MAX_LOG_GROWTH / growth_rate

    def set_force_rate(self, q):
        """Set the constant rate q (m/s3) of the acceleration that is due to the force."""
        self.q += q
        self.may_end_early = True
        if self.regime == UNDAMPED:
            self.drift += q / self.n2  # the equilibrium moves, too

    def start_segment(self, x, v, a, p, x_roundoff):
        """Start a segment at x, v with acceleration a.

        `p` is the acceleration due to the constant force, `x_roundoff` the rounding error of x.
        """
        self.x0, self.v0, self.a0, self.p, self.x_roundoff = x, v, a, p, x_roundoff
        self.net = p - self.n2 * x if v != 0.0 and self.z != 0.0 else a  # the acceleration without damping
        if self.regime == GROWING:
            self.is_steady = a == 0.0 and self.q - self.n2 * v == 0.0
            self.horizon = inf if self.is_steady else self.max_duration

    def evaluate(self, t) -> StateVector:
        """Return position and velocity t seconds after the start of the segment."""
        if self.regime == UNDAMPED:
            half = 0.5 * self.w * t
            s, c = sin(half), cos(half)
            g, one_minus_cos = 2.0 * s * c / self.w, 2.0 * s * s
            lag = t - g if half > 0.25 else t * lag_series(4.0 * half * half)
            return (
                self.x0 + (self.v0 * g + self.a0 * one_minus_cos / self.n2 + self.drift * lag + self.x_roundoff),
                self.v0 * (1.0 - one_minus_cos) + self.a0 * g + self.drift * one_minus_cos,
            )
        if self.has_input_derivatives and self.q != 0.0 and self.regime != GROWING:
            return self.evaluate_ramp(t)
        if self.regime == UNDERDAMPED:
            half = 0.5 * self.w * t
            e, s, c = exp(-self.z * t), sin(half), cos(half)
            g, one_minus_cos = 2.0 * s * c / self.w, 2.0 * s * s
            zg = self.z * g
            # 1 - e cos is split to avoid cancellation at small t; needed only with a force
            integral = (e * (one_minus_cos - zg) - expm1(-self.z * t)) / self.n2 if self.p != 0.0 else 0.0
            g, slope = e * g, e * (1.0 - one_minus_cos - zg)
        elif self.regime == OVERDAMPED:
            g, slope, integral = self.overdamped_response(t)
        elif self.regime == FREE:
            return self.x0 + (self.v0 + 0.5 * self.a0 * t) * t, self.v0 + self.a0 * t
        else:
            return self.evaluate_growth(t)
        return (
            self.x0 * (slope + 2.0 * self.z * g) + self.v0 * g + self.p * integral,
            (self.p - self.n2 * self.x0) * g + self.v0 * slope,
        )

    def state_at_standstill(self, t) -> tuple[StateVector, float]:
        """Return position, velocity (zero) and rounding error of the position at a standstill at time t.

        The rounding error matters only for a body that follows a driver over a long distance.
        """
        if self.regime != UNDAMPED:
            x, _ = self.evaluate(t)
            return x, 0.0, 0.0
        x0, self.x0 = self.x0, 0.0
        distance, _ = self.evaluate(t)
        self.x0, x = x0, x0 + distance
        x_step = x - x0
        return x, 0.0, (x0 - (x - x_step)) + (distance - x_step)

    def evaluate_ramp(self, t) -> StateVector:
        """Return position and velocity where the force has a constant rate."""
        z, w, n2 = self.z, self.w, self.n2
        if self.max_rate * t < 0.5:
            g_integral, g_integral2 = self.integrals_at_small_time(t)
            g = t - 2.0 * z * g_integral - n2 * g_integral2
            slope = 1.0 - 2.0 * z * g - n2 * g_integral
        elif self.regime == OVERDAMPED and w > 0.5 * z:
            upper, lower = self.upper_root, -self.max_rate
            g = 0.5 * (exp(upper * t) - exp(lower * t)) / w
            slope = 0.5 * (upper * exp(upper * t) - lower * exp(lower * t)) / w
            g_integral = 0.5 * (exp_integral(upper, t) - exp_integral(lower, t)) / w
            g_integral2 = 0.5 * (exp_double_integral(upper, t) - exp_double_integral(lower, t)) / w
        else:
            if self.regime == OVERDAMPED:
                g, slope, _ = self.overdamped_response(t)
            else:
                e = exp(-z * t)
                g = e * sin(w * t) / w
                slope = e * cos(w * t) - z * g
            g_integral = (1.0 - slope - 2.0 * z * g) / n2
            g_integral2 = (t - 2.0 * z * g_integral - g) / n2
        return (
            self.x0 * (slope + 2.0 * z * g) + self.v0 * g + self.p * g_integral + self.q * g_integral2,
            self.v0 * slope + self.net * g + self.q * g_integral,
        )

    def evaluate_growth(self, t) -> StateVector:
        """Return position and velocity with negative damping or stiffness, for a force with or without a rate."""
        if self.is_steady:
            return self.x0 + self.v0 * t, self.v0
        z, w = self.z, self.w
        if self.oscillates:
            e, half = exp(-z * t), 0.5 * w * t
            s, c = sin(half), cos(half)
            g = e * (2.0 * s * c / w)
            mean = e * (1.0 - 2.0 * s * s)
            slope = mean - z * g
        else:
            e, u = exp(self.upper_root * t), expm1(-2.0 * w * t)
            g = -0.5 * e * u / w if w > 0.0 else e * t
            mean = e * (1.0 + 0.5 * u)
            if z > 0.0:
                slope = 0.5 * (self.upper_root * e - self.lower_root * exp(self.lower_root * t)) / w
            else:
                slope = mean - z * g
        if self.max_rate * t < 1.0:
            g_integral, g_integral2 = self.integrals_at_small_time(t)
        elif self.oscillates or w <= -0.5 * z:
            g_integral = (1.0 - mean - z * g) / self.n2
            g_integral2 = (t - 2.0 * z * g_integral - g) / self.n2
        else:
            upper, lower = self.upper_root, self.lower_root
            g_integral = 0.5 * (exp_integral(upper, t) - exp_integral(lower, t)) / w
            g_integral2 = 0.5 * (exp_double_integral(upper, t) - exp_double_integral(lower, t)) / w
        return (
            self.x0 + (self.v0 * g + self.net * g_integral + self.q * g_integral2),
            self.v0 * slope + self.net * g + self.q * g_integral,
        )

    def overdamped_response(self, t):
        """Return G, G' and I from the two real roots, which coincide at critical damping."""
        z, w, upper_root = self.z, self.w, self.upper_root
        e = exp(upper_root * t)
        u = expm1(-2.0 * w * t)
        g = -0.5 * e * u / w if w > 0.0 else e * t
        mean = e * (1.0 + 0.5 * u)
        if (z + w) * t < 0.5:
            integral, _ = self.integrals_at_small_time(t)
        elif w > 0.5 * z:
            integral = 0.5 * (exp_integral(upper_root, t) - exp_integral(-(z + w), t)) / w
        else:
            integral = (1.0 - mean - z * g) / self.n2
        return g, mean - z * g, integral

    def integrals_at_small_time(self, t):
        """Return I and J by the series of I, until further terms change nothing."""
        y, y2 = 2.0 * self.z * t, self.n2 * t * t
        previous, term = 0.0, 0.5 * t * t
        total, total2 = term, term * t / 3.0
        for j in range(2, 24):
            term, previous = -(y * j * term + y2 * previous) / ((j + 1.0) * j), term
            total += term
            total2 += term * t / (j + 2.0)
            if total + (fabs(term) + fabs(previous)) == total:
                break
        return total, total2

    def next_standstill(self, mode):
        """Return when the velocity, which has the sign of `mode`, next reaches zero; inf if never."""
        v, a = fabs(self.v0), mode * self.a0  # not mode * v0, which is -0.0 for a body at rest
        if self.regime == UNDAMPED:
            return self.undamped_standstill(v, a / self.w, mode * self.drift)
        if self.regime == GROWING and self.is_steady:
            return inf
        if self.regime == GROWING and self.q != 0.0:
            return self.growing_standstill(mode, v, a, mode * self.q)
        if self.has_input_derivatives and self.q != 0.0:
            return self.ramped_standstill(mode, v, a, mode * self.q)
        return self.decay_time(v, a, mode * self.net)

    def decay_time(self, v, a, net):
        """Return when a solution of the homogeneous equation with value v >= 0 and rate a next falls to zero.

        `net` is a + 2 z v, without cancellation.
        """
        w = self.w
        if self.oscillates:
            return atan2(v * w, -(a + self.z * v)) / w
        weight = net + self.upper_root * v  # of the upper root
        if v == 0.0 or weight >= 0.0:
            return inf
        return 0.5 * log1p(-2.0 * w * v / weight) / w if w > 0.0 else -v / weight

    def ramped_standstill(self, mode, v, a, q):
        """Return the same for a force with rate q, in the direction of the mode; inf if it is beyond the horizon.

        The acceleration obeys the homogeneous equation, so that its zeros have a closed form.  Newton's method finds
        the standstill between two of them.
        """
        if self.regime == FREE:
            return free_standstill(v, a, q)
        self.horizon = inf
        if self.may_end_early:  # a rate that is set anew in each communication step does not last until a standstill
            self.may_end_early = False
            self.horizon = self.sliding_duration(v, a, q)
            if self.horizon < inf:
                return inf
        low, high = self.falling_interval(v, a, q)
        if not low < inf or (high == inf and q > 0.0):
            return inf  # it rises forever, or falls towards a positive velocity
        if high < inf:
            _, v_min = self.evaluate_ramp(high)
            if mode * v_min > ROUNDOFF_MARGIN * v:
                return inf
        else:
            width = 1.0 / self.max_rate
            for _ in range(MAX_DOUBLINGS):
                high = low + width
                width *= 2.0
                _, v_min = self.evaluate_ramp(high)
                if mode * v_min <= 0.0:
                    break
        return self.locate_standstill(mode, low, high)

    def sliding_duration(self, v, a, q):
        """Return a time until which the velocity stays positive; inf if the bound below shows none.

        While max_rate t <= 1, G' + 2 z G lies between 1/2 and 1, and G between 0 and t.  So the acceleration, which is
        a (G' + 2 z G) + (q - 2 z a - n^2 v) G, stays above a linear function of time.
        """
        jerk = q - 2.0 * self.z * a - self.n2 * v
        least_a, least_jerk = a if a < 0.0 else 0.5 * a, jerk if jerk < 0.0 else 0.0
        duration = 1.0 / self.max_rate
        for _ in range(3):
            if v + (least_a + 0.5 * least_jerk * duration) * duration > ROUNDOFF_MARGIN * v:
                return duration
            duration *= 0.5
        return inf

    def growing_standstill(self, mode, v, a, q):
        """Return the same for a growing motion, inf if it is beyond the horizon."""
        low, high = self.falling_interval(v, a, q)
        if self.oscillates and high < self.horizon:
            period = 2.0 * pi / self.w
            log_growth = -self.z * period
            _, v_min = self.evaluate(high)
            swing = q / self.n2 - mode * v_min  # it grows by the same factor in each period
            if not (swing > 0.0 and log_growth > 0.0):
                return inf
            if mode * v_min > ROUNDOFF_MARGIN * v:
                periods = log1p(mode * v_min / swing) / log_growth
                high += (periods - fmod(periods, 1.0)) * period  # the minimum at or just before the one below zero
                _, v_min = self.evaluate(high if high < self.horizon else self.horizon)
                if mode * v_min > 0.0:
                    high += period
                low = high - 0.5 * period
        if not low < self.horizon:
            return inf
        high = high if high < self.horizon else self.horizon
        _, v_min = self.evaluate(high)
        return inf if mode * v_min > ROUNDOFF_MARGIN * v else self.locate_standstill(mode, low, high)

    def falling_interval(self, v, a, q):
        """Return when the acceleration becomes negative, and when positive again."""
        jerk = q - 2.0 * self.z * a - self.n2 * v
        net = q - self.n2 * v  # jerk without damping
        low, high = 0.0, inf
        if a > 0.0 or (a == 0.0 and jerk > 0.0):
            low = self.decay_time(fabs(a), jerk, net)
            if self.oscillates:
                high = low + pi / self.w
        else:
            high = self.decay_time(fabs(a), -jerk, -net)
        return low, high

    def locate_standstill(self, mode, low, high):
        """Return when the velocity in the direction of the mode, which falls from `low` to `high`, reaches zero.

        By Newton's method, or by bisection where that leaves the interval.
        """
        t = -self.v0 / self.a0 if low == 0.0 and self.a0 != 0.0 else 0.0
        if not low < t < high:
            t = 0.5 * (low + high)
        for _ in range(MAX_ITERATIONS):
            x, v = self.evaluate(t)
            if mode * v > 0.0:
                low = t
            else:
                high = t
            a = self.p + self.q * t - self.n2 * x - 2.0 * self.z * v
            t_next = t - v / a if a != 0.0 else low
            if fabs(t_next - t) <= EPSILON * t:
                return t_next
            if not low < t_next < high:
                t_next = 0.5 * (low + high)
                if not low < t_next < high:
                    break
            t = t_next
        return high

    def undamped_standstill(self, v, q, u):
        """Return the first root of u + (v - u) cos(w t) + q sin(w t), a quadratic in tan(w t/2); it may be double."""
        lead = 2.0 * u - v
        square = q * q - v * lead
        if square < 0.0:
            if square < -ROUNDOFF_MARGIN * q * q:
                return inf
            square = 0.0
        s = -(q + copysign(sqrt(square), q))
        first, second = half_angle(s, lead), half_angle(v, s)
        return 2.0 * (first if first < second else second) / self.w


def lag_series(square):
    """Return 1 - sin(y)/y from y^2 by its series, for y below 0.5."""
    tail = 1.0 - square / 72.0 * (1.0 - square / 110.0 * (1.0 - square / 156.0 * (1.0 - square / 210.0)))
    return square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * tail))


def exp_integral(s, t):
    """Return the integral of exp(s t) from 0 to t."""
    return expm1(s * t) / s if s != 0.0 else t


def exp_double_integral(s, t):
    """Return the double integral of exp(s t) from 0 to t."""
    y = s * t
    if fabs(y) > 0.5:
        return (expm1(y) - y) / (s * s)
    term = 0.5 * t * t
    total = term
    for j in range(3, 18):
        term *= y / j
        total += term
    return total


def free_standstill(v, a, q):
    """Return the first positive root of v + a t + q t^2/2, which may be double."""
    square = a * a - 2.0 * q * v
    if square < 0.0:
        if square < -ROUNDOFF_MARGIN * a * a:
            return inf
        square = 0.0
    s = -(a + copysign(sqrt(square), a))
    if s == 0.0:
        return inf
    first, second = s / q, 2.0 * v / s
    if first <= 0.0 or 0.0 < second < first:
        first = second
    return first if first > 0.0 else inf


def half_angle(numerator, denominator):
    """Return the angle in (0, pi] whose tangent is numerator/denominator; a tangent of zero gives pi."""
    if denominator < numerator < 0.0:  # a small angle, which would lose its digits below
        numerator, denominator = -numerator, -denominator
    y = atan2(numerator, denominator)
    if y <= 0.0:
        y += pi
    return y if y > 0.0 else pi
