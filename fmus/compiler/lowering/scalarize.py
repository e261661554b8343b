"""Rewrites expressions and simple statements of one function from vectors to scalars."""

import ast
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import reduce

from ..syntax_trees import TranslationError, TreeTransformer, all_nodes, is_same_tree, replace_fields
from .constant_folding import ConstantFolder
from .elimination import LoweredSystem, tuple_or_single
from .layout import CONDITIONS, STATES, ModelLayout
from .vector_symbols import SELECTIONS, SourceSymbols, annotated_kind

REDUCTIONS: dict[str, ast.cmpop] = {"max_of": ast.Gt(), "min_of": ast.Lt()}  # reductions to one component
ALLOCATORS = ("state_vector", "contact_vector")
LOOP_RANGES = ("state_indices", "velocity_indices", "contact_indices", "planar_indices")  # iterables of loops
SIMPLE = (ast.Name, ast.Attribute, ast.Constant)  # arguments that an inlined function may use twice
METHOD_LOOP = "methods"  # iterable of (label, module, class)
INDEX_LOOKUPS = {"slip_index": "slip", "position_index": "place", "is_planar": "is_planar"}


class Substitution(TreeTransformer):
    """Replaces names by expressions."""

    def __init__(self, expressions: Mapping[str, ast.expr]) -> None:
        self.expressions = expressions

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self.expressions.get(node.id, node)


