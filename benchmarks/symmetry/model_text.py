"""Model files with another order of declarations."""

import ast


def reverse_declarations(text: str) -> str:
    """Return a model file with its declarations in reverse, as far as one does not need the other.

    Parameters
    ----------
    text : str
        Text of a file with one model class.
    """
    tree = ast.parse(text)
    (model,) = (node for node in tree.body if isinstance(node, ast.ClassDef))
    model.body = order_last_first([part for node in model.body for part in split_assignment(node)])
    return ast.unparse(tree) + "\n"


def split_assignment(node: ast.stmt) -> list[ast.stmt]:
    """Return the single assignments of `a, b = c, d`."""
    if isinstance(node, ast.Assign) and len(node.targets) == 1:
        (target,), value = node.targets, node.value
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple) and len(target.elts) == len(value.elts):
            return [
                ast.copy_location(ast.Assign([name], part), node)
                for name, part in zip(target.elts, value.elts, strict=True)
            ]
    return [node]


def order_last_first(statements: list[ast.stmt]) -> list[ast.stmt]:
    """Return statements in an order in which each follows those that it needs; of several, the last one first."""
    assigned = [find_names(statement, ast.Store) for statement in statements]
    needed = [find_names(statement, ast.Load) for statement in statements]
    ordered = [statement for statement in statements[:1] if is_docstring(statement)]
    remaining = list(range(len(ordered), len(statements)))
    while remaining:
        i = max(
            i
            for i in remaining
            if not any(j != i and (assigned[j] & needed[i] or (j < i and assigned[i] & needed[j])) for j in remaining)
        )
        remaining.remove(i)
        ordered.append(statements[i])
    return ordered


def is_docstring(statement: ast.stmt) -> bool:
    """Return whether a statement is a text."""
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def find_names(node: ast.stmt, context: type[ast.expr_context]) -> set[str]:
    """Return the names that a statement assigns (ast.Store) or uses (ast.Load)."""
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, context)}
