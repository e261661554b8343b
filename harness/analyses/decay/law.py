"""The equation of motion of a free decay, its unknowns, the seven laws of damping, and closed forms of two of them.

In the time theta = omega (t - t0), with y the displacement from rest and s = sign y',

    y'' + 2 zeta y' + s b y'^2 + s r + y = 0         (pendulum: sin y instead of y)

zeta = c/(2 m omega), r = f/k (a length), b = q/m (1/length) for a quadratic drag q v |v|, omega^2 = k/m.  The motion
starts from rest at y = A, where the body was held before, and ends at the first turning point with |y| <= r.  The loss
terms zeta, r and b are nonnegative.

Energy lost in each half cycle: starting values of the losses, and the loss as a function of the amplitude.

Between turning points of amplitudes a_i and a_(i+1), whose mean is a, the potential energy of a spring, divided by k,
falls by a (a_i - a_(i+1)) = pi zeta a^2 + 2 r a + 4/3 b a^3 (integrals over the undamped motion, so that noise enters
on the left side only), which is linear in the losses.  A pendulum is taken for the spring with the same energies, whose
amplitude is 2 sin(a/2): its losses are starting values of fits only.

The shape of the loss over the amplitude shows which law holds.  As a fraction of the energy, viscous damping takes the
same at every amplitude, dry friction takes more of small amplitudes (1/a) and drag more of large ones (a).

Return map of a free decay: the next amplitude and the duration of a half cycle, as functions of its amplitude.

    a -> (next a, duration)        tabulated at Chebyshev nodes between the sticking limit and the first amplitude

A half cycle depends on its amplitude alone.  The table costs one vectorised integration over its nodes; after that,
each half cycle is one Chebyshev interpolation, whatever the law.  The Taylor series of the motion are smooth in the
amplitude too and are interpolated with the same weights.

The half cycles from the nodes are integrated from one turning point to the next by Taylor series in theta.  Downward
s = -1 and the law is smooth.  With the velocity w = y', G = -g(y) and g(y) = y or sin y,

    w' = G + w d + r,    d = b w - 2 zeta,    G' = -w;    for a pendulum G' = -w C, C' = w G, where C = cos y

The k-th coefficients of these products, divided by k + 1, are the (k + 1)-th coefficients of w, G and C.  A half cycle
upward is the mirror image of one downward.

References
----------
J. W. Liang, B. F. Feeny, Nonlinear Dynamics 16 (1998) (decrements); Journal of Sound and Vibration 295 (2006) (energy
balance).  The division by the mean slope, which weights all half cycles alike, is not in these papers.
A. Jorba, M. Zou, Experimental Mathematics 14 (2005), section 3: integration by Taylor series
"""

from dataclasses import dataclass
from functools import lru_cache, reduce
from itertools import combinations
from math import log, pi, sqrt

import numpy as np
from scipy import optimize

from ...errors import HarnessError

UNKNOWNS = ("t0", "amplitude", "rest", "drift", "omega", "zeta", "r", "b")
T0, AMPLITUDE, REST, DRIFT, OMEGA, ZETA, R, B = range(8)
TERMS = ("zeta", "r", "b")
LAWS = tuple(law for size in (3, 2, 1) for law in combinations(TERMS, size))  # the full law first
TERM_NAMES = {"zeta": "viscous damping", "r": "dry friction", "b": "quadratic drag"}

Terms = tuple[str, ...]


def sublaws(terms: Terms) -> tuple[Terms, ...]:
    """Return every law with some of these terms, the full one first."""
    return tuple(law for law in LAWS if set(law) <= set(terms))


def unknown_indices(terms: Terms, drift: bool) -> np.ndarray:
    """Return the indices in UNKNOWNS of the values to fit for a law with these terms."""
    basic = [T0, AMPLITUDE, REST, *([DRIFT] if drift else []), OMEGA]
    return np.array(basic + [UNKNOWNS.index(term) for term in terms])


def unit_scales(scale: float) -> dict[int, float]:
    """Return the unit of each unknown that is reported, in units of the record, for positions in units of `scale`."""
    return {OMEGA: 1.0, ZETA: 1.0, R: scale, B: 1 / scale, REST: scale, DRIFT: scale}


def describe_law(terms: Terms) -> str:
    """Return the names of the terms, as in 'viscous damping and dry friction'."""
    *others, last = (TERM_NAMES[term] for term in terms)
    return f"{', '.join(others)} and {last}" if others else last


def sticking_limit(r: np.ndarray, is_pendulum: bool) -> np.ndarray:
    """Return the largest displacement at which friction holds the body at rest (same shape as r)."""
    return np.arcsin(np.clip(r, 0.0, 1.0)) if is_pendulum else r