class Scalarizer(ConstantFolder):
    """Tracks the names of a function and rewrites its expressions component by component."""

    def __init__(
        self, spec: ModelLayout, symbols: SourceSymbols, path: str, vectors: bool, index: dict[str, int] | None = None
    ) -> None:
        super().__init__(spec, symbols.constants)
        self.symbols, self.path, self.has_vectors = symbols, path, vectors
        self.vector_kinds: dict[str, str] = {}  # vector names -> what they run over
        self.function: ast.FunctionDef  # that is rewritten
        self.copies: dict[str, ast.expr] = {}  # components that are never stored -> the number that they equal
        self.allocated_names: set[str] = set()  # of vectors that are filled by component
        self.loop_indices = dict(index or {})  # loop variables -> current value
        self.scalar_names: set[str] = set()  # names of scalars
        self.known_zeros: set[str] = set()
        self.systems: dict[str, LoweredSystem] = {}
        self.jacobians: set[str] = set()  # names of Jacobians
        self.method_bindings: dict[str, ast.expr] = {}  # in a loop over methods: loop variable -> value

    def error(self, node: ast.AST) -> TranslationError:
        """Return the error for a node of this file."""
        return TranslationError(f"{self.path}:{getattr(node, 'lineno', '?')}", node)

    # ---- vectors and their components

    def vector_kind(self, node: ast.AST) -> str | None:
        """Return what an expression runs over; None for a scalar."""
        if not self.has_vectors:
            return None
        match node:
            case ast.Name(id=name):
                return self.vector_kinds.get(name)
            case ast.Attribute(attr=name):
                return self.symbols.vector_attributes.get(name)
            case ast.Subscript(slice=ast.Slice(lower=None, upper=None)):
                return CONDITIONS
            case ast.Call():
                kinds = self.result_kinds(node)
                return kinds[0] if len(kinds) == 1 else None
            case ast.BinOp(left=left, right=right) | ast.Compare(left=left, comparators=[right]):
                result = {self.vector_kind(left), self.vector_kind(right)} - {None}
                if len(result) > 1:
                    raise self.error(node)
                return result.pop() if result else None
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self.vector_kind(operand)
            case ast.IfExp(test=test) | ast.BoolOp(values=[test, *_]):
                return self.vector_kind(test)
        return None

    def is_elementwise(self, node: ast.AST) -> bool:
        """Return whether a call works on vectors component by component."""
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
            return False
        name, symbols = node.func.id, self.symbols
        return name in symbols.elementwise or name in symbols.inlined_functions or name in SELECTIONS

    def result_kinds(self, call: ast.Call) -> list[str | None]:
        """Return the kinds of the results of a call."""
        if self.is_elementwise(call):
            return [next(filter(None, map(self.vector_kind, call.args)), None)]
        return self.symbols.result_kinds.get(function_name(call), [None])

    def all_indices(self, kind: str) -> range:
        """Return the indices of all components."""
        return range(self.spec.size(kind))

    def component(self, node: ast.expr, place: int) -> ast.expr:
        """Return one component of a vector expression; scalars are rewritten as they are."""
        kind = self.vector_kind(node)
        if kind is None:
            return self.visit(node)
        match node:
            case ast.Subscript(value=vector):
                return ast.Subscript(self.visit(vector), ast.Constant(place), ast.Load())
            case ast.Name(id=vector):
                name = self.spec.component_name(vector, kind, place)
                return ast.Constant(0.0) if name in self.known_zeros else self.copies.get(name) or ast.Name(name)
            case ast.Attribute(value=owner, attr=vector):
                return ast.Attribute(self.visit(owner), self.spec.component_name(vector, kind, place), ast.Load())
            case ast.BinOp(left=left, op=op, right=right):
                return fold_zero(self.component(left, place), op, self.component(right, place))
            case ast.UnaryOp(op=op, operand=operand):
                return ast.UnaryOp(op, self.component(operand, place))
            case ast.Compare(left=left, ops=ops, comparators=[right]):
                return ast.Compare(self.component(left, place), ops, [self.component(right, place)])
            case ast.Call(func=ast.Name(id=name), args=args) if name in self.symbols.inlined_functions:
                parameters, expression = self.symbols.inlined_functions[name]
                arguments = dict(zip(parameters, args, strict=True))
                uses = Counter(part.id for part in all_nodes(expression) if isinstance(part, ast.Name))
                if any(uses[name] > 1 and not isinstance(part, SIMPLE) for name, part in arguments.items()):
                    raise self.error(node)  # it would be calculated again
                return self.component(Substitution(arguments).visit(expression), place)
            case ast.IfExp(test=test, body=body, orelse=other):
                return ast.IfExp(*(self.component(part, place) for part in (test, body, other)))
            case ast.BoolOp(op=operator, values=values):
                return ast.BoolOp(operator, [self.component(value, place) for value in values])
            case ast.Call(func=ast.Name(id="select_angles"), args=[angle, other]):
                return self.component(angle if place in self.spec.angle_states else other, place)
            case ast.Call(func=ast.Name(id="select_kinematic"), args=[moved, other]):
                return self.component(other if place in self.spec.dynamic_states else moved, place)
            case ast.Call(func=ast.Name(id="kinematic_rates"), args=[argument]):
                return self.component(argument, self.spec.rate_place(place))
            case ast.Call(func=function, args=args) if self.is_elementwise(node):
                return ast.Call(function, [self.component(argument, place) for argument in args], [])
            case _:
                raise self.error(node)

    def components(self, node: ast.expr) -> list[ast.expr]:
        """Return the components of a vector, or a scalar."""
        kind = self.vector_kind(node)
        return [self.component(node, i) for i in self.all_indices(kind)] if kind else [self.visit(node)]

    # ---- scalars

    def bind_method(self, target: ast.expr, label: str) -> None:
        """Bind the loop variables label, module and class to one method."""
        parts = ast.Constant(label), ast.Name(label), ast.Attribute(ast.Name(label), self.spec.methods[label])
        assert isinstance(target, ast.Tuple)
        self.method_bindings = {getattr(name, "id", ""): part for name, part in zip(target.elts, parts, strict=True)}

    def visit_for_method(self, item: ast.expr, target: ast.expr, label: str) -> ast.expr:
        self.bind_method(target, label)
        result = self.visit(item)
        self.method_bindings = {}
        return result

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self.method_bindings:
            return self.method_bindings[node.id]
        if self.vector_kinds.get(node.id):
            raise self.error(node)
        return ast.Constant(self.loop_indices[node.id]) if node.id in self.loop_indices else node

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        match node:
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Name(id=i)) if name in INDEX_LOOKUPS:
                return ast.Constant(getattr(self.spec, INDEX_LOOKUPS[name])(self.loop_indices[i]))
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Tuple(elts=[row, column])) if name in self.jacobians:
                entry = self.constant_index(row), self.constant_index(column)
                if entry in self.spec.zeros:
                    return ast.Constant(0.0)
                return ast.Name(self.spec.entry_name(name, *entry), ast.Load())
        return (
            self.component(node.value, self.constant_index(node.slice))
            if self.vector_kind(node.value)
            else self.generic_visit(node)
        )

    def constant_index(self, index: ast.expr) -> int:
        """Evaluate an index that must be known at build time."""
        result = self.visit(index)
        if not (isinstance(result, ast.Constant) and isinstance(result.value, int)):
            raise self.error(index)
        return result.value

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        node = self.generic_visit(node)
        match node:
            case ast.BinOp(left=ast.Constant(value=int(a)), op=ast.Add(), right=ast.Constant(value=int(b))):
                return ast.Constant(a + b)
        return node

    def visit_List(self, node: ast.List) -> ast.List:
        return ast.List(self.expand_stars(node.elts), node.ctx)

    def visit_Tuple(self, node: ast.Tuple) -> ast.Tuple:
        return ast.Tuple(self.expand_stars(node.elts), node.ctx)

    def expand_stars(self, parts: list[ast.expr]) -> list[ast.expr]:
        """Rewrite the elements of a row; *y expands to all components of y."""
        result: list[ast.expr] = []
        for part in parts:
            is_vector = isinstance(part, ast.Starred) and self.vector_kind(part.value)
            result += self.components(part.value) if isinstance(part, ast.Starred) and is_vector else [self.visit(part)]
        return result

    def visit_Call(self, node: ast.Call) -> ast.AST:
        match node:
            case ast.Call(ast.Name(id="getattr"), [thing, ast.Name(id=name)]) if name in self.method_bindings:
                return ast.Attribute(self.visit(thing), ast.literal_eval(self.method_bindings[name]), ast.Load())
            case ast.Call(func=ast.Name(id="tuple"), args=[ast.GeneratorExp(elt=item, generators=[each])]):
                if isinstance(each.iter, ast.Name) and each.iter.id == METHOD_LOOP:
                    return ast.Tuple([self.visit_for_method(item, each.target, label) for label in self.spec.methods])
            case ast.Call(func=ast.Name(id=name), args=args) if name in self.symbols.inlined_functions:
                return self.inlined_test(name, args)
            case ast.Call(func=ast.Name(id="len"), args=[argument]) if kind := self.vector_kind(argument):
                return ast.Constant(self.spec.size(kind))
            case ast.Call(func=ast.Name(id="sum_of"), args=args):
                return sum_of_terms([term for argument in args for term in self.components(argument)])
            case ast.Call(func=ast.Name(id="all_of" | "any_of" as name), args=[argument]):
                tests = self.components(argument)
                return ConstantFolder.visit_BoolOp(self, ast.BoolOp(ast.And() if name == "all_of" else ast.Or(), tests))
            case ast.Call(func=ast.Name(id=name), args=[ast.Name() as argument]) if name in REDUCTIONS:
                *terms, result = self.components(argument) or [ast.Name("inf")]
                others = [result]
                for term in reversed(terms):
                    comparisons: list[ast.expr] = [ast.Compare(term, [REDUCTIONS[name]], [other]) for other in others]
                    test = ast.BoolOp(ast.And(), comparisons) if len(comparisons) > 1 else comparisons[0]
                    result = ast.IfExp(test, term, result)
                    others.insert(0, term)
                return result
        function = node.func
        contacts = [
            argument.id for argument in node.args if isinstance(argument, ast.Name) and argument.id in self.loop_indices
        ]
        if contacts:
            tail = self.spec.contact_suffix(self.loop_indices[contacts[0]])
            if isinstance(function, ast.Attribute):
                function = replace_fields(function, attr=function.attr + tail)
            elif isinstance(function, ast.Name):
                function = replace_fields(function, id=function.id + tail)
        vector_arguments = [
            argument
            for argument in node.args
            if not (isinstance(argument, ast.Name) and argument.id in self.loop_indices)
        ]
        args = [term for argument in vector_arguments for term in self.components(argument)]
        return replace_fields(
            node, func=self.visit(function), args=args, keywords=[self.visit(keyword) for keyword in node.keywords]
        )

    def inlined_test(self, name: str, args: list[ast.expr]) -> ast.AST:
        """Return the expression of a function of scalars, with the constants of its file as numbers."""
        parameters, expression = self.symbols.inlined_functions[name]
        names = {node.id for node in all_nodes(expression) if isinstance(node, ast.Name)} - {*parameters}
        numbers = {
            constant: ast.Constant(value)
            for constant in names
            if (value := self.symbols.constants.get(constant)) is not None
        }
        test = self.visit(Substitution(dict(zip(parameters, args, strict=True))).visit(expression))
        return Substitution(numbers).visit(test)

    # ---- simple statements

    def lower_statement(self, node: ast.stmt) -> list[ast.stmt]:
        """Rewrite a simple statement."""
        match node:
            case ast.AnnAssign() if annotated_kind(node):
                return []
            case ast.AugAssign(target=target) if self.vector_kind(target):
                raise self.error(node)
            case ast.Expr(ast.Call(ast.Name(id="setattr"), [thing, ast.Name(id=name), value])) if (
                name in self.method_bindings
            ):
                place = ast.Attribute(self.visit(thing), ast.literal_eval(self.method_bindings[name]), ast.Store())
                return [ast.Assign([place], self.visit(value))]
            case ast.Return(value=ast.Call() as call) if function_name(call) in self.symbols.rates:
                raise self.error(call)  # a name is needed: see lower_rates
            case ast.Return(value=ast.Tuple(elts=parts)):
                return [ast.Return(tuple_or_single([term for part in parts for term in self.components(part)]))]
            case ast.Return(value=value) if value and self.vector_kind(value):
                if self.is_elementwise(value) or not isinstance(value, ast.Call):
                    return [ast.Return(tuple_or_single(self.components(value)))]
            case ast.Assign(
                targets=[ast.Tuple(elts=[ast.Name(id=f_t), ast.Name(id=J)])],
                value=ast.Call(func=ast.Attribute(attr=name)) as call,
            ) if name in self.symbols.jacobians:
                return self.lower_jacobian(f_t, J, call)
            case ast.Assign(targets=[target], value=ast.Call(func=ast.Attribute(attr=name)) as call) if (
                name in self.symbols.rates
            ):
                return self.lower_rates(target, call)
            case ast.Assign(
                targets=[ast.Name(id=s)],
                value=ast.Call(func=ast.Name(id="factorize" | "factorize_complex" as name), args=arguments),
            ):
                self.systems[s] = LoweredSystem(s, self.spec, arguments, name == "factorize_complex")
                return self.systems[s].factorize()
            case ast.Assign(
                targets=[ast.Name() as target],
                value=ast.Call(func=ast.Name(id="multiply"), args=[ast.Name(id=J), vector]),
            ) if J in self.jacobians:
                return self.lower_product(target, J, vector)
            case ast.Assign(
                targets=[target],
                value=ast.Call(func=ast.Name(id="solve_factored" | "solve_complex"), args=[ast.Name(id=s), *right]),
            ):
                results = target.elts if isinstance(target, ast.Tuple) else [target]
                self.record_kinds(results, [STATES] * len(results))
                vectors, others = list(map(ast.unparse, results)), list(map(ast.unparse, right))
                statements = self.systems[s].solve(vectors, others, self.known_zeros)
                if self.systems[s].is_complex:  # only these states have a solution
                    kinematic_states = self.spec.kinematic_states
                    self.known_zeros |= {
                        self.spec.component_name(name, STATES, i) for name in vectors for i in kinematic_states
                    }
                return statements
            case ast.Assign():
                return self.lower_assignment(node)
        return [self.visit(node)]

    def record_kinds(self, targets: Sequence[ast.expr], kinds: Sequence[str | None] = ()) -> None:
        """Record the kinds of assigned names; scalars by default."""
        for target_node, kind in zip(targets, kinds or [None] * len(targets), strict=True):
            if isinstance(target_node, ast.Attribute) and kind and not self.vector_kind(target_node):
                raise self.error(target_node)
            if not isinstance(target_node, ast.Name):
                continue
            if kind is None:
                if target_node.id in self.vector_kinds:
                    raise self.error(target_node)
                self.scalar_names.add(target_node.id)
                continue
            if self.vector_kinds.setdefault(target_node.id, kind) != kind:
                raise self.error(target_node)

    def lower_assignment(self, node: ast.Assign) -> list[ast.stmt]:
        """Rewrite an assignment by component; as one tuple assignment where components depend on each other."""
        value, target = node.value, node.targets[0]
        if len(node.targets) > 1:  # self.c1 = self.c2 = 0.0
            terms = [term for target in node.targets for term in self.components(target)]
            return [ast.Assign(terms, self.visit(value))] if terms else []
        left = target.elts if isinstance(target, ast.Tuple) else [target]
        right = value.elts if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) else [value]
        if len(left) == len(right) and all(
            isinstance(value, ast.Call) and function_name(value) in ALLOCATORS for value in right
        ):
            for target in left:
                if (
                    isinstance(target, ast.Name)
                    and target.id in self.vector_kinds
                    and target.id not in self.allocated_names
                ):
                    raise self.error(target)
                self.allocated_names.add(ast.unparse(target))
            self.record_kinds(left, [self.vector_kind(value) for value in right])
            return []
        if (
            isinstance(value, ast.Call)
            and not self.is_elementwise(value)
            and (len(left) > 1 or self.vector_kind(value))
        ):
            return self.lower_unpacking(left, value)
        if len(left) != len(right):
            return [self.visit(node)]
        kinds = [
            self.vector_kind(value) or (self.vector_kind(target) if not isinstance(target, ast.Name) else None)
            for target, value in zip(left, right, strict=True)
        ]
        self.record_kinds(left, kinds)
        if not any(kinds):
            return [self.visit(node)]
        pairs: list[tuple[ast.expr, ast.expr]] = []
        for target, value, kind in zip(left, right, kinds, strict=True):
            for i in self.all_indices(kind) if kind else [-1]:
                number = self.component(value, i) if kind else self.visit(value)
                if isinstance(target, ast.Name) and kind and is_zero(number):
                    self.known_zeros.add(self.spec.component_name(target.id, kind, i))
                else:
                    pairs.append((self.component(target, i) if kind else self.visit(target), number))
        pairs = [(target, number) for target, number in pairs if not is_same_tree(target, number)]
        changed_names: set[str] = set()
        for target, number in pairs:
            if changed_names and changed_names & names_used(number):
                return [
                    ast.Assign(
                        [tuple_or_single([target for target, _ in pairs])],
                        tuple_or_single([number for _, number in pairs]),
                    )
                ]
            changed_names.add(dotted_name(target))
        return [ast.Assign([target], number) for target, number in pairs]

    def lower_unpacking(self, targets: list[ast.expr], value: ast.Call) -> list[ast.stmt]:
        """Rewrite the unpacking of a function result."""
        kinds = self.result_kinds(value)
        if len(kinds) != len(targets):
            kinds = [None] * len(targets)  # scalars
        self.record_kinds(targets, kinds)
        terms = [term for target in targets for term in self.components(target)]
        return [ast.Assign([tuple_or_single(terms)], self.visit(value))] if terms else [ast.Expr(self.visit(value))]

    def lower_rates(self, f: ast.expr, call: ast.Call) -> list[ast.stmt]:
        """Rewrite f = model.rates(t, y, modes), which returns the rates that are no states; copy the others from y.

        A copy that no statement changes is not stored: y is read instead.
        """
        y = next(argument for argument in call.args if self.vector_kind(argument) == STATES)
        is_new = isinstance(f, ast.Name) and f.id not in self.vector_kinds
        is_fixed = is_new and {*names_used(f), *names_used(y)} <= names_with_one_value(self.function)
        self.record_kinds([f], [STATES])
        dynamic_rates = [self.component(f, i) for i in self.spec.dynamic_states]
        statements: list[ast.stmt] = [ast.Assign([tuple_or_single(dynamic_rates)], self.visit(call))]
        for i in self.spec.kinematic_states:
            target, rate = self.component(f, i), self.component(y, self.spec.rate_place(i))
            if is_fixed:
                self.copies[dotted_name(target)] = rate
            else:
                statements.append(ast.Assign([target], rate))
        return statements

    def lower_jacobian(self, f_t: str, J: str, call: ast.Call) -> list[ast.stmt]:
        """Rewrite f_t, J = model.jacobian(...): the derivatives of each dynamic rate, time first."""
        self.vector_kinds[f_t] = STATES
        self.jacobians.add(J)
        dynamic = self.spec.dynamic_states
        time_derivatives = {i: self.spec.component_name(f_t, STATES, i) for i in self.all_indices(STATES)}
        self.known_zeros |= {name for i, name in time_derivatives.items() if i not in dynamic}
        names = []
        for i in dynamic:
            entries = [(i, j) for j in self.all_indices(STATES)]
            names += [
                time_derivatives[i],
                *("_" if at in self.spec.zeros else self.spec.entry_name(J, *at) for at in entries),
            ]
        return [ast.Assign([tuple_or_single([ast.Name(name) for name in names])], self.visit(call))]

    def lower_product(self, target: ast.Name, J: str, vector: ast.expr) -> list[ast.stmt]:
        """Rewrite a = multiply(J, b): the sum over a row, or the rate of a state whose rate is a state."""
        self.record_kinds([target], [STATES])
        statements: list[ast.stmt] = []
        for i in self.all_indices(STATES):
            name = self.spec.component_name(target.id, STATES, i)
            if i in self.spec.kinematic_states:
                terms = [self.component(vector, self.spec.rate_place(i))]
            else:
                terms = [
                    fold_zero(ast.Name(self.spec.entry_name(J, i, j)), ast.Mult(), self.component(vector, j))
                    for j in self.all_indices(STATES)
                    if (i, j) not in self.spec.zeros
                ]
            terms = [term for term in terms if not is_zero(term)]
            if terms:
                statements.append(ast.Assign([ast.Name(name)], sum_of_terms(terms)))
            else:
                self.known_zeros.add(name)
        return statements

    def has_name_clash(self) -> bool:
        """Return whether a scalar has the name of a component in some model."""
        prefixes = tuple(f"{name}_" for name in (*self.vector_kinds, *self.jacobians, *self.systems))
        return any(name.startswith(prefixes) for name in self.scalar_names)


