"""Closed form of one linear piece: m x'' + c x' + k x = F + (m q + k u) t, and its next standstill.

With z = c/(2 m), n^2 = k/m, p = F/m and the impulse response G (G'' + 2 z G' + n^2 G = 0, G(0) = 0, G'(0) = 1)

    x = x0 (G' + 2 z G) + v0 G + p I + q J  I = integral of G, J = integral of I
    v = -n^2 x0 G + v0 G' + p G + q I

G, G', I and J are written for each kind of damping so that no digit is lost near critical damping, with a weak
spring or without one (L. Meirovitch, Fundamentals of Vibrations, chapters 2 and 4, has the usual forms).
A resting point that drifts at the speed u (a driver pulling the spring) is offered without damping only: no
oscillator here has both.  Where inputs have no rates, neither has the force: q is zero.  Where it changes at a rate
that changes as well, it bends: the motion is then taken in stretches, each by its power series.
"""

from math import atan2, copysign, cos, exp, expm1, fabs, inf, log1p, pi, sin, sqrt

from .codes import MAX_INPUT_ORDER
from .power_series import TERMS, PowerSeries
from .rounding import ROUNDOFF_MARGIN
from .vectors import StateVector

UNDAMPED, UNDERDAMPED, OVERDAMPED, FREE, HIGHER_ORDER_INPUT = 1, 2, 3, 4, 5
MAX_BISECTIONS, MAX_DOUBLINGS = 200, 1000


