"""Model files with another order of declarations, or in a moving frame of reference."""

import ast
from dataclasses import dataclass


def reverse_declarations(text: str) -> str:
    """Return a model file with its declarations in reverse, as far as one does not need the other.

    The text is empty if they need each other, as two loops with the same variable do.

    Parameters
    ----------
    text : str
        Text of a file with one model class.
    """
    tree = ast.parse(text)
    (model,) = (node for node in tree.body if isinstance(node, ast.ClassDef))
    model.body = order_last_first([part for node in model.body for part in split_assignment(node)])
    return ast.unparse(tree) + "\n" if model.body else ""


@dataclass(frozen=True)
class MovingFrame:
    """A model file in a frame of reference that moves at a constant speed.

    Attributes
    ----------
    text : str
        Text of the file, with the additional parameter SPEED.
    positions, velocities : dict
        States of the original model, and their names in the frame.
    start_values : dict
        Velocities of the original model, and what sets their start value in the frame.
    """

    text: str
    positions: dict[str, str]
    velocities: dict[str, str]
    start_values: dict[str, str]


SPEED, PATH = "speed_of_frame", "path_of_frame"
POSITION_UNITS = {"m/s": "m", "rad/s": "rad"}  # by the unit of velocities


def move_frame(text: str) -> MovingFrame | None:
    """Return a model file in a moving frame, or None if no state is a velocity.

    The states x and v become x = x_in_frame + PATH and v = v_in_frame + SPEED in all equations. All velocities of one
    unit move with the frame: those in m/s if there are any.
    """
    tree = ast.parse(text)
    (model,) = (node for node in tree.body if isinstance(node, ast.ClassDef))
    statements = [part for node in model.body for part in split_assignment(node)]
    states = {name: call for node in statements if (name := assigned_name(node)) and (call := find_call(node, "State"))}
    units = {name: ast.literal_eval(call.args[0]) for name, call in states.items()}
    unit = next((unit for unit in POSITION_UNITS if unit in units.values()), None)
    if unit is None:
        return None
    speeds = [name for name, call in states.items() if units[name] == unit and find_argument(call, "rate") is None]
    paths = [
        rate_node.id for name in speeds if isinstance(rate_node := find_argument(states[name], "rate_of"), ast.Name)
    ]
    new_names = {name: f"{name}_in_frame" for name in (*paths, *speeds)}
    start_values = {}
    docstring = [node for node in statements[:1] if is_docstring(node)]
    body = (
        docstring
        + ast.parse(
            f"{SPEED} = Parameter(0.0, {unit!r}, 'speed of the frame')\n"
            f"{PATH} = State({POSITION_UNITS[unit]!r}, 'path of the frame', rate={SPEED})"
        ).body
    )
    for node in statements[len(docstring) :]:
        for call in (part for part in ast.walk(node) if isinstance(part, ast.Call)):
            if isinstance(rate_node := find_argument(call, "rate_of"), ast.Name):
                rate_node.id = new_names.get(rate_node.id, rate_node.id)
        name = assigned_name(node)
        if name in speeds:
            start = find_argument(states[name], "start")
            start_values[name] = start.id if isinstance(start, ast.Name) else f"{name}_at_start"
            if not isinstance(start, ast.Name):
                body += ast.parse(f"{start_values[name]} = Fixed(0.0, {unit!r}, 'start value')").body
                states[name].keywords = [keyword for keyword in states[name].keywords if keyword.arg != "start"]
                states[name].keywords.append(ast.keyword("start", ast.Name(start_values[name], ast.Load())))
        if name in new_names:
            node.targets = [ast.Name(new_names[name], ast.Store())]  # type: ignore[attr-defined]
            body += [node, *ast.parse(f"{name} = {new_names[name]} + {SPEED if name in speeds else PATH}").body]
        else:
            body.append(node)
    model.body = body
    tree.body.insert(tree.body.index(model), *ast.parse("from fmus import Fixed, Parameter, State").body)
    positions, velocities = ({name: new_names[name] for name in names} for names in (paths, speeds))
    return MovingFrame(ast.unparse(tree) + "\n", positions, velocities, start_values)


def find_argument(call: ast.Call, name: str) -> ast.expr | None:
    """Return the keyword argument of a call, or None."""
    return next((keyword.value for keyword in call.keywords if keyword.arg == name), None)


def assigned_name(node: ast.stmt) -> str:
    """Return the name in `name = ...`; empty for other statements."""
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
        return node.targets[0].id
    return ""


def find_call(node: ast.stmt, function: str) -> ast.Call | None:
    """Return the call in `name = function(...)`, or None."""
    value = node.value if isinstance(node, ast.Assign) else None
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id == function:
        return value
    return None


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
    """Return statements in an order in which each follows those that it needs; of several, the last one first.

    There are none if statements need each other.
    """
    assigned_names = [find_names(statement, ast.Store) for statement in statements]
    needed_names = [find_names(statement, ast.Load) for statement in statements]
    ordered_statements = [statement for statement in statements[:1] if is_docstring(statement)]
    remaining_indices = list(range(len(ordered_statements), len(statements)))
    while remaining_indices:
        ready = [
            i
            for i in remaining_indices
            if not any(
                j != i and (assigned_names[j] & needed_names[i] or (j < i and assigned_names[i] & needed_names[j]))
                for j in remaining_indices
            )
        ]
        if not ready:
            return []
        i = max(ready)
        remaining_indices.remove(i)
        ordered_statements.append(statements[i])
    return ordered_statements


def is_docstring(statement: ast.stmt) -> bool:
    """Return whether a statement is a text."""
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def find_names(node: ast.stmt, context: type[ast.expr_context]) -> set[str]:
    """Return the names that a statement assigns (ast.Store) or uses (ast.Load)."""
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, context)}