def names_with_one_value(function: ast.FunctionDef) -> set[str]:
    """Return the parameters that a function does not change, and the names that one statement of it sets."""
    names = [argument.arg for argument in function.args.args]
    for part in all_nodes(function):
        for target in part.targets if isinstance(part, ast.Assign) else ():
            names += [name.id for name in all_nodes(target) if isinstance(name, ast.Name)]
    return {name for name, count in Counter(names).items() if count == 1}


def function_name(call: ast.Call) -> str:
    """Return the unqualified name of a called function."""
    return getattr(call.func, "attr", getattr(call.func, "id", ""))


def sum_of_terms(terms: list[ast.expr]) -> ast.expr:
    """Return the sum of some terms, in order."""
    return reduce(lambda left, right: ast.BinOp(left, ast.Add(), right), terms)


def names_used(node: ast.AST) -> set[str]:
    """Return all names in a tree, dotted ones as a whole."""
    return {dotted_name(part) for part in all_nodes(node) if isinstance(part, (ast.Name, ast.Attribute))}


def dotted_name(node: ast.expr) -> str:
    """Return a name or dotted name as text."""
    if isinstance(node, ast.Attribute):
        return f"{dotted_name(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ast.unparse(node)


def is_zero(node: ast.expr) -> bool:
    """Return whether an expression is the number 0.0."""
    return isinstance(node, ast.Constant) and node.value == 0.0


def fold_zero(left: ast.expr, op: ast.operator, right: ast.expr) -> ast.expr:
    """Return left op right, simplified where an operand is zero."""
    zero = [is_zero(left), is_zero(right)]
    if isinstance(op, ast.Mult) and any(zero):
        return ast.Constant(0.0)
    return left if isinstance(op, (ast.Add, ast.Sub)) and zero[1] else ast.BinOp(left, op, right)
