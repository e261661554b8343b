"""Runs the linear solver of the stiff methods on names instead of numbers: the result are statements of an FMU."""

import ast
from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Any

from ...runtime import linear_solver
from .layout import STATES, ModelLayout

# of the names of solutions, by the order of the axes
DECLARED_SUFFIX, EXCHANGED_SUFFIX = "_declared", "_exchanged"


class Symbol:
    """An expression in the source; operations build larger ones."""

    def __init__(self, node: ast.expr) -> None:
        self.node = node

    @classmethod
    def from_name(cls, name: str) -> "Symbol":
        """Return the symbol of a name."""
        return cls(ast.Name(name, ast.Load()))

    def __add__(self, other: Any) -> "Symbol":
        return Symbol(ast.BinOp(self.node, ast.Add(), node_of(other)))

    def __sub__(self, other: Any) -> "Symbol":
        return Symbol(ast.BinOp(self.node, ast.Sub(), node_of(other)))

    def __rsub__(self, other: float) -> "Symbol":
        return Symbol(ast.BinOp(node_of(other), ast.Sub(), self.node))

    def __mul__(self, other: Any) -> "Symbol":
        return Symbol(ast.BinOp(self.node, ast.Mult(), node_of(other)))

    def __rmul__(self, other: float) -> "Symbol":
        return Symbol(ast.BinOp(node_of(other), ast.Mult(), self.node))

    def __truediv__(self, other: Any) -> "Symbol":
        return Symbol(ast.BinOp(self.node, ast.Div(), node_of(other)))

    def __rtruediv__(self, other: float) -> "Symbol":
        return Symbol(ast.BinOp(node_of(other), ast.Div(), self.node))

    def __neg__(self) -> "Symbol":
        return Symbol(ast.UnaryOp(ast.USub(), self.node))

    def __abs__(self) -> "Symbol":
        return Symbol(ast.Call(ast.Name("fabs", ast.Load()), [self.node], []))

    def __ge__(self, other: Any) -> "Symbol":
        return Symbol(ast.Compare(self.node, [ast.GtE()], [node_of(other)]))

    def __ne__(self, other: Any) -> "Symbol":  # type: ignore[override] # an expression, not its value
        return Symbol(ast.Compare(self.node, [ast.NotEq()], [node_of(other)]))


def node_of(value: Any) -> ast.expr:
    """Return the syntax tree of a symbol or a number."""
    return value.node if isinstance(value, Symbol) else ast.Constant(value)


class NamedEntries(linear_solver.Entries):
    """Vector or matrix whose entries have names in the source; the parts of complex ones have two names.

    `names` are functions that return the name of an entry, or of its parts.
    """

    def __init__(self, *names: Callable[[Any], str]) -> None:
        super().__init__()
        self.names = names
        self.statements: list[ast.stmt] = []

    def __setitem__(self, key: Any, value: Any) -> None:
        names = [name(key) for name in self.names]
        parts = [value.re, value.im] if len(names) == 2 else [value]
        symbols = self.assign(names, parts)
        super().__setitem__(key, linear_solver.Complex(*symbols) if len(names) == 2 else symbols[0])

    def store(self, name: str, value: Any) -> Symbol:
        """Assign an intermediate result to a name."""
        return self.assign([self.names[0](name)], [value])[0]

    def assign(self, names: list[str], values: list[Any]) -> list[Symbol]:
        """Assign expressions to names; return these, to which later expressions refer."""
        targets: list[ast.expr] = [ast.Name(name, ast.Store()) for name in names]
        right = tuple_or_single(list(map(node_of, values)))
        self.statements.append(ast.Assign([tuple_or_single(targets)], right))
        return list(map(Symbol.from_name, names))

    def quotient_if(self, tests: list[Any], a: Any, b: Any) -> Symbol:
        """Return the conditional expression of a / b."""
        conditions = list(map(node_of, tests))
        test = ast.BoolOp(ast.And(), conditions) if len(conditions) > 1 else conditions[0]
        return Symbol(ast.IfExp(test, node_of(a / b), ast.Name("nan", ast.Load())))


def tuple_or_single(terms: list[ast.expr]) -> ast.expr:
    """Return a tuple, or the only element."""
    return ast.Tuple(terms, ast.Load()) if len(terms) != 1 else terms[0]