def damping_ratio(x_0: float, x_n: float, cycles: float) -> float:
    """Return zeta from the logarithmic decrement of two turning points `cycles` apart."""
    check_decrease(x_0, x_n)
    delta = log(x_0 / x_n) / cycles
    return delta / sqrt(4 * pi * pi + delta * delta)


def friction_from_envelope(x_0: float, x_n: float, cycles: float, stiffness: float) -> float:
    """Return friction from the linear envelope: a force for a stiffness in N/m, a torque for one in N.m/rad."""
    check_decrease(x_0, x_n)
    return stiffness * (x_0 - x_n) / (4 * cycles)


def check_decrease(x_0: float, x_n: float) -> None:
    """Raise HarnessError unless x_0 > x_n > 0."""
    if not x_0 > x_n > 0:
        raise HarnessError(
            f"the turning points do not decay: from {x_0:.6g} to {x_n:.6g}; the motion is at rest, driven or undamped"
        )


@dataclass(frozen=True)
class EnergyLoss:
    """Energy lost per half cycle.

    Attributes
    ----------
    amplitude : numpy.ndarray
        Mean amplitudes (n,) of the half cycles between the turning points of the record.
    fraction : numpy.ndarray
        Energy (n,) that each half cycle loses, relative to the mean of its energies at both ends.
    curves : dict
        Amplitudes (m,) and fractions (m,) for each law.
    """

    amplitude: np.ndarray
    fraction: np.ndarray
    curves: dict[Terms, tuple[np.ndarray, np.ndarray]]


def estimate_losses(a: np.ndarray, terms: Terms, is_pendulum: bool) -> np.ndarray:
    """Return nonnegative zeta, r and b (3,) from successive amplitudes a (n,); those not in `terms` are zero."""
    a = 2 * np.sin(a / 2) if is_pendulum else a
    mean = (a[:-1] + a[1:]) / 2
    columns = np.stack([np.pi * mean, np.full_like(mean, 2.0), 4 / 3 * mean**2], axis=1)
    indices = [TERMS.index(term) for term in terms]
    scale = np.linalg.norm(columns[:, indices], axis=0)
    losses = np.zeros(len(TERMS))
    losses[indices] = optimize.nnls(columns[:, indices] / scale, a[:-1] - a[1:])[0] / scale
    return losses


