"""The body of one function of the numerics as C statements.

Names are declared at the top, as in Python they live as long as the function.  A statement in which something may
fault is followed by a check that leaves the function, just where Python's exception would.
"""

import ast
from collections.abc import Callable
from types import FunctionType
from typing import TYPE_CHECKING

from ..lowering import function_tree
from ..reserved_names import C_NAMES
from .c_types import FLOAT, INT, CompileTimeValue, CType, Scalar, ScalarTuple, StructPointer, c_declaration, c_spelling
from .diagnostics import source_location
from .expressions import FAULT_CHECK, UNARY, CExpression, ExpressionTranslator, make_tuple

if TYPE_CHECKING:
    from .call_graph import CallGraph


class FunctionTranslator(ExpressionTranslator):
    """One function, specialised to the kinds of its arguments."""

    def __init__(self, call_graph: "CallGraph", function: FunctionType, arg_types: list[CType]) -> None:
        super().__init__(call_graph, function)
        self.result: CType | None = None
        self.has_return = False  # a return was seen, so the result is known
        self.assigned_at_breaks: list[list[set[str]]] = []  # for every loop around: what has a value at its breaks
        tree = function_tree(function)
        self.summary = (ast.get_docstring(tree) or "").replace("*/", "* /").splitlines()[:1]
        self.parameters = [argument.arg for argument in tree.args.args]
        for name, ctype in zip(self.parameters, arg_types, strict=True):
            self.declare_local(tree, name, ctype)
            self.assigned_names.add(name)
        if self.translate_block(tree.body) and self.result:
            raise self.unsupported(tree, "may end without a return", "return a value on every way")

    def text(self, name: str) -> str:
        """The C function."""
        parameters = [
            c_declaration(self.local_types[p], p)
            for p in self.parameters
            if not isinstance(self.local_types[p], CompileTimeValue)
        ]
        parameters += ["bool *fault"] * self.can_fault
        about = " - ".join([source_location(self.function), *self.summary])
        head = c_declaration(self.result, name) if self.result else f"void {name}"
        leave = f"return {self.zero_result()};" if self.result else "return;"
        body = [line.format(leave=leave) if line.lstrip() == FAULT_CHECK else line for line in self.lines]
        given = ", ".join(parameters) or "void"
        lines = [f"/* {about} */", f"static {head}({given})", "{", *self.declarations(), *body, "}"]
        return "".join(f"{line}\n" for line in lines)

    def declarations(self) -> list[str]:
        """The local names, a line for each kind."""
        arg_types: dict[str, list[str]] = {}
        for name, ctype in self.local_types.items():
            if name not in self.parameters:
                arg_types.setdefault(c_spelling(ctype), []).append(name)
        return [f"    {declaration_list(c, names)}" for c, names in arg_types.items()]

    def zero_result(self) -> str:
        """What is returned with the fault flag up."""
        return f"({self.result.c}){{0}}" if isinstance(self.result, ScalarTuple) else "0"

    # ---- lines

    def emit_block(self, head: str, body: Callable[[], bool]) -> bool:
        if head.startswith("else") and self.lines[-1].endswith("}"):
            head = f"{self.lines.pop().strip()} {head}"
        self.emit(head + " {")
        self.depth += 1
        falls = body()
        self.depth -= 1
        self.emit("}")
        return falls

    def begin_statement(self) -> None:
        """Nothing of the statement at hand has been seen yet."""
        self.may_fault, self.effects_allowed, self.statement_call = False, True, None

    def translate_block(self, statements: list[ast.stmt]) -> bool:
        """Statements in a row; whether their end is reached.  What comes after a return is left out."""
        for statement in statements:
            self.begin_statement()
            if not self.visit(statement):
                return False
        return True

    # ---- statements: each tells whether the next one is reached

    def visit_Pass(self, node: ast.Pass) -> bool:
        return True

    def visit_Expr(self, node: ast.Expr) -> bool:
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return True  # a docstring
        self.statement_call = node.value
        value = self.visit(node.value)
        if not isinstance(node.value, ast.Call) or (
            isinstance(value.ctype, CompileTimeValue) and value.ctype.value is not None
        ):
            raise self.unsupported(node, "has no effect", "leave it out")
        self.emit(f"{value.text};" if value.ctype == CompileTimeValue(None) else f"(void){value.as_operand(UNARY)};")
        self.emit_fault_check()
        return True

    def visit_Return(self, node: ast.Return) -> bool:
        value = self.right_hand_side(node.value) if node.value else None
        ctype = value.ctype if value else None
        if self.has_return and ctype != self.result:
            raise self.unsupported(
                node, "returns something else than the return before", "return the same kind of numbers"
            )
        self.result, self.has_return = ctype, True
        self.emit(f"return {value.text};" if value else "return;")
        return False

    def right_hand_side(self, node: ast.expr) -> CExpression:
        """The right-hand side of an assignment or what is returned."""
        if isinstance(node, ast.Tuple):
            return make_tuple([self.run_time_number(part) for part in node.elts])
        self.statement_call = node
        value = self.visit(node)
        return value if isinstance(value.ctype, (ScalarTuple, StructPointer)) else self.to_run_time(node, value)

    def visit_Assign(self, node: ast.Assign) -> bool:
        match node:
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=values)):
                if len(targets) != len(values):
                    raise self.unsupported(node, "has more or fewer values than names", "write one for each")
                self.assign_parallel(targets, values)
                return True
        value = self.right_hand_side(node.value)
        if len(node.targets) > 1 or isinstance(node.targets[0], ast.Tuple):
            value = self.in_local(value)
            self.emit_fault_check()
        for target in node.targets:
            if isinstance(target, ast.Tuple):
                self.unpack(target, value)
            else:
                self.assign(target, value)
        return True

    def assign_parallel(self, targets: list[ast.expr], values: list[ast.expr]) -> None:
        """a, b = x, y: all values come first where the order can be told."""
        found = [self.run_time_number(value) for value in values]
        later = [names_in(value) for value in values]
        apart = all(not names_in(target) & set().union(*later[i + 1 :]) for i, target in enumerate(targets))
        calls = any(isinstance(part, ast.Call) for value in values for part in ast.walk(value))
        fields = not all(isinstance(target, ast.Name) for target in targets)  # which a call may read
        if self.may_fault or not apart or (calls and fields):
            found = [self.in_local(value) for value in found]
            self.emit_fault_check()
        for target, value in zip(targets, found, strict=True):
            self.assign(target, value)

    def unpack(self, target: ast.Tuple, value: CExpression) -> None:
        if not isinstance(value.ctype, ScalarTuple) or len(value.ctype.parts) != len(target.elts):
            raise self.unsupported(target, "does not fit what is returned", "write one name for each number")
        for i, (part, ctype) in enumerate(zip(target.elts, value.ctype.parts, strict=True)):
            self.assign(part, CExpression(ctype, f"{value.text}._{i}"))

    def visit_AugAssign(self, node: ast.AugAssign) -> bool:
        loaded = ast.copy_location(ast.parse(ast.unparse(node.target), mode="eval").body, node)
        value = ast.copy_location(ast.BinOp(loaded, node.op, node.value), node)
        self.assign(node.target, self.run_time_number(value))
        return True

    def assign(self, target: ast.expr, value: CExpression) -> None:
        if isinstance(target, ast.Name):
            if target.id == "_":  # not wanted
                return
            self.declare_local(target, target.id, value.ctype)
            self.assigned_names.add(target.id)
            place = target.id
        else:
            self.is_pure = False
            if self.may_fault:  # then nothing is assigned
                value = self.in_local(value)
                self.emit_fault_check()
            effects_allowed = self.effects_allowed
            found = self.visit(target)
            self.effects_allowed = effects_allowed
            self.require_same_type(target, found.ctype, value.ctype)
            place = found.text
        self.emit(f"{place} = {value.text};")
        self.emit_fault_check()

    def declare_local(self, node: ast.AST, name: str, ctype: CType) -> None:
        """Take a name into use; it keeps its kind for life."""
        if name in C_NAMES:
            raise self.unsupported(node, f"uses {name}, a word of C", "take another name")
        self.require_same_type(node, self.local_types.setdefault(name, ctype), ctype)

    def require_same_type(self, node: ast.AST, old: CType, new: CType) -> None:
        if old == new and isinstance(new, (Scalar, StructPointer, CompileTimeValue)):
            return
        words = [getattr(ctype, "name", "no number") for ctype in (old, new)]
        instead = "write 0.0, not 0" if (old, new) == (FLOAT, INT) else "use another name"
        raise self.unsupported(node, f"is assigned a {words[1]} where there was a {words[0]}", instead)

    # ---- branches and loops

    def visit_If(self, node: ast.If) -> bool:
        return self.translate_if(node, "if")

    def translate_if(self, node: ast.If, word: str) -> bool:
        test = self.boolean(node.test)
        condition = self.condition_text(test)
        before = set(self.assigned_names)
        falls = self.emit_block(f"{word} ({condition})", lambda: self.translate_block(node.body))
        after, self.assigned_names = self.assigned_names, before
        if node.orelse:
            falls_else = self.translate_else(node.orelse)
            if not (falls and falls_else):
                after = self.assigned_names if falls_else else after
                self.assigned_names = after
                return falls or falls_else
        self.assigned_names = self.assigned_names & after if falls else self.assigned_names
        return True

    def translate_else(self, statements: list[ast.stmt]) -> bool:
        """else; or else if, where the test needs no line of its own."""
        match statements:
            case [ast.If(test=test) as inner]:
                lines, self.lines = self.lines, []
                self.boolean(test)
                plain, self.lines = not self.lines and not self.may_fault, lines
                self.begin_statement()
                if plain:
                    return self.translate_if(inner, "else if")
        return self.emit_block("else", lambda: self.translate_block(statements))

    def condition_text(self, test: CExpression) -> str:
        """The text of a test, kept in a name of its own if it may fault."""
        if not self.may_fault:
            return test.text
        name = self.emit_temporary(test.ctype, test.text)
        self.emit_fault_check()
        return name

    def visit_While(self, node: ast.While) -> bool:
        if node.orelse:
            raise self.unsupported(node, "has an else", "use a flag")
        before = set(self.assigned_names)
        self.assigned_at_breaks.append([])
        lines, self.lines = self.lines, []
        self.depth += 1
        test = self.boolean(node.test)
        endless, condition = test.text == "true", self.condition_text(test)
        prelude, self.lines = self.lines, lines
        self.depth -= 1
        head = f"while ({'true' if prelude else condition})"

        def body() -> bool:
            if prelude:
                self.lines += prelude
                self.emit(f"if (!{condition if condition.isidentifier() else f'({condition})'}) break;")
            return self.translate_block(node.body)

        self.emit_block(head, body)
        ways = self.assigned_at_breaks.pop()
        if endless:
            self.assigned_names = set.intersection(*ways) if ways else before
            return bool(ways)
        self.assigned_names = before
        return True

    def visit_For(self, node: ast.For) -> bool:
        match node:
            case ast.For(target=ast.Name(), iter=ast.Call(func=ast.Name(id="range"), args=args), orelse=[]):
                bounds = [self.run_time_number(argument) for argument in args]
            case _:
                raise self.unsupported(node, "is no loop over a range", "write for i in range(n)")
        if len(bounds) not in (1, 2) or any(bound.ctype is not INT for bound in bounds):
            raise self.unsupported(node, "has another range than of one or two ints", "write range(n) or range(m, n)")
        low, high = (self.in_local(bound).text for bound in [CExpression(INT, "0"), *bounds][-2:])
        self.emit_fault_check()
        counter, before = f"_{next(self.temporaries)}", set(self.assigned_names)
        self.assigned_at_breaks.append([])

        def body() -> bool:
            self.assign(node.target, CExpression(INT, counter))
            return self.translate_block(node.body)

        self.emit_block(f"for (int64_t {counter} = {low}; {counter} < {high}; {counter}++)", body)
        self.assigned_at_breaks.pop()
        self.assigned_names = before
        return True

    def visit_Break(self, node: ast.Break) -> bool:
        self.assigned_at_breaks[-1].append(set(self.assigned_names))
        self.emit("break;")
        return False

    def visit_Continue(self, node: ast.Continue) -> bool:
        self.emit("continue;")
        return False


def names_in(node: ast.expr) -> set[str]:
    """The names and attributes in an expression."""
    names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    return names - {"self"} | {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}


def declaration_list(c: str, names: list[str]) -> str:
    """double a, b;  or  struct Methods *a, *b;"""
    star = "*" if c.endswith("*") else ""
    return f"{c.rstrip('*').rstrip()} " + ", ".join(star + name for name in names) + ";"
