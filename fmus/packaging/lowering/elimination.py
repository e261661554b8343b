"""Generates the linear solvers of stiff methods as lines of source for the states of a model: (1 - g h J) k = g r, and
(re + i im - J) u = r with complex numbers as pairs of real ones.

A state p whose rate is the state q has k_p = g (r_p + h k_q).  The remaining system is eliminated without pivoting.
A pivot gives NaN and rejects the step if it is zero or amplifies rounding errors, that is, if its elimination changes a
later pivot by a large multiple of that, a ratio without units.  A smaller h brings the matrix closer to 1.

Operations with entries that are always zero are left out, which changes no number: in a chain of n bodies, most of n^3.
"""

from collections.abc import Collection

from .layout import ModelLayout

MIN_PIVOT_RATIO = 1e-6  # smallest ratio of a later pivot to its change; same value in vectors.py


def nonzero_entries(spec: ModelLayout) -> set[tuple[str, str]]:
    """Return the entries (row, column) of the factorized matrix that can differ from zero."""
    names = list(spec.states)
    dynamic = [names[i] for i in spec.dynamic_states]
    moved = {state: rate for state, rate in spec.states.items() if rate in spec.states}
    result = {(i, i) for i in dynamic}
    for row in spec.dynamic_states:
        columns = [name for n, name in enumerate(names) if (row, n) not in spec.zeros]
        result |= {(names[row], j) for j in columns} | {
            (names[row], moved[j]) for j in columns if moved.get(j) in dynamic
        }
    for n, k in enumerate(dynamic):
        below = [i for i in dynamic[n + 1 :] if (i, k) in result]
        right = [j for j in dynamic[n + 1 :] if (k, j) in result]
        result |= {(i, j) for i in below for j in right}
    return result


def factorization_lines(w: str, g: str, h: str, spec: ModelLayout) -> list[str]:
    """Return lines that factorize the matrix; its entries are named w_v_x."""
    names = list(spec.states)
    dynamic = [names[i] for i in spec.dynamic_states]
    moved = {state: rate for state, rate in spec.states.items() if rate in spec.states}
    nonzero, lines = nonzero_entries(spec), []

    for i in dynamic:
        row = names.index(i)
        slopes = {j: spec.jacobian_entry(row, n) for n, j in enumerate(names) if (row, n) not in spec.zeros}
        lines += [f"{w}_{i}_{p} = {g} * {h} * {slopes[p]}" for p in moved if p in slopes]
        for j in [j for j in dynamic if (i, j) in nonzero]:
            terms = [slopes[j]] if j in slopes else []
            terms += [f"{w}_{i}_{p}" for p, q in moved.items() if q == j and p in slopes]
            entry = f"({' + '.join(terms)})" if len(terms) > 1 else "".join(terms) or "0.0"
            lines.append(f"{w}_{i}_{j} = {'1.0 - ' if i == j else '-'}{g} * {h} * {entry}")
    for n, k in enumerate(dynamic):
        below = [i for i in dynamic[n + 1 :] if (i, k) in nonzero]
        right = [j for j in dynamic[n + 1 :] if (k, j) in nonzero]
        tests = [
            f"fabs({w}_{k}_{k} * {w}_{i}_{i}) >= {MIN_PIVOT_RATIO} * fabs({w}_{i}_{k} * {w}_{k}_{i})"
            for i in below
            if (k, i) in nonzero
        ]
        lines.append(f"{w}_{k} = {g} / {w}_{k}_{k} if {' and '.join([*tests, f'{w}_{k}_{k} != 0.0'])} else nan")
        for i in below:
            lines.append(f"{w}_{i}_{k} = {w}_{i}_{k} * {w}_{k} / {g}")
            lines += [f"{w}_{i}_{j} = {w}_{i}_{j} - {w}_{i}_{k} * {w}_{k}_{j}" for j in right]
        lines += [f"{w}_{k}_{j} = {w}_{k}_{j} / {g}" for j in right]
    return lines


def solution_lines(
    k: str, w: str, r: str, g: str, h: str, spec: ModelLayout, known_zeros: Collection[str] = ()
) -> list[str]:
    """Return lines that solve for one right-hand side; `known_zeros` are names of components that are always zero."""
    names = list(spec.states)
    dynamic = [names[i] for i in spec.dynamic_states]
    moved = {state: rate for state, rate in spec.states.items() if rate in spec.states}
    nonzero, lines = nonzero_entries(spec), []
    for n, i in enumerate(dynamic):
        b = f"{r}_{i}" + "".join(
            f" + {w}_{i}_{p} * {r}_{p}" for p in moved if (i, p) in nonzero and f"{r}_{p}" not in known_zeros
        )
        b += "".join(f" - {w}_{i}_{j} * {k}_{j}" for j in dynamic[:n] if (i, j) in nonzero)
        lines.append(f"{k}_{i} = {b}" if n < len(dynamic) - 1 else f"{k}_{i} = ({b}) * {w}_{i}")
    for n, i in list(enumerate(dynamic))[-2::-1]:
        terms = "".join(f" - {w}_{i}_{j} * {k}_{j}" for j in dynamic[n + 1 :] if (i, j) in nonzero)
        lines.append(f"{k}_{i} = ({k}_{i}{terms}) * {w}_{i}")
    for p, q in moved.items():
        lines.append(f"{k}_{p} = {g} * ({'' if f'{r}_{p}' in known_zeros else f'{r}_{p} + '}{h} * {k}_{q})")
    return lines


