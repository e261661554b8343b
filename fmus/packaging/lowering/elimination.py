"""Generates the linear solver of Rosenbrock methods, (1 - g h J) k = g r, as lines of source for the states of a model.

A state p whose rate is the state q has k_p = g (r_p + h k_q).  The remaining system is eliminated without pivoting.
A pivot that is zero, or small compared with the entries below it, gives NaN and rejects the step, because it would
amplify rounding errors.  A smaller h brings the matrix closer to 1.
"""

from .layout import ModelLayout

MIN_PIVOT_RATIO = 1e-6  # smallest ratio of a pivot to the entries below it; same value in vectors.py


def factorization_lines(w: str, g: str, h: str, spec: ModelLayout) -> list[str]:
    """Return lines that factorize the matrix; its entries are named w_v_x."""
    names = list(spec.states)
    own = [names[i] for i in spec.dynamic_states]
    moved = {state: rate for state, rate in spec.states.items() if rate in spec.states}
    lines = []

    def slope(i: str, j: str) -> str:
        return spec.jacobian_entry(names.index(i), names.index(j))

    for i in own:
        lines += [f"{w}_{i}_{p} = {g} * {h} * {slope(i, p)}" for p in moved]
        for j in own:
            terms = "".join(f" + {w}_{i}_{p}" for p, q in moved.items() if q == j)
            entry = f"({slope(i, j)}{terms})" if terms else slope(i, j)
            lines.append(f"{w}_{i}_{j} = {'1.0 - ' if i == j else '-'}{g} * {h} * {entry}")
    for n, k in enumerate(own):
        tests = [f"fabs({w}_{k}_{k}) > {MIN_PIVOT_RATIO} * fabs({w}_{i}_{k})" for i in own[n + 1 :]]
        lines.append(f"{w}_{k} = {g} / {w}_{k}_{k} if {' and '.join([*tests, f'{w}_{k}_{k} != 0.0'])} else nan")
        for i in own[n + 1 :]:
            lines.append(f"{w}_{i}_{k} = {w}_{i}_{k} * {w}_{k} / {g}")
            lines += [f"{w}_{i}_{j} = {w}_{i}_{j} - {w}_{i}_{k} * {w}_{k}_{j}" for j in own[n + 1 :]]
        lines += [f"{w}_{k}_{j} = {w}_{k}_{j} / {g}" for j in own[n + 1 :]]
    return lines


def solution_lines(k: str, w: str, r: str, g: str, h: str, spec: ModelLayout) -> list[str]:
    """Return lines that solve for one right-hand side."""
    names = list(spec.states)
    own = [names[i] for i in spec.dynamic_states]
    moved = {state: rate for state, rate in spec.states.items() if rate in spec.states}
    lines = []
    for n, i in enumerate(own):
        b = f"{r}_{i}" + "".join(f" + {w}_{i}_{p} * {r}_{p}" for p in moved)
        b += "".join(f" - {w}_{i}_{j} * {k}_{j}" for j in own[:n])
        lines.append(f"{k}_{i} = {b}" if n < len(own) - 1 else f"{k}_{i} = ({b}) * {w}_{i}")
    for n, i in list(enumerate(own))[-2::-1]:
        terms = "".join(f" - {w}_{i}_{j} * {k}_{j}" for j in own[n + 1 :])
        lines.append(f"{k}_{i} = ({k}_{i}{terms}) * {w}_{i}")
    return lines + [f"{k}_{p} = {g} * ({r}_{p} + {h} * {k}_{q})" for p, q in moved.items()]
