"""Lowers a file: unrolls loops, selects the branches that a model needs, and replaces vectors by scalars."""

import ast

from ..syntax_trees import parsed_module, replace_fields
from .constant_folding import known_truth
from .layout import ModelLayout
from .scalarize import LOOP_RANGES, METHOD_LOOP, Scalarizer
from .vector_symbols import SourceSymbols, annotated_kind, annotated_results, is_marked, item_label

SOLVER_IMPORTS = ("fabs", "nan")  # names of math in the statements of elimination.py
PLANAR_MODULE = "planar_contact"  # of models with contacts in a plane only


class FileLowerer:
    """Lowers the statements of a file; `vectors` is whether it uses vectors."""

    def __init__(self, spec: ModelLayout, symbols: SourceSymbols, path: str, text: str, vectors: bool) -> None:
        self.spec, self.symbols, self.path, self.has_vectors = spec, symbols, path, vectors
        self.scalarizer = self.new_scalarizer()
        self.has_systems = False  # whether a function solves linear equations
        body = parsed_module(text).body
        imports = [node for node in body if isinstance(node, ast.ImportFrom) and is_build_time_import(node)]
        self.ranges = {alias.name for node in imports for alias in node.names} & {*LOOP_RANGES, METHOD_LOOP}
        statements = self.lower_block(body)
        if self.has_systems:
            statements.insert(1, ast.ImportFrom("math", [ast.alias(name) for name in SOLVER_IMPORTS], 0))
        self.tree = ast.Module(statements, [])

    def new_scalarizer(self, index: dict[str, int] | None = None) -> Scalarizer:
        """Create the scalarizer of a function; `index` binds loop variables."""
        return Scalarizer(self.spec, self.symbols, self.path, self.has_vectors, index)

    def lower_block(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """Lower statements up to one that always leaves the function."""
        result: list[ast.stmt] = []
        for node in statements:
            for new in self.lower_any_statement(node):
                result.append(new if hasattr(new, "lineno") else ast.copy_location(new, node))
            if leaves(result):
                break
        return result

    def lower_any_statement(self, node: ast.stmt) -> list[ast.stmt]:
        """Lower a statement."""
        match node:
            case ast.ClassDef():
                return [replace_fields(node, body=self.lower_block(node.body) or [ast.Pass()])]
            case ast.FunctionDef(body=[ast.Expr(ast.Constant(str()))]):
                return []  # a declaration
            case ast.FunctionDef() if is_marked(node, "inlined"):
                return []
            case ast.FunctionDef():
                contacts = [argument.arg for argument in node.args.args if is_contact(argument)]
                indices = range(len(self.spec.contacts)) if contacts else [0]
                return [self.lower_function(node, contacts, i) for i in indices]
            case ast.For(target=ast.Name(id=name), iter=ast.Name(id=over)) if over in self.ranges:
                return self.unroll_indices(node, name, over)
            case ast.For(iter=ast.Name(id=over)) if over == METHOD_LOOP and over in self.ranges:
                return self.unroll_methods(node)
            case ast.If():
                return self.lower_if(node)
            case ast.While():
                return [replace_fields(node, test=self.scalarizer.visit(node.test), body=self.lower_block(node.body))]
            case ast.For():
                return [replace_fields(node, body=self.lower_block(node.body))]
        return self.lower_simple(node)

    def unroll_indices(self, node: ast.For, name: str, indices: str) -> list[ast.stmt]:
        """Unroll a loop over states or contacts."""
        index_ranges = {
            "contact_indices": range(len(self.spec.contacts)),
            "planar_indices": filter(self.spec.is_planar, range(len(self.spec.contacts))),
            "state_indices": range(len(self.spec.states)),
        }
        result = []
        for i in index_ranges.get(indices, self.spec.velocity_states):
            self.scalarizer.loop_indices[name] = i
            result += self.lower_block(node.body)
        return result

    def unroll_methods(self, node: ast.For) -> list[ast.stmt]:
        """Unroll a loop over the included methods; one that tests each of them becomes a chain of conditions."""
        bodies, tests = [], []
        for name in self.spec.methods:
            self.scalarizer.bind_method(node.target, name)
            match node.body:
                case [ast.If(test=test, body=body)]:
                    tests.append(self.scalarizer.visit(test))
                    bodies.append(self.lower_block(body))
                case body:
                    bodies.append(self.lower_block(body))
        self.scalarizer.method_bindings = {}
        if not tests:
            return [statement for body in bodies for statement in body]
        *_, result = bodies
        for test, body in reversed(list(zip(tests, bodies[:-1], strict=False))):
            result = [ast.If(test, body, result)]
        return result

    def lower_if(self, node: ast.If) -> list[ast.stmt]:
        """Lower an if statement; only one branch remains if the test is constant."""
        test = self.scalarizer.visit(node.test)
        if known_truth(test) is not None:
            return self.lower_block(node.body if known_truth(test) else node.orelse)
        body, orelse = self.lower_block(node.body), self.lower_block(node.orelse)
        return [replace_fields(node, test=test, body=body or [ast.Pass()], orelse=orelse)]

    def lower_simple(self, node: ast.stmt) -> list[ast.stmt]:
        """Lower a simple statement."""
        match node:
            case ast.ImportFrom(module="method_registry"):
                names = [ast.alias(name) for name in sorted(self.spec.methods)]
                return [ast.ImportFrom(None, names, 1)] if names else []
            case ast.ImportFrom() if is_build_time_import(node):
                return []
            case ast.ImportFrom(names=aliases):
                aliases = [alias for alias in aliases if self.spec.planar or alias.name != PLANAR_MODULE]
                return [replace_fields(node, names=aliases)] if aliases else []
            case ast.Import():
                return [node]
        return self.scalarizer.lower_statement(self.drop_excluded_items(node))

    def lower_function(self, node: ast.FunctionDef, contacts: list[str], i: int) -> ast.FunctionDef:
        """Lower a function; its parameters `contacts` are the index `i` of a contact."""
        outer, self.scalarizer = self.scalarizer, self.new_scalarizer(dict.fromkeys(contacts, i))
        self.scalarizer.function = node
        names = []
        for argument in node.args.args:
            if self.has_vectors and (kind := annotated_kind(argument)):
                self.scalarizer.vector_kinds[argument.arg] = kind
                names += [ast.unparse(term) for term in self.scalarizer.components(ast.Name(argument.arg))]
            elif argument.arg not in contacts:
                names.append(argument.arg)
        result = replace_fields(node, body=self.lower_block(node.body) or [ast.Pass()])
        if contacts or annotated_results(node) or any(map(annotated_kind, node.args.args)):
            name = node.name + (self.spec.contact_suffix(i) if contacts else "")
            arguments = replace_fields(node.args, args=[ast.arg(name) for name in names])
            result = replace_fields(result, name=name, args=arguments, returns=None)
        marks = [mark for mark in node.decorator_list if getattr(mark, "id", "") != "elementwise"]
        if self.scalarizer.has_name_clash():
            raise self.scalarizer.error(node)
        self.has_systems = self.has_systems or bool(self.scalarizer.systems)
        self.scalarizer = outer
        return replace_fields(result, decorator_list=marks)

    def drop_excluded_items(self, node: ast.stmt) -> ast.stmt:
        """Remove excluded items from a choice; the default becomes the first included item if it is excluded."""
        match node:
            case ast.Assign(
                targets=[ast.Name(id=name)],
                value=ast.Call(func=ast.Name(id="Enumeration"), args=[start, text, items]) as choice,
            ) if possible := self.spec.choices.get(name):
                is_included = ast.unparse(start).removesuffix(".NUMBER") in self.spec.methods
                if not is_included and self.symbols.constants.get(getattr(start, "id", "")) not in possible:
                    start = ast.Constant(possible[0])
                if isinstance(items, ast.Tuple):
                    items = replace_fields(items, elts=[item for item in items.elts if not self.is_excluded(item)])
                return replace_fields(node, value=replace_fields(choice, args=[start, text, items]))
        return node

    def is_excluded(self, node: ast.expr) -> bool:
        """Return whether this is an excluded item, or its name."""
        return (item_label(node) or self.symbols.constants.get(getattr(node, "id", ""))) in self.spec.excluded_labels


def leaves(statements: list[ast.stmt]) -> bool:
    """Return whether the last of some statements always leaves the function."""
    match statements:
        case [*_, ast.Return() | ast.Raise()]:
            return True
        case [*_, ast.If(body=body, orelse=orelse)]:
            return leaves(body) and leaves(orelse)
    return False


def is_build_time_import(node: ast.ImportFrom) -> bool:
    """Return whether this imports a build-time module: vectors or the method registry."""
    return (node.module or "").rsplit(".", 1)[-1] in ("vectors", "method_registry")


def is_contact(argument: ast.arg) -> bool:
    """Return whether an argument is a contact index."""
    return isinstance(argument.annotation, ast.Name) and argument.annotation.id == "ContactIndex"