class LoweredSystem:
    """The linear system `name` of a model, complex if the shift is: its factorization and solutions, as statements.

    Rounding errors of an elimination depend on the order of the unknowns. With contacts in a plane, the solution is the
    mean of those for both orders of their velocities, so that a quarter turn of the plane changes no bit.
    """

    def __init__(self, name: str, spec: ModelLayout, arguments: Sequence[ast.expr], is_complex: bool) -> None:
        self.spec, self.is_complex = spec, is_complex
        first, second, self.jacobian = arguments
        self.arguments = Symbol(first), Symbol(second)  # g and h, or the parts of the shift
        self.orders = [Elimination(name, self, list(range(len(spec.states))))]
        if spec.axes:
            self.orders.append(Elimination(f"{name}{EXCHANGED_SUFFIX}", self, spec.states_with_exchanged_axes))

    def factorize(self) -> list[ast.stmt]:
        """Return the statements that factorize the matrix."""
        return [statement for order in self.orders for statement in order.factorize()]

    def component(self, vector: str, place: int) -> str:
        """Return the name of a component of a vector."""
        return self.spec.component_name(vector, STATES, place)

    def solve(self, results: Sequence[str], right: Sequence[str], known_zeros: Collection[str] = ()) -> list[ast.stmt]:
        """Return the statements that solve for a right-hand side; both are vectors, or the parts of a complex one.

        `known_zeros` are names of components that are always zero.
        """
        nonzero_states = [i for i in range(len(self.spec.states)) if self.component(right[0], i) not in known_zeros]
        r = {i: [Symbol.from_name(self.component(vector, i)) for vector in right] for i in nonzero_states}
        if len(self.orders) == 1:
            return self.orders[0].solve(results, r)
        vectors = [[f"{name}{suffix}" for name in results] for suffix in (DECLARED_SUFFIX, EXCHANGED_SUFFIX)]
        statements = [
            statement for order, names in zip(self.orders, vectors, strict=True) for statement in order.solve(names, r)
        ]
        places = self.spec.dynamic_states if self.is_complex else range(len(self.spec.states))
        means = NamedEntries(lambda place: self.component(*place))
        for vector, first, second in zip(results, *vectors, strict=True):
            for i in places:
                means[vector, i] = 0.5 * (
                    Symbol.from_name(self.component(first, i)) + Symbol.from_name(self.component(second, i))
                )
        return statements + means.statements


class Elimination:
    """The elimination of a linear system in one order of the states."""

    def __init__(self, name: str, system: LoweredSystem, states: Sequence[int]) -> None:
        self.system, spec = system, system.spec
        self.dynamic_states = [i for i in states if i in spec.dynamic_states]
        self.kinematic_states = {i: spec.rate_place(i) for i in states if i in spec.kinematic_states}

        def entry(place: Any) -> str:
            return f"{name}_{place}" if isinstance(place, str) else spec.entry_name(name, *place)

        if system.is_complex:
            self.entries = NamedEntries(lambda place: f"{entry(place)}_re", lambda place: f"{entry(place)}_im")
        else:
            self.entries = NamedEntries(entry)

    def factorize(self) -> list[ast.stmt]:
        """Return the statements that factorize the matrix."""
        spec = self.system.spec
        places = [(i, j) for i in self.dynamic_states for j in range(len(spec.states))]
        name = ast.unparse(self.system.jacobian)
        J = {at: Symbol.from_name(spec.entry_name(name, *at)) for at in places if at not in spec.zeros}
        factorize = linear_solver.factorize_complex if self.system.is_complex else linear_solver.factorize
        first, second = self.system.arguments
        factorize(self.entries, first, second, J, self.dynamic_states, self.kinematic_states)
        return self.entries.statements

    def solve(self, results: Sequence[str], r: dict[int, list[Symbol]]) -> list[ast.stmt]:
        """Return the statements that solve for the parts of a right-hand side, by state."""
        k = NamedEntries(*(partial(self.system.component, vector) for vector in results))
        if self.system.is_complex:
            parts = {i: linear_solver.Complex(*r[i]) for i in self.dynamic_states}
            linear_solver.solve_complex(k, self.entries, parts, self.dynamic_states)
        else:
            numbers = {i: parts[0] for i, parts in r.items()}
            g, h = self.system.arguments
            linear_solver.solve(k, self.entries, g, h, numbers, self.dynamic_states, self.kinematic_states)
        return k.statements