def loss_fractions(a: np.ndarray, is_pendulum: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return mean amplitudes (n,) and losses (n,) of potential energy, from amplitudes a (n + 1,).

    A loss is relative to the mean of the energies at both ends, so it may exceed 1. The last half cycle is left out if
    it ends on the side where it started.
    """
    a = a[: int(np.argmin(a > 0))] if (a <= 0).any() else a
    energy = 2 * np.sin(a / 2) ** 2 if is_pendulum else a * a / 2
    middle = (energy[:-1] + energy[1:]) / 2
    return (a[:-1] + a[1:]) / 2, (energy[:-1] - energy[1:]) / middle


# indexed by is_pendulum: the series of the pendulum has poles at complex times, that of the spring has none
ORDER = {False: 20, True: 22}
TOLERANCE = {False: 1e-13, True: 1e-11}  # of the last terms of a series, relative to the first ones
MAX_SEGMENT = 1.7  # length of a segment in theta
MAX_SEGMENTS = 100  # in a half cycle
INDICES = np.arange(1.0, 1.0 + max(ORDER.values()))[:, None]  # numpy divides faster by an array than by a number
SIGNED_INDICES = np.stack([-INDICES, INDICES], axis=1)
NODES_LINEAR, NODES_DRAG = 2, 32  # of a spring, without and with quadratic drag
NODES_PENDULUM, NODES_LARGE = 40, 80  # of a pendulum, up to and beyond LARGE_ANGLE
LARGE_ANGLE = 2.0  # rad
MAX_HALF_CYCLES = 1_000_000
CACHED_TABLES = 4  # the last iterations of a fit, and its evaluation afterwards, use the same tables


@dataclass(frozen=True)
class HalfCycles:
    """L half cycles, each one or more segments with a Taylor series of their own.

    Attributes
    ----------
    end : numpy.ndarray
        Displacement (L,) at the end.
    duration : numpy.ndarray
        Duration (L,) in theta.
    series_starts : numpy.ndarray
        Start (S,) of each segment in theta.
    series : numpy.ndarray
        Taylor coefficients (ORDER + 1, S, L).
    """

    end: np.ndarray
    duration: np.ndarray
    series_starts: np.ndarray
    series: np.ndarray


@dataclass(frozen=True)
class HalfCycleSequence:
    """The N half cycles of P laws.

    Attributes
    ----------
    amplitudes : numpy.ndarray
        Amplitudes (N + 1, P) at the starts; the last row is the end of the last half cycle.
    starts : numpy.ndarray
        Start (N + 1, P) of each half cycle in theta.
    weights : numpy.ndarray
        Interpolation weights (P, N, M) of the M nodes.
    node_cycles : HalfCycles
        Half cycles from the nodes, all nodes of the first law first.
    """

    amplitudes: np.ndarray
    starts: np.ndarray
    weights: np.ndarray
    node_cycles: HalfCycles

    def series(self, order: int) -> np.ndarray:
        """Return the Taylor coefficients of a derivative of the motion.

        Returns
        -------
        coefficients : numpy.ndarray
            Coefficients (P, terms, S N); column s N + n is segment s of half cycle n, valid from series_starts[s] on.
        """
        laws, _, nodes = self.weights.shape
        at_nodes = self.node_cycles.series
        for _ in range(order):
            at_nodes = differentiate_series(at_nodes)
        terms = len(at_nodes)
        by_law = at_nodes.reshape(terms, -1, laws, nodes).transpose(2, 1, 0, 3)  # small products, which BLAS
        at_cycles = np.matmul(by_law, self.weights.transpose(0, 2, 1)[:, None])  # leaves in one thread
        return at_cycles.transpose(0, 2, 1, 3).reshape(laws, terms, -1)


def iterate_return_map(
    laws: np.ndarray,
    is_pendulum: bool,
    min_amplitude: float,
    max_count: int = MAX_HALF_CYCLES,
    end: float = np.inf,
) -> HalfCycleSequence:
    """Return the half cycles of several laws; the first law decides how many.

    Parameters
    ----------
    laws : numpy.ndarray
        Rows (P, 4) of A, zeta, r, b.
    min_amplitude : float
        Half cycles from a smaller amplitude, or from one that friction holds, are left out.
    max_count : int
        Maximum number of half cycles.
    end : float
        Half cycles that start later, in theta, are left out.
    """
    first, _, r, b = laws.T
    low = sticking_limit(r, is_pendulum)
    n_small, n_large = (NODES_PENDULUM, NODES_LARGE) if is_pendulum else (NODES_LINEAR, NODES_DRAG)
    count = n_large if (first.max() > LARGE_ANGLE if is_pendulum else b.any()) else n_small
    order = np.arange(float(count))
    angle = np.pi * (order + 0.5) / count
    scale = 2 / (first - low)
    nodes = low[:, None] + (np.cos(angle) + 1) / scale[:, None]
    node_cycles = tabulate(nodes.tobytes(), laws.tobytes(), is_pendulum)
    next_share = (-node_cycles.end.reshape(-1, count) - low[:, None]) * scale[:, None] - 1  # mapped to [-1, 1]
    weights = np.cos(np.outer(order, angle)) * 2 / count
    weights[0] /= 2
    coefficients = np.stack([next_share, node_cycles.duration.reshape(-1, count)]) @ weights.T
    max_share = np.ones(len(laws))
    shares, durations, min_share, at = [max_share], [np.zeros(len(laws))], min_amplitude * scale[0] - 1, 0.0
    polynomials: list[np.ndarray] = []
    while first[0] > low[0] and len(polynomials) < max_count and shares[-1][0] > min_share and at <= end:
        angle = np.arccos(np.minimum(np.maximum(shares[-1], -max_share), max_share))
        polynomials.append(np.cos(np.multiply.outer(angle, order)))
        share, duration = np.vecdot(polynomials[-1], coefficients)
        shares.append(share)
        durations.append(duration)
        at += float(duration[0])
    by_law = np.array(polynomials).reshape(len(polynomials), len(laws), count).transpose(1, 0, 2)
    amplitudes = low + (np.array(shares) + 1) / scale
    return HalfCycleSequence(amplitudes, np.cumsum(durations, axis=0), np.matmul(by_law, weights), node_cycles)


@lru_cache(CACHED_TABLES)
def tabulate(nodes: bytes, laws: bytes, is_pendulum: bool) -> HalfCycles:
    """Return the half cycles from the nodes (P, M) of the laws (P, 4), both given as bytes for the cache."""
    a, rows = np.frombuffer(nodes), np.frombuffer(laws).reshape(-1, 4)
    _, zeta, r, b = np.repeat(rows.T, len(a) // len(rows), axis=1)
    return integrate_half_cycles(a, zeta, r, b, is_pendulum)


def taylor_coefficients(
    y: np.ndarray, w: np.ndarray, zeta: np.ndarray, r: np.ndarray, b: np.ndarray, is_pendulum: bool
) -> np.ndarray:
    """Return the Taylor coefficients (ORDER + 1, L) of y about the states y, w (L,) of downward motion."""
    order, has_drag, d = ORDER[is_pendulum], bool(b.any()), b * w - 2 * zeta
    series, velocity = np.empty((order + 1, len(y))), np.empty((order, len(y)))
    # factors of the velocity: for a pendulum C and G; with drag also the damping d, which is then not constant
    factors = np.empty((2 * is_pendulum + has_drag, order, len(y)))
    series[0], velocity[0] = y, w
    if is_pendulum:
        factors[:2, 0] = np.cos(y), -np.sin(y)
    if has_drag:
        damping = factors[-1]
        damping[0] = d
    for k in range(order - 1):
        n, at = INDICES[k], k + 1
        if is_pendulum:
            products = np.einsum("ij,kij->kj", velocity[:at], factors[:, k::-1])
            np.divide(products[:2], SIGNED_INDICES[k], out=factors[1::-1, at])
            force = products[2] if has_drag else velocity[k] * d
            force += factors[1, k]
        else:
            force = np.einsum("ij,ij->j", velocity[:at], damping[k::-1]) if has_drag else velocity[k] * d
            force -= series[k]
            np.divide(velocity[k], n, out=series[at])
        if k == 0:
            force += r
        np.divide(force, n, out=velocity[at])
        if has_drag:
            np.multiply(b, velocity[at], out=damping[at])
    first_missing = 0 if is_pendulum else order - 1
    np.divide(velocity[first_missing:], INDICES[first_missing:order], out=series[first_missing + 1 :])
    return series


def differentiate_series(series: np.ndarray) -> np.ndarray:
    """Return the derivative of power series whose coefficients are along the first axis."""
    powers = np.arange(1, len(series)).reshape(-1, *(1,) * (series.ndim - 1))
    return series[1:] * powers


def evaluate_series(series: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Return the values (L,) of the series (K, L) at h (L,), by Horner's rule."""
    return reduce(lambda total, term: total * h + term, series[::-1])


def integrate_half_cycles(
    a: np.ndarray, zeta: np.ndarray, r: np.ndarray, b: np.ndarray, is_pendulum: bool
) -> HalfCycles:
    """Integrate half cycles from rest at y = a; all arrays (L,).  NaN where one does not come back to rest.

    Half cycles that have ended are continued by the downward law, so that at any theta all are smooth in a.
    """
    y, w = a, np.zeros_like(a)
    end, duration = np.full(len(a), np.nan), np.full(len(a), np.nan)
    at, starts, series = 0.0, [], []
    for _ in range(MAX_SEGMENTS):
        c = taylor_coefficients(y, w, zeta, r, b, is_pendulum)
        h = segment_length(c, TOLERANCE[is_pendulum])
        starts.append(at)
        series.append(c)
        velocity, powers = differentiate_series(c), h ** np.arange(len(c))
        with np.errstate(invalid="ignore", over="ignore"):  # beyond any motion of the law; the loop ends below
            y, w = powers @ c, powers[:-1] @ velocity
        ends = np.flatnonzero(np.isnan(end) & (w >= 0))
        if len(ends):
            root = time_to_standstill(velocity[:, ends], h)
            duration[ends], end[ends] = at + root, evaluate_series(c[:, ends], root)
        if not np.isnan(end).any() or not np.isfinite(y).all():
            break
        at += h
    return HalfCycles(end, duration, np.array(starts), np.stack(series, axis=1))


def segment_length(c: np.ndarray, tolerance: float) -> float:
    """Return the length over which all series c (K, L) are accurate: their last two terms are small relative to the
    first three."""
    size = np.abs(c[:3]).max(axis=0)
    last = np.abs(c[-2:]).max(axis=0)
    return min(MAX_SEGMENT, float(np.min((tolerance * size / (last + 1e-300)) ** (1 / (len(c) - 1)))))


def time_to_standstill(velocity: np.ndarray, h: float) -> np.ndarray:
    """Return the zeros in (0, h] of velocity series that are negative at 0 and not at h, by Newton's method from h."""
    slope, root = differentiate_series(velocity), np.full(velocity.shape[1], h)
    for _ in range(12):
        step = evaluate_series(velocity, root) / np.maximum(evaluate_series(slope, root), 1e-300)
        root = np.minimum(np.maximum(root - step, 0.0), h)
        if np.abs(step).max() < 1e-8:
            break  # convergence is quadratic: the next step is negligible
    return root
