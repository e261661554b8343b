"""The expressions and simple statements of one function, in scalars."""

import ast
import re
from collections.abc import Sequence

from .. import BuildError
from ..trees import altered, same, walked
from .declarations import Declarations, annotated
from .elimination import factored, solved
from .settled import Settled
from .spec import STATES, STEM, Spec

EACH = {"magnitude": "{0} if {0} > 0.0 else -{0}", "elementwise_max": "{0} if {0} > {1} else {1}"}  # number by number
CHOSEN = {"max_of": ">", "min_of": "<"}  # one of the numbers
BLANK = ("state_vector", "contact_vector")
RANGES = ("state_indices", "velocity_indices", "contact_indices")  # what a loop may run over
METHODS = "methods"  # or (label, file, class) of every one
LOOKED_UP = {"slip_index": "slip", "position_index": "place"}


class Refused(BuildError):
    """Source that cannot be written out: the line, what is wrong and what to do instead."""


class Numbers(Settled):
    """What the names of a function stand for, and its expressions by number."""

    def __init__(
        self, spec: Spec, declared: Declarations, path: str, vectors: bool, index: dict[str, int] | None = None
    ) -> None:
        super().__init__(spec, declared.constants)
        self.declared, self.path, self.vectors = declared, path, vectors
        self.kinds: dict[str, str] = {}  # of names that are vectors
        self.index = dict(index or {})  # of names that count
        self.numbers: set[str] = set()  # names that are numbers
        self.spelled: dict[str, str] = {}  # name of a number of a vector -> the vector
        self.zeros: set[str] = set()
        self.systems: dict[str, tuple[str, str]] = {}
        self.slopes: set[str] = set()  # names that are a Jacobian
        self.named: dict[str, ast.expr] = {}  # of a loop over the methods: name -> what it stands for

    def refused(self, node: ast.AST, why: str) -> Refused:
        return Refused(f"{self.path}:{getattr(node, 'lineno', '?')}: '{ast.unparse(node)[:60]}' {why}.")

    # ---- vectors and their numbers

    def kind(self, node: ast.AST) -> str | None:
        """What an expression runs over; None for a number."""
        if not self.vectors:
            return None
        match node:
            case ast.Name(id=name):
                return self.kinds.get(name)
            case ast.Attribute(attr=name):
                return self.declared.attribute(name)
            case ast.Call():
                kinds = self.returned(node)
                return kinds[0] if len(kinds) == 1 else None
            case ast.BinOp(left=left, right=right) | ast.Compare(left=left, comparators=[right]):
                found = {self.kind(left), self.kind(right)} - {None}
                if len(found) > 1:
                    raise self.refused(node, "has a vector of states and one of contacts; loop over contact_indices")
                return found.pop() if found else None
            case ast.UnaryOp(op=ast.USub(), operand=one):
                return self.kind(one)
        return None

    def by_number(self, node: ast.AST) -> bool:
        """Whether a call works on vectors number by number."""
        names = {*EACH, *self.declared.each, "select_kinematic"}
        return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in names

    def returned(self, call: ast.Call) -> list[str | None]:
        """What a function returns."""
        if self.by_number(call):
            return [self.kind(call.args[0])]
        return self.declared.results.get(called(call), [None])

    def all_places(self, kind: str) -> range:
        return range(len(self.spec.parts(kind)))

    def places(self, node: ast.AST, kind: str) -> Sequence[int]:
        """The places whose numbers are a vector's own: not those rates of f2 that are found in y2."""
        name = getattr(node, "attr", getattr(node, "id", ""))
        beside = self.declared.stored if isinstance(node, ast.Attribute) else self.kinds
        borrows = kind == STATES and re.fullmatch(r"f\d*", name) and "y" + name[1:] in beside
        return self.spec.own if borrows else self.all_places(kind)

    def name(self, node: ast.AST, vector: str, kind: str, place: int) -> str:
        """The name of one number of a vector that is a local name."""
        name = self.spec.number(vector, kind, place)
        borrowed = vector[0] == "f" and name in self.spelled and self.spelled[name] == "y" + vector[1:]
        if not borrowed and self.spelled.setdefault(name, vector) != vector:
            raise self.refused(
                node, f"has numbers of the same name, {name}, as {self.spelled[name]}; take another name"
            )
        return name

    def part(self, node: ast.expr, place: int) -> ast.expr:
        """One number of a vector; a number as it is."""
        kind = self.kind(node)
        if kind is None:
            return self.visit(node)
        match node:
            case ast.Name(id=vector):
                name = self.name(node, vector, kind, place)
                return ast.Constant(0.0) if name in self.zeros else ast.Name(name, ast.Load())
            case ast.Attribute(value=owner, attr=vector):
                return ast.Attribute(self.visit(owner), self.spec.number(vector, kind, place), ast.Load())
            case ast.BinOp(left=left, op=op, right=right):
                return without_zero(self.part(left, place), op, self.part(right, place))
            case ast.UnaryOp(op=op, operand=one):
                return ast.UnaryOp(op, self.part(one, place))
            case ast.Compare(left=left, ops=ops, comparators=[right]):
                return ast.Compare(self.part(left, place), ops, [self.part(right, place)])
            case ast.Call(func=ast.Name(id="select_kinematic"), args=[moved, other]):
                return self.part(other if place in self.spec.own else moved, place)
            case ast.Call(func=ast.Name(id=name), args=args) if name in EACH:
                if not all(isinstance(one, (ast.Name, ast.Attribute)) for one in args):
                    raise self.refused(node, "would work something out twice; give what is in the brackets a name")
                return expression(EACH[name].format(*(ast.unparse(self.part(one, place)) for one in args)))
            case ast.Call(func=function, args=args) if self.by_number(node):
                return ast.Call(function, [self.part(one, place) for one in args], [])
            case _:
                raise self.refused(node, "is a vector inside a calculation; give it a name on a line of its own")

    def terms(self, node: ast.expr) -> list[ast.expr]:
        """All the numbers of an argument, a target or a result that are its own."""
        kind = self.kind(node)
        return [self.part(node, i) for i in self.places(node, kind)] if kind else [self.visit(node)]

    def all_terms(self, node: ast.expr) -> list[ast.expr]:
        """All the numbers of a vector, those that it borrows as well."""
        if not (kind := self.kind(node)):
            raise self.refused(node, "is a number where a vector is wanted")
        return [self.part(node, i) for i in self.all_places(kind)]

    # ---- what is a number

    def stands_for(self, target: ast.expr, label: str) -> None:
        """What the names of a loop over the methods, label, file and class, stand for at one of them."""
        parts = ast.Constant(label), ast.Name(label), expression(f"{label}.{self.spec.methods[label]}")
        assert isinstance(target, ast.Tuple)
        self.named = {getattr(name, "id", ""): part for name, part in zip(target.elts, parts, strict=True)}

    def at_method(self, item: ast.expr, target: ast.expr, label: str) -> ast.expr:
        self.stands_for(target, label)
        found = self.visit(item)
        self.named = {}
        return found

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self.named:
            return self.named[node.id]
        if self.kinds.get(node.id):
            raise self.refused(node, "is a vector where a number is wanted")
        return ast.Constant(self.index[node.id]) if node.id in self.index else node

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        match node:
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Name(id=i)) if name in LOOKED_UP:
                return ast.Constant(getattr(self.spec, LOOKED_UP[name])(self.index[i]))
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Tuple(elts=[row, column])) if name in self.slopes:
                return ast.Name(self.spec.slope(self.known(row), self.known(column)), ast.Load())
        return self.part(node.value, self.known(node.slice)) if self.kind(node.value) else self.generic_visit(node)

    def known(self, index: ast.expr) -> int:
        found = self.visit(index)
        if not (isinstance(found, ast.Constant) and isinstance(found.value, int)):
            raise self.refused(index, "is an index that is not known; loop over contact_indices or state_indices")
        return found.value

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        node = self.generic_visit(node)
        match node:
            case ast.BinOp(left=ast.Constant(value=int(a)), op=ast.Add(), right=ast.Constant(value=int(b))):
                return ast.Constant(a + b)
        return node

    def visit_List(self, node: ast.List) -> ast.List:
        return ast.List(self.spread(node.elts), node.ctx)

    def visit_Tuple(self, node: ast.Tuple) -> ast.Tuple:
        return ast.Tuple(self.spread(node.elts), node.ctx)

    def spread(self, parts: list[ast.expr]) -> list[ast.expr]:
        """The parts of a row; *y stands for all the numbers of y."""
        found: list[ast.expr] = []
        for one in parts:
            starred = isinstance(one, ast.Starred) and self.kind(one.value)
            found += self.all_terms(one.value) if isinstance(one, ast.Starred) and starred else [self.visit(one)]
        return found

    def visit_Call(self, node: ast.Call) -> ast.AST:
        match node:
            case ast.Call(ast.Name(id="getattr"), [thing, ast.Name(id=name)]) if name in self.named:
                return ast.Attribute(self.visit(thing), ast.literal_eval(self.named[name]), ast.Load())
            case ast.Call(func=ast.Name(id="tuple"), args=[ast.GeneratorExp(elt=item, generators=[each])]):
                if isinstance(each.iter, ast.Name) and each.iter.id == METHODS:
                    return ast.Tuple([self.at_method(item, each.target, label) for label in self.spec.methods])
            case ast.Call(func=ast.Name(id="len"), args=[one]) if kind := self.kind(one):
                return ast.Constant(len(self.spec.parts(kind)))
            case ast.Call(func=ast.Name(id="sum_of"), args=args):
                terms = [ast.unparse(term) for one in args for term in self.all_terms(one)]
                return expression(" + ".join(f"({term})" for term in terms))
            case ast.Call(func=ast.Name(id="all_of" | "any_of" as name), args=[one]):
                tests = self.all_terms(one)
                return Settled.visit_BoolOp(self, ast.BoolOp(ast.And() if name == "all_of" else ast.Or(), tests))
            case ast.Call(func=ast.Name(id=name), args=[ast.Name() as one]) if name in CHOSEN:
                *terms, text = [ast.unparse(term) for term in self.all_terms(one)] or ["inf"]
                behind = [text]
                for term in reversed(terms):
                    text = f"{term} if {' and '.join(f'{term} {CHOSEN[name]} {one}' for one in behind)} else {text}"
                    behind.insert(0, term)
                return expression(text)
        function = node.func
        contacts = [one.id for one in node.args if isinstance(one, ast.Name) and one.id in self.index]
        if contacts:
            tail = self.spec.tail(self.index[contacts[0]])
            if isinstance(function, ast.Attribute):
                function = altered(function, attr=function.attr + tail)
            elif isinstance(function, ast.Name):
                function = altered(function, id=function.id + tail)
        kept = [one for one in node.args if not (isinstance(one, ast.Name) and one.id in self.index)]
        args = [term for one in kept for term in self.terms(one)]
        return altered(node, func=self.visit(function), args=args, keywords=[self.visit(one) for one in node.keywords])

    # ---- simple statements

    def statements(self, node: ast.stmt) -> list[ast.stmt]:
        """What a simple statement becomes."""
        match node:
            case ast.AnnAssign() if annotated(node):
                return []
            case ast.AugAssign(target=target) if self.kind(target):
                raise self.refused(node, "writes into a vector, which another name may share; write c = c + ...")
            case ast.Expr(ast.Call(ast.Name(id="setattr"), [thing, ast.Name(id=name), value])) if name in self.named:
                place = ast.Attribute(self.visit(thing), ast.literal_eval(self.named[name]), ast.Store())
                return [ast.Assign([place], self.visit(value))]
            case ast.Return(value=ast.Tuple(elts=parts)):
                return [ast.Return(row([term for one in parts for term in self.terms(one)]))]
            case ast.Return(value=value) if value and self.kind(value):
                if self.by_number(value) or not isinstance(value, ast.Call):
                    return [ast.Return(row(self.terms(value)))]
            case ast.Assign(
                targets=[ast.Tuple(elts=[ast.Name(id=f_t), ast.Name(id=J)])],
                value=ast.Call(func=ast.Attribute(attr="jacobian")) as call,
            ):
                return self.jacobian(f_t, J, call)
            case ast.Assign(targets=[ast.Name(id=s)], value=ast.Call(func=ast.Name(id="factorize"), args=[g, h, _])):
                self.systems[s] = ast.unparse(g), ast.unparse(h)
                return ast.parse("\n".join(factored(s, *self.systems[s], self.spec))).body
            case ast.Assign(
                targets=[ast.Name(id=k) as to], value=ast.Call(func=ast.Name(id="solve_factored"), args=[s, r])
            ):
                self.learn([to], [STATES])
                system, right = ast.unparse(s), ast.unparse(r)
                return ast.parse("\n".join(solved(k, system, right, *self.systems[system], self.spec))).body
            case ast.Assign():
                return self.assign(node)
        return [self.visit(node)]

    def learn(self, targets: Sequence[ast.expr], kinds: Sequence[str | None] = ()) -> None:
        """What names stand for from here on; numbers, if nothing is said."""
        for one, kind in zip(targets, kinds or [None] * len(targets), strict=True):
            if not isinstance(one, ast.Name):
                continue
            if kind is None:
                if one.id in self.kinds:
                    raise self.refused(one, "is a vector elsewhere in the function; take another name")
                self.numbers.add(one.id)
                continue
            if kind == STATES and one.id[0] == "y" and "f" + one.id[1:] in self.kinds:
                raise self.refused(
                    one, f"changes under f{one.id[1:]}, some of whose rates are read from it; take another name"
                )
            if self.kinds.setdefault(one.id, kind) != kind:
                raise self.refused(one, "is another vector elsewhere in the function; take another name")

    def assign(self, node: ast.Assign) -> list[ast.stmt]:
        """An assignment number by number, one below the other, or side by side where one would disturb the next."""
        value, target = node.value, node.targets[0]
        if len(node.targets) > 1:  # self.c1 = self.c2 = 0.0
            terms = [term for one in node.targets for term in self.terms(one)]
            return [ast.Assign(terms, self.visit(value))] if terms else []
        left = target.elts if isinstance(target, ast.Tuple) else [target]
        right = value.elts if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) else [value]
        if len(left) == len(right) and all(isinstance(one, ast.Call) and called(one) in BLANK for one in right):
            self.learn(left, [self.kind(one) for one in right])
            return []
        if isinstance(value, ast.Call) and not self.by_number(value) and (len(left) > 1 or self.kind(value)):
            return self.unpack(node, left, value)
        if len(left) != len(right):
            return [self.visit(node)]
        kinds = [
            self.kind(one) or (self.kind(to) if not isinstance(to, ast.Name) else None)
            for to, one in zip(left, right, strict=True)
        ]
        self.learn(left, kinds)
        if not any(kinds):
            return [self.visit(node)]
        pairs: list[tuple[ast.expr, ast.expr]] = []
        for to, one, kind in zip(left, right, kinds, strict=True):
            for i in self.places(to, kind) if kind else [-1]:
                number = self.part(one, i) if kind else self.visit(one)
                if isinstance(to, ast.Name) and kind and isinstance(number, ast.Constant) and number.value == 0.0:
                    self.zeros.add(self.name(to, to.id, kind, i))
                else:
                    pairs.append((self.part(to, i) if kind else self.visit(to), number))
        pairs = [(to, number) for to, number in pairs if not same(to, number)]
        changed: set[str] = set()
        for to, number in pairs:
            if changed and changed & uses(number):
                return [ast.Assign([row([to for to, _ in pairs])], row([number for _, number in pairs]))]
            changed.add(spelled(to))
        return [ast.Assign([to], number) for to, number in pairs]

    def unpack(self, node: ast.Assign, left: list[ast.expr], value: ast.Call) -> list[ast.stmt]:
        """What a function returns, taken apart."""
        kinds = self.returned(value)
        if kinds == [STATES] and len(left) == 1 and called(value) == "rates" and not alike(left[0], value.args[1]):
            raise self.refused(node, "must call the rates at y2 f2, and so on: those that are states are read from y2")
        if len(kinds) != len(left):
            kinds = [None] * len(left)  # numbers that are taken one by one
        self.learn(left, kinds)
        terms = [term for one in left for term in self.terms(one)]
        return [ast.Assign([row(terms)], self.visit(value))] if terms else [ast.Expr(self.visit(value))]

    def jacobian(self, f_t: str, J: str, call: ast.Call) -> list[ast.stmt]:
        """f_t, J = model.jacobian(...): for each rate to calculate its derivatives, that by time first."""
        self.kinds[f_t] = STATES
        self.slopes.add(J)
        own = self.spec.own
        named = {i: self.spec.number(f_t, STATES, i) for i in self.all_places(STATES)}
        self.zeros |= {name for i, name in named.items() if i not in own}
        names = [name for i in own for name in (named[i], *(self.spec.slope(i, j) for j in self.all_places(STATES)))]
        for name in names:
            if self.spelled.setdefault(name, J) != J:
                raise self.refused(call, f"has a slope of the name {name}, as {self.spelled[name]} has a number")
        self.spelled.update(dict.fromkeys((named[i] for i in own), f_t))
        return [ast.Assign([row([ast.Name(name) for name in names])], self.visit(call))]

    def clash(self) -> str:
        """A name that is both a number and a number of a vector, if there is one."""
        return min(self.numbers & self.spelled.keys(), default="")


def called(call: ast.Call) -> str:
    """The bare name of a function."""
    return getattr(call.func, "attr", getattr(call.func, "id", ""))


def alike(rates: ast.expr, states: ast.expr) -> bool:
    """f2 and y2."""
    f, y = (getattr(one, "attr", getattr(one, "id", "")) for one in (rates, states))
    return f[:1] == "f" and y == "y" + f[1:] and STEM.fullmatch(y) is not None


def expression(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


def row(terms: list[ast.expr]) -> ast.expr:
    return ast.Tuple(terms, ast.Load()) if len(terms) != 1 else terms[0]


def uses(node: ast.AST) -> set[str]:
    return {spelled(one) for one in walked(node) if isinstance(one, (ast.Name, ast.Attribute))}


def spelled(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else ast.unparse(node)


def without_zero(left: ast.expr, op: ast.operator, right: ast.expr) -> ast.expr:
    """A calculation, shorter where a number is known to be zero."""
    zero = [isinstance(one, ast.Constant) and one.value == 0.0 for one in (left, right)]
    if isinstance(op, ast.Mult) and any(zero):
        return ast.Constant(0.0)
    return left if isinstance(op, (ast.Add, ast.Sub)) and zero[1] else ast.BinOp(left, op, right)
