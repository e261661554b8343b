"""Generates the linear solver of Rosenbrock methods, (1 - g h J) k = g r, as lines of source for the states of a model.

A state p whose rate is the state q has k_p = g (r_p + h k_q).  The remaining system is eliminated without pivoting.
A pivot that is zero, or small compared with the entries below it, gives NaN and rejects the step, because it would
amplify rounding errors.  A smaller h brings the matrix closer to 1.

Operations with entries that are always zero are left out, which changes no number: in a chain of n bodies, most of n^3.
"""

from .layout import ModelLayout

MIN_PIVOT_RATIO = 1e-6  # smallest ratio of a pivot to the entries below it; same value in vectors.py


def nonzero_entries(spec: ModelLayout) -> set[tuple[str, str]]:
    """Return the entries (row, column) of the factorized matrix that can differ from zero."""
    names = list(spec.states)
    own = [names[i] for i in spec.dynamic_states]
    moved = {state: rate for state, rate in spec.states.items() if rate in spec.states}
    result = {(i, i) for i in own}
    for row in spec.dynamic_states:
        columns = [name for n, name in enumerate(names) if (row, n) not in spec.zeros]
        result |= {(names[row], j) for j in columns} | {(names[row], moved[j]) for j in columns if moved.get(j) in own}
    for n, k in enumerate(own):
        below = [i for i in own[n + 1 :] if (i, k) in result]
        right = [j for j in own[n + 1 :] if (k, j) in result]
        result |= {(i, j) for i in below for j in right}
    return result


def factorization_lines(w: str, g: str, h: str, spec: ModelLayout) -> list[str]:
    """Return lines that factorize the matrix; its entries are named w_v_x."""
    names = list(spec.states)
    own = [names[i] for i in spec.dynamic_states]
    moved = {state: rate for state, rate in spec.states.items() if rate in spec.states}
    nonzero, lines = nonzero_entries(spec), []

    for i in own:
        row = names.index(i)
        slopes = {j: spec.jacobian_entry(row, n) for n, j in enumerate(names) if (row, n) not in spec.zeros}
        lines += [f"{w}_{i}_{p} = {g} * {h} * {slopes[p]}" for p in moved if p in slopes]
        for j in [j for j in own if (i, j) in nonzero]:
            terms = [slopes[j]] if j in slopes else []
            terms += [f"{w}_{i}_{p}" for p, q in moved.items() if q == j and p in slopes]
            entry = f"({' + '.join(terms)})" if len(terms) > 1 else "".join(terms) or "0.0"
            lines.append(f"{w}_{i}_{j} = {'1.0 - ' if i == j else '-'}{g} * {h} * {entry}")
    for n, k in enumerate(own):
        below = [i for i in own[n + 1 :] if (i, k) in nonzero]
        right = [j for j in own[n + 1 :] if (k, j) in nonzero]
        tests = [f"fabs({w}_{k}_{k}) > {MIN_PIVOT_RATIO} * fabs({w}_{i}_{k})" for i in below]
        lines.append(f"{w}_{k} = {g} / {w}_{k}_{k} if {' and '.join([*tests, f'{w}_{k}_{k} != 0.0'])} else nan")
        for i in below:
            lines.append(f"{w}_{i}_{k} = {w}_{i}_{k} * {w}_{k} / {g}")
            lines += [f"{w}_{i}_{j} = {w}_{i}_{j} - {w}_{i}_{k} * {w}_{k}_{j}" for j in right]
        lines += [f"{w}_{k}_{j} = {w}_{k}_{j} / {g}" for j in right]
    return lines


def solution_lines(k: str, w: str, r: str, g: str, h: str, spec: ModelLayout) -> list[str]:
    """Return lines that solve for one right-hand side."""
    names = list(spec.states)
    own = [names[i] for i in spec.dynamic_states]
    moved = {state: rate for state, rate in spec.states.items() if rate in spec.states}
    nonzero, lines = nonzero_entries(spec), []
    for n, i in enumerate(own):
        b = f"{r}_{i}" + "".join(f" + {w}_{i}_{p} * {r}_{p}" for p in moved if (i, p) in nonzero)
        b += "".join(f" - {w}_{i}_{j} * {k}_{j}" for j in own[:n] if (i, j) in nonzero)
        lines.append(f"{k}_{i} = {b}" if n < len(own) - 1 else f"{k}_{i} = ({b}) * {w}_{i}")
    for n, i in list(enumerate(own))[-2::-1]:
        terms = "".join(f" - {w}_{i}_{j} * {k}_{j}" for j in own[n + 1 :] if (i, j) in nonzero)
        lines.append(f"{k}_{i} = ({k}_{i}{terms}) * {w}_{i}")
    return lines + [f"{k}_{p} = {g} * ({r}_{p} + {h} * {k}_{q})" for p, q in moved.items()]
