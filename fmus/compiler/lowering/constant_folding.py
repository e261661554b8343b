"""Folds constants: flags, comparisons of choices, and dependent tests."""

import ast
from typing import Any

from ..syntax_trees import TreeTransformer, replace_fields
from .layout import ModelLayout


class ConstantFolder(TreeTransformer):
    """Replaces fixed parts of expressions by True, False or a number."""

    def __init__(self, spec: ModelLayout, constants: dict[str, Any]) -> None:
        self.spec, self.constants = spec, constants
        self.choices = dict(spec.choices)  # includes local names

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        node = self.generic_visit(node)
        value = self.spec.flags.get(node.attr)
        return node if value is None or not isinstance(node.ctx, ast.Load) else ast.Constant(value)

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        match node:
            case ast.Compare(ast.Attribute() | ast.Name() as left, [ast.Eq() | ast.NotEq() as op], [ast.Name(id=name)]):
                possible = self.choices.get(left.attr if isinstance(left, ast.Attribute) else left.id)
                value = self.constants.get(name)
                if possible is not None and value is not None and (value not in possible or len(possible) == 1):
                    return ast.Constant((value in possible) == isinstance(op, ast.Eq))
        return self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        node = self.generic_visit(node)
        decides = isinstance(node.op, ast.Or)
        if any(known_truth(value) is decides for value in node.values):
            return ast.Constant(decides)
        values = [value for value in node.values if known_truth(value) is None]
        return (
            replace_fields(node, values=values)
            if len(values) > 1
            else values[0]
            if values
            else ast.Constant(not decides)
        )

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        node = self.generic_visit(node)
        truth = known_truth(node.operand)
        if isinstance(node.op, ast.Not) and truth is not None:
            return ast.Constant(not truth)
        return node

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        test = self.visit(node.test)
        if (truth := known_truth(test)) is None:
            return replace_fields(node, test=test, body=self.visit(node.body), orelse=self.visit(node.orelse))
        return self.visit(node.body if truth else node.orelse)


def known_truth(node: ast.AST) -> bool | None:
    """Return True or False if the node is that constant, else None."""
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, bool) else None