def complex_factorization_lines(w: str, re: str, im: str, spec: ModelLayout) -> list[str]:
    """Return lines that factorize re + i im - J, after the elimination of states whose rate is a state.

    The parts of an entry are named w_v_u_re and w_v_u_im, those of the inverse of a pivot w_v_re and w_v_im.
    """
    names = list(spec.states)
    dynamic = [names[i] for i in spec.dynamic_states]
    moved = {state: rate for state, rate in spec.states.items() if rate in spec.states}
    nonzero = nonzero_entries(spec)
    # reciprocal of the shift, without squares, which may underflow
    lines = [f"{w}_im = {im} / {re}", f"{w}_re = 1.0 / ({re} + {im} * {w}_im)", f"{w}_im = -{w}_im * {w}_re"]

    for i in dynamic:
        row = names.index(i)
        slopes = {j: spec.jacobian_entry(row, n) for n, j in enumerate(names) if (row, n) not in spec.zeros}
        for j in [j for j in dynamic if (i, j) in nonzero]:
            through = [slopes[p] for p, q in moved.items() if q == j and p in slopes]
            terms = [slopes[j]] if j in slopes else []
            real = " + ".join(terms + [f"{w}_re * {product}" for product in through]) or "0.0"
            imaginary = " + ".join(f"{w}_im * {product}" for product in through) or "0.0"
            lines.append(f"{w}_{i}_{j}_re = {re if i == j else ''} - ({real})")
            lines.append(f"{w}_{i}_{j}_im = {im if i == j else ''} - ({imaginary})")
    for n, k in enumerate(dynamic):
        below = [i for i in dynamic[n + 1 :] if (i, k) in nonzero]
        right = [j for j in dynamic[n + 1 :] if (k, j) in nonzero]
        lines.append(f"{w}_size = {squared(f'{w}_{k}_{k}')}")
        tests = [
            f"{w}_size * ({squared(f'{w}_{i}_{i}')}) >= {MIN_PIVOT_RATIO} * {MIN_PIVOT_RATIO} * "
            f"(({squared(f'{w}_{i}_{k}')}) * ({squared(f'{w}_{k}_{i}')}))"
            for i in below
            if (k, i) in nonzero
        ]
        test = " and ".join([*tests, f"{w}_size != 0.0"])
        lines.append(f"{w}_{k}_re = {w}_{k}_{k}_re / {w}_size if {test} else nan")
        lines.append(f"{w}_{k}_im = -{w}_{k}_{k}_im / {w}_size if {test} else nan")
        for i in below:
            lines.append(f"{pair(f'{w}_{i}_{k}')} = {complex_product(f'{w}_{i}_{k}', f'{w}_{k}')}")
            lines += [subtraction(f"{w}_{i}_{j}", f"{w}_{i}_{k}", f"{w}_{k}_{j}") for j in right]
    return lines


def complex_solution_lines(k: str, m: str, w: str, r: str, q: str, spec: ModelLayout) -> list[str]:
    """Return lines that solve for a right-hand side r + i q, which is zero for states whose rate is a state.

    The solution k + i m has no components for these states.
    """
    names = list(spec.states)
    dynamic = [names[i] for i in spec.dynamic_states]
    nonzero, lines = nonzero_entries(spec), []
    for n, i in enumerate(dynamic):
        lines.append(f"{k}_{i}, {m}_{i} = {r}_{i}, {q}_{i}")
        lines += [solved(k, m, w, i, j) for j in dynamic[:n] if (i, j) in nonzero]
    for n, i in list(enumerate(dynamic))[::-1]:
        lines += [solved(k, m, w, i, j) for j in dynamic[n + 1 :] if (i, j) in nonzero]
        re, im = f"{k}_{i}", f"{m}_{i}"
        lines.append(f"{re}, {im} = {re} * {w}_{i}_re - {im} * {w}_{i}_im, {re} * {w}_{i}_im + {im} * {w}_{i}_re")
    return lines


def solved(k: str, m: str, w: str, i: str, j: str) -> str:
    """Return the line that subtracts the solved component j from the right-hand side of i."""
    entry = f"{w}_{i}_{j}"
    return (
        f"{k}_{i}, {m}_{i} = {k}_{i} - ({entry}_re * {k}_{j} - {entry}_im * {m}_{j}), "
        f"{m}_{i} - ({entry}_re * {m}_{j} + {entry}_im * {k}_{j})"
    )


def pair(a: str) -> str:
    """Return the names of both parts of a complex number."""
    return f"{a}_re, {a}_im"


def squared(a: str) -> str:
    """Return the squared magnitude of a complex number."""
    return f"{a}_re * {a}_re + {a}_im * {a}_im"


def complex_product(a: str, b: str) -> str:
    """Return both parts of a product."""
    return f"{a}_re * {b}_re - {a}_im * {b}_im, {a}_re * {b}_im + {a}_im * {b}_re"


def subtraction(a: str, b: str, c: str) -> str:
    """Return the line a = a - b c."""
    return (
        f"{a}_re, {a}_im = {a}_re - ({b}_re * {c}_re - {b}_im * {c}_im), {a}_im - ({b}_re * {c}_im + {b}_im * {c}_re)"
    )