class LinearClosedForm:
    """The constants of the oscillator, and the piece that began at x0, v0 with the acceleration a0."""

    def __init__(self):
        self.regime = UNDAMPED
        self.has_input_derivatives = True  # of some models, as Oscillator has it
        self.z = self.n2 = self.drift = self.q = 0.0
        self.w = self.slow_root = 0.0
        self.x0 = self.v0 = self.a0 = self.p = self.x_roundoff = 0.0
        self.velocity_series = PowerSeries()  # of the speed, where the force bends

    def prepare(self, m, c, k, drift):
        """Take over mass (kg), damping (N.s/m), stiffness (N/m) and the speed of the resting point (m/s)."""
        self.z, self.n2, self.drift = 0.5 * c / m, k / m, drift
        z, n = self.z, sqrt(self.n2)
        square = (n - z) * (n + z)
        self.w = sqrt(fabs(square))
        self.slow_root = 0.0
        if z == 0.0:
            self.regime = UNDAMPED if n > 0.0 else FREE
        elif square > 0.0:
            self.regime = UNDERDAMPED
        else:
            self.regime = OVERDAMPED
            self.slow_root = -self.n2 / (z + self.w)  # the slow root of s^2 + 2 z s + n^2, without cancellation

    def set_force_rate(self, q):
        """The force changes at a constant rate, and an acceleration that nothing else changed would at q (m/s3)."""
        self.q = q
        if self.regime == UNDAMPED:
            self.drift += q / self.n2  # so does the resting point

    def start_segment(self, x, v, a, p, x_roundoff):
        """A piece from x, v with the acceleration a, of which p is due to the constant force; x lacks what it lost to
        rounding."""
        self.x0, self.v0, self.a0, self.p, self.x_roundoff = x, v, a, p, x_roundoff

    def evaluate(self, t) -> StateVector:
        """Position and speed t seconds after the beginning of the piece."""
        if self.regime == UNDAMPED:
            half = 0.5 * self.w * t
            s, c = sin(half), cos(half)
            g, fall = 2.0 * s * c / self.w, 2.0 * s * s
            lag = t - g if half > 0.25 else t * lag_series(4.0 * half * half)
            return (
                self.x0 + (self.v0 * g + self.a0 * fall / self.n2 + self.drift * lag + self.x_roundoff),
                self.v0 * (1.0 - fall) + self.a0 * g + self.drift * fall,
            )
        if self.has_input_derivatives and self.regime == HIGHER_ORDER_INPUT:
            return self.evaluate_series(t)
        if self.has_input_derivatives and self.q != 0.0:
            return self.evaluate_ramp(t)
        if self.regime == FREE:
            return self.x0 + (self.v0 + 0.5 * self.a0 * t) * t, self.v0 + self.a0 * t
        if self.regime == UNDERDAMPED:
            half = 0.5 * self.w * t
            e, s, c = exp(-self.z * t), sin(half), cos(half)
            g, fall = 2.0 * s * c / self.w, 2.0 * s * s
            zg = self.z * g
            # 1 - e cos is split so that it keeps its digits at small t; without a force nobody asks for it
            integral = (e * (fall - zg) - expm1(-self.z * t)) / self.n2 if self.p != 0.0 else 0.0
            g, slope = e * g, e * (1.0 - fall - zg)
        else:
            g, slope, integral = self.overdamped_response(t)
        return (
            self.x0 * (slope + 2.0 * self.z * g) + self.v0 * g + self.p * integral,
            (self.p - self.n2 * self.x0) * g + self.v0 * slope,
        )

    def state_at_standstill(self, t) -> tuple[StateVector, float]:
        """Position and speed at the next standstill, t seconds after the beginning, and what the position lacks.

        Only a body that goes on for ever, behind its driver, comes far enough for that to matter.
        """
        if self.regime != UNDAMPED:
            x, _ = self.evaluate(t)
            return x, 0.0, 0.0
        x0, self.x0 = self.x0, 0.0
        way, _ = self.evaluate(t)
        self.x0, x = x0, x0 + way
        moved = x - x0
        return x, 0.0, (x0 - (x - moved)) + (way - moved)

    def evaluate_ramp(self, t) -> StateVector:
        """The same where the force changes."""
        z, w, n2 = self.z, self.w, self.n2
        if self.regime == OVERDAMPED:
            g, slope, once = self.overdamped_response(t)
        else:
            e, once = exp(-z * t), 0.0
            g = e * sin(w * t) / w if w > 0.0 else t
            slope = e * cos(w * t) - z * g
        if (z + w) * t < 0.5:
            once, twice = self.integral_series(t, 0.5 * t * t, 2), self.integral_series(t, t * t * t / 6.0, 3)
        elif self.regime == OVERDAMPED and w > 0.5 * z:
            twice = 0.5 * (exp_double_integral(self.slow_root, t) - exp_double_integral(-(z + w), t)) / w
        else:
            once = (1.0 - slope - 2.0 * z * g) / n2
            twice = (t - 2.0 * z * once - g) / n2
        return (
            self.x0 * (slope + 2.0 * z * g) + self.v0 * g + self.p * once + self.q * twice,
            (self.p - n2 * self.x0) * g + self.v0 * slope + self.q * once,
        )

    def expand_series(self, model, t, span):
        """Work out the series from t on, over so many seconds: v'' + 2 z v' + n^2 v = p', as the model tells it."""
        series = self.velocity_series
        series.duration = span
        series.c[0], series.c[1] = self.v0, self.a0 * span
        scale = span * span
        push = self.n2 * self.drift
        for k in range(TERMS - 1):
            if k < MAX_INPUT_ORDER:
                push += model.applied_acceleration_derivative(t, k + 1)
            back = 2.0 * self.z * span * (k + 1) * series.c[k + 1] + self.n2 * span * span * series.c[k]
            series.c[k + 2] = (push * scale - back) / ((k + 1) * (k + 2.0))
            push = 0.0
            scale *= span / (k + 1)

    def evaluate_series(self, t) -> StateVector:
        """Position and speed where the force bends."""
        series = self.velocity_series
        mean = v = 0.0
        for i in range(TERMS + 1):
            k = TERMS - i
            v = series.c[k] + v * t / series.duration
            mean = series.c[k] / (k + 1) + mean * t / series.duration
        return self.x0 + mean * t, v

    def overdamped_response(self, t):
        """G, G' and I from the two real roots, which coincide at critical damping."""
        z, w, slow_root = self.z, self.w, self.slow_root
        e = exp(slow_root * t)
        u = expm1(-2.0 * w * t)
        g = -0.5 * e * u / w if w > 0.0 else e * t
        mean = e * (1.0 + 0.5 * u)
        if (z + w) * t < 0.5:
            integral = self.integral_series(t, 0.5 * t * t, 2)
        elif w > 0.5 * z:
            fast = -(z + w)
            far = expm1(slow_root * t) / slow_root if slow_root < 0.0 else t
            integral = 0.5 * (far - expm1(fast * t) / fast) / w
        else:
            integral = (1.0 - mean - z * g) / self.n2
        return g, mean - z * g, integral

    def integral_series(self, t, term, power):
        """An integral of G at small t, where its closed form cancels, by its series, whose first term is of that power:
        that of I'' = 1 - 2 z I' - n^2 I or J'' = t - 2 z J' - n^2 J."""
        y, y2 = 2.0 * self.z * t, self.n2 * t * t
        last, total = 0.0, term
        for j in range(power, 18):
            term, last = -(y * j * term + y2 * last) / ((j + 1.0) * j), term
            total += term
        return total

    def next_standstill(self, mode):
        """When the speed, of the sign of mode, next comes to zero; inf if it never does."""
        v, a = fabs(self.v0), mode * self.a0  # a product would turn the speed of a body at rest into -0.0
        if self.regime == UNDAMPED:
            return self.undamped_standstill(v, a / self.w, mode * self.drift)
        if self.has_input_derivatives and self.q != 0.0:
            return self.ramped_standstill(mode, v, a, mode * self.q)
        return self.decay_time(v, a, mode * self.p)

    def decay_time(self, v, a, p):
        """When what begins at v with the rate a and obeys the homogeneous equation next comes to zero, from above."""
        b = a + self.z * v
        w = self.w
        if self.regime == UNDERDAMPED:
            return atan2(v * w, -b) / w
        # the share of the slow root; without a spring that is what p keeps up
        slow_root = b + w * v if self.n2 > 0.0 else p
        if v == 0.0 or slow_root >= 0.0:
            return inf
        if w == 0.0:
            return -v / b
        return -0.5 * log1p(2.0 * w * v / (slow_root - 2.0 * w * v)) / w

    def ramped_standstill(self, mode, v, a, q):
        """The same where the force changes at the rate q, in the direction of the mode.

        The acceleration then obeys the homogeneous equation.  So its zeros have a closed form, and where the speed
        falls from one to the next, the time of a standstill is halved down to.
        """
        if self.regime == FREE:
            return free_standstill(v, a, q)
        z, w = self.z, self.w
        jerk = q - 2.0 * z * a - self.n2 * v
        low, high = 0.0, inf
        if a > 0.0 or (a == 0.0 and jerk > 0.0):
            low = self.decay_time(fabs(a), jerk, q)
            if self.regime == UNDERDAMPED:
                high = low + pi / w
        else:
            high = self.decay_time(fabs(a), -jerk, -q)
        if not low < inf or (high == inf and q > 0.0):
            return inf  # it rises for ever, or falls towards a speed that lasts
        if high < inf:
            _, least = self.evaluate_ramp(high)
            if mode * least > ROUNDOFF_MARGIN * v:
                return inf
        else:
            reach = 1.0 / (z + w)
            for _ in range(MAX_DOUBLINGS):
                high = low + reach
                reach *= 2.0
                _, least = self.evaluate_ramp(high)
                if mode * least <= 0.0:
                    break
        for _ in range(MAX_BISECTIONS):
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            _, here = self.evaluate_ramp(middle)
            if mode * here > 0.0:
                low = middle
            else:
                high = middle
        return high

    def undamped_standstill(self, v, q, u):
        """First root of u + (v - u) cos y + q sin y, a quadratic in T = tan(y/2), over w; it may be a double one."""
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
    """1 - sin(y)/y for y below 0.5, from y^2, by its series."""
    tail = 1.0 - square / 72.0 * (1.0 - square / 110.0 * (1.0 - square / 156.0 * (1.0 - square / 210.0)))
    return square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * tail))


def exp_double_integral(s, t):
    """exp(s t), twice integrated."""
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
    """First root of v + a t + q t^2/2 beyond zero; it may be a double one."""
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


def half_angle(over, under):
    """The angle in (0, pi] whose tangent is over/under; a tangent of zero is the end of the turn, not its start."""
    y = atan2(over, under)
    if y <= 0.0:
        y += pi
    return y if y > 0.0 else pi
