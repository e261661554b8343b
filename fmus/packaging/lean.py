"""An FMU that offers some of the methods and friction laws, and carries just their code.

The sources are rewritten before it is asked which files they need: what is not offered loses its item, its branches
and its imports, and a choice that is settled is no longer looked at.  Only files that change lose their comments.
ode23 stays, offered or not: the size of the first step rests on it.
"""

import ast
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module, invalidate_caches
from pathlib import Path
from tempfile import TemporaryDirectory

from ..runtime.automaton import HYBRID_LAW, SIGN_LAW, THRESHOLD_LAW
from ..runtime.declare import Declaring, variables
from ..runtime.methods import EXACT_ITEM, ITEMS
from . import BuildError

METHODS: dict[str, int] = {label: value for label, value, _ in (EXACT_ITEM, *ITEMS)}
LAWS: dict[str, int] = {label: value for label, value, _ in (HYBRID_LAW, SIGN_LAW, THRESHOLD_LAW)}
CHOSEN: dict[str, dict[str, int]] = {
    "method": METHODS,
    "chosen": METHODS,
    "friction": LAWS,
}  # attribute -> what it chooses from
EXACT, HYBRID, BASE = EXACT_ITEM[0], HYBRID_LAW[0], "ode23"


@dataclass(frozen=True)
class Offer:
    """The labels of the methods and of the laws that an FMU shall offer."""

    methods: tuple[str, ...]
    laws: tuple[str, ...]

    def keeps(self, label: str) -> bool:
        return label in self.methods or label in self.laws


def offer(model: type[Declaring], name: str, methods: Sequence[str], laws: Sequence[str]) -> Offer | None:
    """What is asked for, or None for all that the model has; BuildError for what it does not have."""
    chosen = {}
    for variable, word, wanted in ("solver.method", "method", methods), ("friction", "friction law", laws):
        declared = dict(variables(model())).get(variable)
        has: list[str] = [item[0] for item in declared.items] if declared else []
        for label in wanted:
            if label not in has:
                raise BuildError(f"{name} has no {word} {label!r}; it has {', '.join(has) or 'none to choose'}.")
        chosen[word] = tuple(label for label in has if label in wanted or not wanted)
    kept = chosen["method"]
    if laws and HYBRID not in laws:  # the closed form holds for no other
        kept = tuple(label for label in kept if label != EXACT)
        if not kept:
            raise BuildError(f"{name} has the method {EXACT!r} for the law {HYBRID!r} only: ask for that law as well.")
    return Offer(kept, chosen["friction law"]) if methods or laws else None


def reduced(path: str, text: str, offered: Offer) -> str:
    """The source of a file of the package without what is not offered."""
    tree = ast.parse(text, path)
    before = ast.dump(tree)
    tree = ast.fix_missing_locations(Reduction(offered, model="/" not in path).visit(tree))
    return text if ast.dump(tree) == before else ast.unparse(tree) + "\n"


def imported(sources: dict[str, str], name: str, title: str, package: str) -> type[Declaring]:
    """The class `title` of a model, as it travels."""
    with TemporaryDirectory() as folder:
        for path, text in sources.items():
            file = Path(folder, package, path)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        sys.path.insert(0, folder)
        invalidate_caches()
        try:
            return vars(import_module(f"{package}.{name}"))[title]
        finally:
            sys.path.remove(folder)


class Reduction(ast.NodeTransformer):
    """Takes what is not offered out of a tree."""

    def __init__(self, offered: Offer, model: bool):
        self.offered, self.model = offered, model
        self.gone = {label for label in (*METHODS, *LAWS) if not offered.keeps(label)}
        self.items = {f"{label.upper()}{kind}" for label in self.gone for kind in ("_ITEM", "_LAW")}
        self.modules = self.gone & set(METHODS) - {BASE}
        self.unclosed = model and EXACT in self.gone  # a model that is not asked for its closed form

    # ---- items

    def visit_Tuple(self, node: ast.Tuple) -> ast.AST:
        self.generic_visit(node)
        node.elts = [part for part in node.elts if not self.is_item(part)]
        return node

    def is_item(self, node: ast.expr) -> bool:
        """Whether this is an item that is not offered, or its name."""
        if isinstance(node, ast.Tuple) and len(node.elts) == 3 and isinstance(node.elts[0], ast.Constant):
            return node.elts[0].value in self.gone
        return isinstance(node, ast.Name) and node.id in self.items

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """A choice that starts with what is not offered starts with the first that is."""
        self.generic_visit(node)
        if isinstance(node.func, ast.Name) and node.func.id == "Choice" and isinstance(node.args[0], ast.Name):
            start = node.args[0].id.lower()
            for all_, kept in (METHODS, self.offered.methods), (LAWS, self.offered.laws):
                if start in all_ and start in self.gone:
                    node.args[0] = ast.Constant(all_[kept[0]])
        return node

    # ---- imports and objects

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST | None:
        if (node.module or "").split(".")[-1] in self.modules:
            return None
        node.names = [alias for alias in node.names if alias.name not in self.modules | self.items]
        return node

    def visit_Assign(self, node: ast.Assign) -> ast.AST | None:
        self.generic_visit(node)
        if self.unclosed and self.uses_closed_form(node):
            return None
        (target,) = node.targets[:1]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            pairs = zip(target.elts, node.value.elts, strict=True)
            kept = [(one, value) for one, value in pairs if not self.makes_method(value)]
            target.elts, node.value.elts = [one for one, _ in kept], [value for _, value in kept]
            if len(kept) == 1:
                node.targets[0], node.value = kept[0]
        if self.unclosed and isinstance(target, ast.Name) and target.id == "linear":
            node.value = ast.Constant(False)
        return node

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        self.generic_visit(node)
        return None if self.unclosed and self.uses_closed_form(node) else node

    def makes_method(self, node: ast.expr) -> bool:
        return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id.lower() in self.modules

    @staticmethod
    def uses_closed_form(node: ast.AST) -> bool:
        return any(isinstance(part, ast.Attribute) and part.attr == EXACT for part in ast.walk(node))

    # ---- branches

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        """What a comparison of a choice with one of its constants must give."""
        attribute = node.left.attr if isinstance(node.left, ast.Attribute) else getattr(node.left, "id", "")
        (constant,) = node.comparators[:1]
        label = constant.id.lower() if isinstance(constant, ast.Name) else ""
        if (
            attribute not in CHOSEN
            or label not in CHOSEN[attribute]
            or not isinstance(node.ops[0], (ast.Eq, ast.NotEq))
        ):
            return node
        kept = [other for other in CHOSEN[attribute] if self.offered.keeps(other)]
        if label in kept and len(kept) > 1:
            return node
        return ast.Constant((label in kept) == isinstance(node.ops[0], ast.Eq))

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        decides = isinstance(node.op, ast.Or)
        if any(settled(part) is decides for part in node.values):
            return ast.Constant(decides)
        node.values = [part for part in node.values if settled(part) is None]
        return node if len(node.values) > 1 else node.values[0] if node.values else ast.Constant(not decides)

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        answer = settled(node.test)
        return node if answer is None else node.body if answer else node.orelse

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        self.generic_visit(node)
        answer = settled(node.test)
        return node if answer is None else node.body if answer else node.orelse

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """Nothing follows a return."""
        self.generic_visit(node)
        ends = [place for place, part in enumerate(node.body, 1) if isinstance(part, ast.Return)]
        node.body = node.body[: ends[0]] if ends else node.body
        return node


def settled(node: ast.expr) -> bool | None:
    """True or False where the test has been settled, else None."""
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, bool) else None
