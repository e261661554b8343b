"""Elimination for the linear systems of the stiff methods: (1 - g h J) k = g r, and (re + i im - J) u = r.

A state p whose rate is the state q has k_p = g (r_p + h k_q).  The remaining system is eliminated without pivoting.
A pivot gives NaN and rejects the step if it is zero or amplifies rounding errors, that is, if its elimination changes a
later pivot by a large multiple of that, a ratio without units.  A smaller h brings the matrix closer to 1.

The functions run on numbers, in tests, and at build time on names, which gives the statements of an FMU
(compiler/lowering/elimination.py).  Vectors are dictionaries by index of a state, matrices by row and column; what is
always zero is missing.  In a chain of n bodies this leaves out most of n^3 operations, and it changes no number.
`dynamic_states` are those whose rate is computed; `kinematic_states` maps each other state to the one that is its rate.
"""

from math import nan

SMALL = 1e-6  # smallest ratio of a later pivot to its change by the elimination of another


class Entries(dict):
    """Vector or matrix of numbers; in the source of an FMU, a subclass gives each entry a name."""

    def store(self, name, value):
        """Store an intermediate result, which has a name in the source of an FMU; return it."""
        return value

    def quotient_if(self, tests, a, b):
        """Return a / b if all tests are true, else NaN."""
        return a / b if all(tests) else nan


class Complex:
    """Complex number as a pair of real ones, with the order of operations that the source of an FMU has."""

    def __init__(self, re, im):
        self.re, self.im = re, im

    def __sub__(self, other):
        return Complex(self.re - other.re, self.im - other.im)

    def __neg__(self):
        return Complex(-self.re, -self.im)

    def __mul__(self, other):
        return Complex(self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re)

    def squared_magnitude(self):
        """Return the square of the magnitude."""
        return self.re * self.re + self.im * self.im


def factorize(w, g, h, J, dynamic_states, kinematic_states):
    """Factorize 1 - g h J into the entries w; inverse pivots, times g, take the place of the pivots."""
    for i in dynamic_states:
        for p in kinematic_states:
            if (i, p) in J:
                w[i, p] = g * h * J[i, p]
        for j in dynamic_states:
            terms = [J[i, j]] if (i, j) in J else []
            terms += [w[i, p] for p, rate in kinematic_states.items() if rate == j and (i, p) in J]
            if i == j:
                w[i, j] = 1.0 - g * h * total(terms)
            elif terms:
                w[i, j] = -g * h * total(terms)
    for n, k in enumerate(dynamic_states):
        below = [i for i in dynamic_states[n + 1 :] if (i, k) in w]
        right = [j for j in dynamic_states[n + 1 :] if (k, j) in w]
        tests = [abs(w[k, k] * w[i, i]) >= SMALL * abs(w[i, k] * w[k, i]) for i in below if i in right]
        w[k, k] = w.quotient_if([*tests, w[k, k] != 0.0], g, w[k, k])
        for i in below:
            w[i, k] = w[i, k] * w[k, k] / g
            for j in right:
                w[i, j] = difference(w, (i, j), w[i, k] * w[k, j])
        for j in right:
            w[k, j] = w[k, j] / g


def solve(k, w, g, h, r, dynamic_states, kinematic_states):
    """Solve for k, given the factorized matrix."""
    for n, i in enumerate(dynamic_states):
        b = r[i]
        for p in kinematic_states:
            if (i, p) in w and p in r:
                b = b + w[i, p] * r[p]
        b = subtract_products(b, w, i, k, dynamic_states[:n])
        k[i] = b * w[i, i] if i == dynamic_states[-1] else b
    for n, i in reversed(list(enumerate(dynamic_states[:-1]))):
        k[i] = subtract_products(k[i], w, i, k, dynamic_states[n + 1 :]) * w[i, i]
    for p, rate in kinematic_states.items():
        k[p] = g * (r[p] + h * k[rate]) if p in r else g * (h * k[rate])


def factorize_complex(w, re, im, J, dynamic_states, kinematic_states):
    """Factorize re + i im - J into the entries w; inverse pivots take the place of the pivots."""
    ratio = w.store("ratio", im / re)  # for the reciprocal of the shift without squares, which may underflow
    real = w.store("real", 1.0 / (re + im * ratio))
    imaginary = w.store("imaginary", -ratio * real)
    for i in dynamic_states:
        for j in dynamic_states:
            direct = [J[i, j]] if (i, j) in J else []
            others = [J[i, p] for p, rate in kinematic_states.items() if rate == j and (i, p) in J]
            entry = Complex(
                total([*direct, *(real * slope for slope in others)]),
                total([imaginary * slope for slope in others]),
            )
            if i == j:
                w[i, j] = Complex(re, im) - entry
            elif direct or others:
                w[i, j] = -entry
    for n, k in enumerate(dynamic_states):
        below = [i for i in dynamic_states[n + 1 :] if (i, k) in w]
        right = [j for j in dynamic_states[n + 1 :] if (k, j) in w]
        size = w.store("size", w[k, k].squared_magnitude())
        tests = [
            size * w[i, i].squared_magnitude()
            >= SMALL * SMALL * (w[i, k].squared_magnitude() * w[k, i].squared_magnitude())
            for i in below
            if i in right
        ]
        tests.append(size != 0.0)
        w[k, k] = Complex(w.quotient_if(tests, w[k, k].re, size), w.quotient_if(tests, -w[k, k].im, size))
        for i in below:
            w[i, k] = w[i, k] * w[k, k]
            for j in right:
                w[i, j] = difference(w, (i, j), w[i, k] * w[k, j])


def solve_complex(u, w, r, dynamic_states):
    """Solve for u, given the factorized matrix; r is zero for states whose rate is a state, and u has no such part."""
    for n, i in enumerate(dynamic_states):
        b = subtract_products(r[i], w, i, u, dynamic_states[:n])
        u[i] = b * w[i, i] if i == dynamic_states[-1] else b
    for n, i in reversed(list(enumerate(dynamic_states[:-1]))):
        u[i] = subtract_products(u[i], w, i, u, dynamic_states[n + 1 :]) * w[i, i]


def total(terms):
    """Return the sum of terms in their order."""
    result = terms[0] if terms else 0.0
    for term in terms[1:]:
        result = result + term
    return result


def difference(w, place, product):
    """Return an entry minus a product."""
    return w[place] - product if place in w else -product


def subtract_products(b, w, i, k, columns):
    """Return b minus the products of the entries in row i with the elements of k."""
    for j in columns:
        if (i, j) in w:
            b = b - w[i, j] * k[j]
    return b
