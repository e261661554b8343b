"""The linear systems of rodas and radau9, solved without pivoting, or refused; alike on lists and in scalars."""

import ast
from math import fabs, nan

import list_vectors
import numpy as np
import pytest

from fmus.compiler.lowering.elimination import LoweredSystem
from fmus.compiler.lowering.layout import ModelLayout

BODIES = {
    "one body": {"x": "v", "v": "a"},
    "two bodies": {"x": "v", "v": "a", "y": "w", "w": "b"},
    "three rates": {"u": "du", "v": "dv", "w": "dw"},
}


def generate(spec, arguments, results, right):
    """Return the code that factorizes a system and solves it for one right-hand side."""
    is_complex = len(results) == 2
    system = LoweredSystem("s", spec, [ast.Name(name) for name in (*arguments, "J")], is_complex)
    module = ast.Module([*system.factorize(), *system.solve(results, right)], [])
    return compile(ast.unparse(ast.fix_missing_locations(module)), "system", "exec")


def generate_real(spec):
    """Return the code that solves a real system."""
    return generate(spec, "gh", "k", "r")


def in_scalars(spec, code, g, h, J, r):
    """Return the result of the lowered code for a system."""
    names = list(spec.states)
    namespace = {"g": g, "h": h, "nan": nan, "fabs": fabs} | {
        f"r_{name}": value for name, value in zip(names, r, strict=True)
    }
    namespace |= {spec.entry_name("J", i, n): J[i, n] for i in spec.dynamic_states for n in range(len(names))}
    exec(code, namespace)
    return [namespace[f"k_{name}"] for name in names]


def set_layout(spec):
    """Fill the indices of the states."""
    names, rates = list(spec.states), list(spec.states.values())
    list_vectors.state_indices[:] = range(len(names))
    list_vectors.is_dynamic[:] = [i in spec.dynamic_states for i in range(len(names))]
    list_vectors.rate_index[:] = [-1 if i in spec.dynamic_states else names.index(rate) for i, rate in enumerate(rates)]


def entries(spec, J):
    """Return the entries of the computed rates by row and column."""
    return {(i, j): J[i, j] for i in spec.dynamic_states for j in range(len(spec.states))}


def on_lists(spec, g, h, J, r):
    set_layout(spec)
    return np.array(list_vectors.solve_factored(list_vectors.factorize(g, h, entries(spec, J)), r))


@pytest.mark.parametrize("bodies", BODIES)
def test_a_system_is_solved_or_refused_but_never_half_solved(bodies):
    """Also if a pivot nearly vanishes, as for a motion that grows within one step; the residual is small relative to
    the terms."""
    spec, draw, n_refused = ModelLayout(BODIES[bodies], {}), np.random.default_rng(4), 0
    n, g, code = len(spec.states), 0.25, generate_real(spec)
    M = np.eye(n)
    for turn in range(600):
        h = 10.0 ** draw.uniform(-4.0, 1.0)
        J = draw.normal(0.0, 1.0, (n, n)) * 10.0 ** draw.uniform(-3.0, 5.0, (n, 1))
        first = spec.dynamic_states[0]
        if turn % 3:  # the first pivot is rounding error, or little more
            kinematic = [i for i in range(n) if i not in spec.dynamic_states]
            J[first, first] = 1.0 / (g * h) * (1.0 - 10.0 ** draw.uniform(-17.0, -3.0))
            J[first, kinematic] = 0.0
        for i in range(n):
            if i not in spec.dynamic_states:
                J[i] = M[list(spec.states).index(list(spec.states.values())[i])]
        r = draw.normal(0.0, 1.0, n)
        k = np.array(in_scalars(spec, code, g, h, J, r))
        assert np.array_equal(k, on_lists(spec, g, h, J, r), equal_nan=True)
        if not np.isfinite(k).all():
            n_refused += 1
            continue
        terms = np.abs(k) + np.abs(g * h * J) @ np.abs(k) + np.abs(g * r)
        assert np.all(np.abs(k - g * h * (J @ k) - g * r) <= 1e-8 * terms.max())
    assert 0 < n_refused < 480


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4), (2, 0, 4, 1, 3)], ids=["in a row", "shuffled, which fills zeros"])
def test_entries_that_are_always_zero_are_left_out_and_change_no_number(order):
    """Five bodies in a chain, each joined to its neighbours by springs and dampers, eliminated in some order."""
    states = {name: rate for i in order for name, rate in ((f"x{i}", f"v{i}"), (f"v{i}", f"a{i}"))}
    dense, names, draw = ModelLayout(states, {}), list(states), np.random.default_rng(5)
    is_joined = np.array([[abs(int(name[1]) - int(other[1])) < 2 for other in names] for name in names])
    spec = ModelLayout(
        states, {}, zeros=frozenset(zip(*(indices.tolist() for indices in np.nonzero(~is_joined)), strict=True))
    )
    sparse_code, dense_code = generate_real(spec), generate_real(dense)
    assert len(sparse_code.co_code) < 0.7 * len(dense_code.co_code)
    for _ in range(100):
        h, r = 10.0 ** draw.uniform(-4.0, 1.0), draw.normal(0.0, 1.0, len(names))
        J = np.where(is_joined, draw.normal(0.0, 1.0, is_joined.shape), 0.0)
        k = in_scalars(spec, sparse_code, 0.25, h, J, r)
        assert np.isfinite(k).all()
        assert k == in_scalars(dense, dense_code, 0.25, h, J, r)
        assert np.array_equal(k, on_lists(spec, 0.25, h, J, r))


