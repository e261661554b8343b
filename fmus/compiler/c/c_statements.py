"""Translates the body of one function of the numerics to C statements.

Local variables are declared at the top, because Python's have function scope. A statement that can fault is followed by
a check that returns from the function, at the point where Python raises the exception.
"""

import ast
import re
from collections.abc import Callable
from types import FunctionType

from ..equations.reserved_names import C_NAMES
from ..lowering import function_tree
from ..syntax_trees import replace_fields
from .c_expressions import FAULT_CHECK, UNARY, CExpression, ExpressionTranslator, Specialise, make_tuple
from .c_types import (
    INT,
    CompileTimeValue,
    CType,
    Scalar,
    ScalarTuple,
    StructPointer,
    c_declaration,
    c_spelling,
    source_location,
)
from .struct_layout import StructLayout

ASSIGNMENT = re.compile(r" *(const [\w ]+[ *])?(\w+) = (.*);")  # type of a constant, name, value
CALL, NAME = re.compile(r"\w\("), re.compile(r"(?<![\w.>])[A-Za-z_]\w*")  # not the name of a field


class FunctionTranslator(ExpressionTranslator):
    """Translator for one function, specialised to the types of its arguments."""

    def __init__(
        self, layout: StructLayout, specialise: Specialise, function: FunctionType, arg_types: list[CType]
    ) -> None:
        super().__init__(layout, specialise, function)
        self.result: CType | None = None
        self.has_return = False  # a return was translated, so the result type is known
        self.assigned_at_breaks: list[list[set[str]]] = []  # per enclosing loop: names assigned at each of its breaks
        tree = function_tree(function)
        self.summary = (ast.get_docstring(tree) or "").replace("*/", "* /").splitlines()[:1]
        self.parameters = [argument.arg for argument in tree.args.args]
        for name, ctype in zip(self.parameters, arg_types, strict=True):
            self.declare_local(tree, name, ctype)
            self.assigned_names.add(name)
        if self.translate_block(tree.body) and self.result:
            raise self.error(tree)

    def text(self, name: str, is_rarely_called: bool = False) -> str:
        """Return the C function."""
        parameters = [
            c_declaration(self.local_types[p], p)
            for p in self.parameters
            if not isinstance(self.local_types[p], CompileTimeValue)
        ]
        parameters += ["bool *fault"] * self.can_fault
        comment = " - ".join([source_location(self.function), *self.summary])
        head = c_declaration(self.result, name) if self.result else f"void {name}"
        leave = f"return {self.zero_result()};" if self.result else "return;"
        body = [line.format(leave=leave) if line.lstrip() == FAULT_CHECK else line for line in self.lines]
        parameter_list = ", ".join(parameters) or "void"
        body = remove_unused_assignments(body, {*self.local_types} - {*self.parameters})
        names = names_in_lines(body)
        casts = [
            f"(void){name}"
            for name in (parameter.split()[-1].lstrip("*") for parameter in parameters)
            if name not in names
        ]
        cast_lines = [f"    {', '.join(casts)};"] if casts else []
        lines = [
            f"/* {comment} */",
            f"static {'COLD ' * is_rarely_called}{head}({parameter_list})",
            "{",
            *self.declarations(names),
            *cast_lines,
            *body,
            "}",
        ]
        return "".join(f"{line}\n" for line in lines)

    def declarations(self, used_names: set[str]) -> list[str]:
        """Declare the local variables that are used, one line per type."""
        names_by_type: dict[str, list[str]] = {}
        for name, ctype in self.local_types.items():
            if name not in self.parameters and name in used_names:
                names_by_type.setdefault(c_spelling(ctype), []).append(name)
        return [f"    {declaration_list(c, names)}" for c, names in names_by_type.items()]

    def zero_result(self) -> str:
        """Return the result of a function that faults."""
        return f"({self.result.c}){{0}}" if isinstance(self.result, ScalarTuple) else "0"

    # ---- lines

    def emit_block(self, head: str, body: Callable[[], bool]) -> bool:
        if head.startswith("else") and self.lines[-1].endswith("}"):
            head = f"{self.lines.pop().strip()} {head}"
        self.emit(head + " {")
        self.depth += 1
        end_reached = body()
        self.depth -= 1
        self.emit("}")
        return end_reached

    def begin_statement(self) -> None:
        """Reset the state of the current statement."""
        self.may_fault, self.effects_allowed, self.statement_call = False, True, None

    def translate_block(self, statements: list[ast.stmt]) -> bool:
        """Translate statements; return whether control reaches their end. Skips unreachable statements."""
        for statement in statements:
            self.begin_statement()
            if not self.visit(statement):
                return False
        return True

    # ---- statements: each method returns whether control reaches the next statement

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
            raise self.error(node)
        self.emit(f"{value.text};" if value.ctype == CompileTimeValue(None) else f"(void){value.as_operand(UNARY)};")
        self.emit_fault_check()
        return True

    def visit_Return(self, node: ast.Return) -> bool:
        value = self.right_hand_side(node.value) if node.value else None
        ctype = value.ctype if value else None
        if self.has_return and ctype != self.result:
            raise self.error(node)
        self.result, self.has_return = ctype, True
        self.emit(f"return {value.text};" if value else "return;")
        return False

    def right_hand_side(self, node: ast.expr) -> CExpression:
        """Translate the right-hand side of an assignment or a returned value."""
        if isinstance(node, ast.Tuple):
            return make_tuple([self.run_time_number(part) for part in node.elts])
        self.statement_call = node
        value = self.visit(node)
        return value if isinstance(value.ctype, (ScalarTuple, StructPointer)) else self.to_run_time(node, value)

    def visit_Assign(self, node: ast.Assign) -> bool:
        match node:
            case ast.Assign(targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=values)):
                if len(targets) != len(values):
                    raise self.error(node)
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
        """Translate a, b = x, y. Values are stored first if an assignment could change a later one."""
        expressions = [self.run_time_number(value) for value in values]
        names_read = [names_in(value) for value in values]
        independent = all(not names_in(target) & set().union(*names_read[i + 1 :]) for i, target in enumerate(targets))
        has_calls = any(isinstance(part, ast.Call) for value in values for part in ast.walk(value))
        has_attributes = not all(isinstance(target, ast.Name) for target in targets)  # a call could read them
        if self.may_fault or not independent or (has_calls and has_attributes):
            expressions = [self.in_local(value) for value in expressions]
            self.emit_fault_check()
        for target, value in zip(targets, expressions, strict=True):
            self.assign(target, value)

    def unpack(self, target: ast.Tuple, value: CExpression) -> None:
        if not isinstance(value.ctype, ScalarTuple) or len(value.ctype.parts) != len(target.elts):
            raise self.error(target)
        for i, (part, ctype) in enumerate(zip(target.elts, value.ctype.parts, strict=True)):
            self.assign(part, CExpression(ctype, f"{value.text}._{i}"))

    def visit_AugAssign(self, node: ast.AugAssign) -> bool:
        operand = replace_fields(node.target, ctx=ast.Load())
        value = ast.copy_location(ast.BinOp(operand, node.op, node.value), node)
        self.assign(node.target, self.run_time_number(value))
        return True

    def assign(self, target: ast.expr, value: CExpression) -> None:
        if isinstance(target, ast.Name):
            if target.id == "_":  # ignored
                return
            self.declare_local(target, target.id, value.ctype)
            self.assigned_names.add(target.id)
            lvalue = target.id
        else:
            self.is_pure = False
            if self.may_fault:  # after a fault nothing is assigned
                value = self.in_local(value)
                self.emit_fault_check()
            effects_allowed = self.effects_allowed
            attribute = self.visit(target)
            self.effects_allowed = effects_allowed
            self.require_same_type(target, attribute.ctype, value.ctype)
            lvalue = attribute.text
        self.emit(f"{lvalue} = {value.text};")
        self.emit_fault_check()

    def declare_local(self, node: ast.AST, name: str, ctype: CType) -> None:
        """Declare a local variable; its type never changes."""
        if name in C_NAMES:
            raise self.error(node)
        self.require_same_type(node, self.local_types.setdefault(name, ctype), ctype)

    def require_same_type(self, node: ast.AST, old_type: CType, new_type: CType) -> None:
        """Raise an error if a variable would change its type."""
        if old_type == new_type and isinstance(new_type, (Scalar, StructPointer, CompileTimeValue)):
            return
        raise self.error(node)

    # ---- branches and loops

    def visit_If(self, node: ast.If) -> bool:
        return self.translate_if(node, "if")

    def translate_if(self, node: ast.If, word: str) -> bool:
        test = self.boolean(node.test)
        condition = self.condition_text(test)
        before = set(self.assigned_names)
        end_reached = self.emit_block(f"{word} ({condition})", lambda: self.translate_block(node.body))
        after, self.assigned_names = self.assigned_names, before
        if node.orelse:
            end_reached_else = self.translate_else(node.orelse)
            if not (end_reached and end_reached_else):
                after = self.assigned_names if end_reached_else else after
                self.assigned_names = after
                return end_reached or end_reached_else
        self.assigned_names = self.assigned_names & after if end_reached else self.assigned_names
        return True

    def translate_else(self, statements: list[ast.stmt]) -> bool:
        """Translate an else branch, as else if where the condition needs no line of its own."""
        match statements:
            case [ast.If(test=test) as inner]:
                lines, self.lines = self.lines, []
                self.boolean(test)
                is_simple, self.lines = not self.lines and not self.may_fault, lines
                self.begin_statement()
                if is_simple:
                    return self.translate_if(inner, "else if")
        return self.emit_block("else", lambda: self.translate_block(statements))

    def condition_text(self, test: CExpression) -> str:
        """Return the text of a condition, stored in a local if it can fault."""
        if not self.may_fault:
            return test.text
        name = self.emit_temporary(test.ctype, test.text)
        self.emit_fault_check()
        return name

    def visit_While(self, node: ast.While) -> bool:
        match node:
            case ast.While(test=ast.Constant(value=True), orelse=[]):
                before = set(self.assigned_names)
                self.assigned_at_breaks.append([])
                self.emit_block("while (true)", lambda: self.translate_block(node.body))
                break_sets = self.assigned_at_breaks.pop()
                self.assigned_names = set.intersection(*break_sets) if break_sets else before
                return bool(break_sets)
        raise self.error(node)

    def visit_For(self, node: ast.For) -> bool:
        match node:
            case ast.For(target=ast.Name(), iter=ast.Call(func=ast.Name(id="range"), args=args), orelse=[]):
                bounds = [self.run_time_number(argument) for argument in args]
            case _:
                raise self.error(node)
        if len(bounds) not in (1, 2) or any(bound.ctype is not INT for bound in bounds):
            raise self.error(node)
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


def remove_unused_assignments(lines: list[str], local_variables: set[str]) -> list[str]:
    """Remove assignments to local variables that no line reads; calls stay, because they may fault or have effects."""
    while True:
        names_read = names_in_lines([match[3] if (match := ASSIGNMENT.fullmatch(line)) else line for line in lines])
        result = []
        for line in lines:
            match = ASSIGNMENT.fullmatch(line)
            if match is None or match[2] in names_read or (not match[1] and match[2] not in local_variables):
                result.append(line)
            elif CALL.search(match[3]):
                result.append(f"{line[: len(line) - len(line.lstrip())]}(void)({match[3]});")
        if result == lines:
            return lines
        lines = result


def names_in_lines(lines: list[str]) -> set[str]:
    """Return the names in C statements, functions included."""
    return {name for line in lines for name in NAME.findall(line)}


def names_in(node: ast.expr) -> set[str]:
    """Return the names and attributes in an expression."""
    names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
    return names - {"self"} | {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}


def declaration_list(c: str, names: list[str]) -> str:
    """Declare several variables: double a, b; or struct Methods *a, *b;"""
    star = "*" if c.endswith("*") else ""
    return f"{c.rstrip('*').rstrip()} " + ", ".join(star + name for name in names) + ";"