@pytest.mark.parametrize("is_undamped", [False, True])
@pytest.mark.parametrize("bodies", BODIES)
def test_a_complex_system_is_solved_alike_on_lists_and_in_scalars(bodies, is_undamped):
    """The right-hand side is zero for states whose rate is a state; numpy solves the whole system."""
    spec, draw = ModelLayout(BODIES[bodies], {}), np.random.default_rng(6)
    if is_undamped:  # no rate depends on its own state
        spec = ModelLayout(BODIES[bodies], {}, zeros=frozenset((i, i) for i in spec.dynamic_states))
    names, rates, n = list(spec.states), list(spec.states.values()), len(spec.states)
    dynamic = spec.dynamic_states
    code = generate(spec, ["re", "im"], ["k", "m"], ["r", "q"])
    for _ in range(300):
        h, J = 10.0 ** draw.uniform(-4.0, 0.0), draw.normal(0.0, 1.0, (n, n)) * 10.0 ** draw.uniform(-3.0, 3.0, (n, 1))
        for i in set(range(n)) - {*dynamic}:
            J[i] = np.eye(n)[names.index(rates[i])]
        for entry in spec.zeros:
            J[entry] = 0.0
        re, im, r, q = 3.7 / h, -6.5 / h, np.zeros(n), np.zeros(n)
        r[dynamic], q[dynamic] = draw.normal(size=len(dynamic)), draw.normal(size=len(dynamic))
        namespace = {"re": re, "im": im, "nan": nan}
        namespace |= {f"{a}_{name}": b[i] for a, b in (("r", r), ("q", q)) for i, name in enumerate(names)}
        namespace |= {spec.entry_name("J", i, j): J[i, j] for i in dynamic for j in range(n)}
        exec(code, namespace)
        scalars = np.array([complex(namespace[f"k_{names[i]}"], namespace[f"m_{names[i]}"]) for i in dynamic])
        set_layout(spec)
        w = list_vectors.factorize_complex(re, im, entries(spec, J))
        k, m = map(np.array, list_vectors.solve_complex(w, r, q))
        assert np.array_equal(scalars, k[dynamic] + 1j * m[dynamic])
        truth = np.linalg.solve(complex(re, im) * np.eye(n) - J, r + 1j * q)[dynamic]
        assert np.abs(scalars - truth).max() <= 1e-7 * np.abs(truth).max()


def test_a_complex_system_with_a_vanishing_pivot_is_refused():
    spec, J = ModelLayout(BODIES["three rates"], {}), np.zeros((3, 3))
    J[0, 0], J[1, 0] = 2.0, 1.0
    set_layout(spec)
    w = list_vectors.factorize_complex(2.0, 0.0, entries(spec, J))
    k, _ = list_vectors.solve_complex(w, np.ones(3), np.zeros(3))
    assert np.isnan(k).any()
