"""State and helpers shared by the generators of model methods."""

from collections.abc import Collection, Sequence

from .algebra import (
    Memo,
    dependents,
    depends_on,
    operands,
    operands_first,
    subexpressions,
    substitute,
    unconditional_operands,
    unconditional_quotients,
)
from .expression_printer import INDENT, ExpressionPrinter
from .expressions import Expression, Operand, Term
from .model_analysis import ModelAnalysis
from .model_conditions import LIMITED_DOMAIN
from .model_declaration import Contact
from .model_roles import TIME

MAX_RETURN_LENGTH = 100  # characters
MAX_CHOICE_TESTS = 5  # for which a method has blocks: each test doubles their number
OVERFLOWING = ("exp", "sinh", "cosh")  # functions that raise an error for large arguments


class CodegenContext:
    """Model analysis together with the names, constants and argument lists of generated code."""

    def __init__(self, analysis: ModelAnalysis) -> None:
        self.analysis = analysis
        self.rate_outputs = [analysis.rate_outputs[s] for s in analysis.dynamic_states]  # rates of states
        self.driver = analysis.drivers[0] if analysis.drivers else None
        declared_names = {e.name for e in analysis.variables}
        self.names = analysis.names  # of terms that the model does not name
        for c in analysis.contacts:
            for name, e in ("load", analysis.load.get(c)), ("slide", c.slide), ("limit", analysis.holding_limit[c]):
                name += "" if analysis.rests_when_stuck else f"_{c.name}"
                if isinstance(e, Term) and not self.name_of(e) and name not in declared_names:
                    self.names[e] = name
        for (c, d), e in analysis.A.items():
            if (
                isinstance(e, Term)
                and not self.name_of(e)
                and not depends_on(e, analysis.input_symbols)
                and f"A_{c.name}_{d.name}" not in declared_names
            ):
                self.names[e] = f"A_{c.name}_{d.name}"
        self.states = [s.name for s in analysis.states]
        self.modes = [c.mode.name for c in analysis.contacts]
        self.arguments = ["t", *self.states, *self.modes]
        self.used_names = declared_names | {"self", *self.arguments}
        self.constants = self._constants()

    def name_of(self, e: Expression) -> str:
        """Return the name of an expression: that of the model, or of a derived term; empty if it has none."""
        return e.name or self.names.get(e, "")

    def _constants(self) -> list[Term]:
        """Return named expressions of parameters that the equations need; prepare() computes them.

        Those in cases of choose() may be undefined where the case is not used; they are computed if they cannot fail.
        """
        analysis = self.analysis
        result: dict[int, Term] = {}
        roots: list[Operand] = []
        for c in analysis.contacts:
            roots += [c.slide, analysis.holding_limit[c], c.eps]
            roots += [] if analysis.rests_when_stuck else [analysis.A[c, d] for d in analysis.contacts]
        roots += analysis.outputs
        dependent_ids = dependents(roots, (*analysis.time_varying, *analysis.input_symbols))
        can_fail = self._expressions_that_can_fail(roots)
        case_roots: list[Operand] = []

        def find_constants(targets: Sequence[Operand], in_case: bool) -> None:
            stack, visited_ids = [*reversed(targets)], set()
            while stack:
                e = stack.pop()
                if id(e) in visited_ids:
                    continue
                visited_ids.add(id(e))
                is_constant = isinstance(e, Term) and self.name_of(e) and id(e) not in dependent_ids
                if is_constant and not (in_case and id(e) in can_fail):
                    result[id(e)] = e
                elif in_case:
                    stack.extend(reversed(operands(e)))
                else:
                    stack.extend(reversed(unconditional_operands(e)))
                    case_roots.extend(operands(e)[len(unconditional_operands(e)) :])

        find_constants(roots, in_case=False)
        find_constants(case_roots, in_case=True)
        return list(result.values())

    def _expressions_that_can_fail(self, roots: Sequence[Operand]) -> set[int]:
        """Return the identities of expressions with an operation that may raise an error for some parameters.

        A division outside of the cases of choose() cannot fail, because a rule refuses divisors that are zero.
        """
        safe_divisors = {id(quotient.args[1]) for quotient in unconditional_quotients(roots)}
        result: set[int] = set()
        for e in operands_first(*roots):
            is_limited = isinstance(e, Term) and e.op in LIMITED_DOMAIN and id(e.args[-1]) not in safe_divisors
            if is_limited or getattr(e, "op", "") in OVERFLOWING or any(id(part) in result for part in operands(e)):
                result.add(id(e))
        return result

    def printer(self, depth: int = 2, on_trial: Collection[Expression] = ()) -> ExpressionPrinter:
        """Create a printer for a method, or for a block in it; see `ExpressionPrinter` for `on_trial`."""
        analysis = self.analysis
        names: dict[Expression, str] = (
            {s: s.name for s in analysis.states} | {m: m.name for m in analysis.modes} | {TIME: "t"}
        )
        for n, condition in enumerate(analysis.switches):
            if condition.piece is not None:
                names |= dict.fromkeys(condition.comparisons, f"int(self.condition_sides[{n}])")
            elif condition.is_frozen:
                names |= dict.fromkeys(condition.comparisons, f"self.condition_sides[{n}] > 0.0")
        return ExpressionPrinter(names, self.constants, self.used_names, depth, self.names, on_trial)

    def emit_driver(self, printer: ExpressionPrinter, targets: Sequence[Operand]) -> None:
        """Emit the position of the driver and time-dependent inputs, if the targets need them."""
        for e, rate in self.analysis.input_rates.items():
            calls = {e: "value_at(t - self.t_base)", rate: "rate_at(t - self.t_base)"}
            if e in self.analysis.input_second_rates:
                calls[self.analysis.input_second_rates[e]] = "derivative_at(t - self.t_base, 2)"
            for symbol, call in calls.items():
                if symbol not in printer.bound_names and any(depends_on(target, (symbol,)) for target in targets):
                    printer.bound_names[symbol] = symbol.name
                    printer.emit(f"{symbol.name} = self.{e.name}_polynomial.{call}")
        if self.driver is not None and any(depends_on(e, (self.driver,)) for e in targets):
            printer.bound_names[self.driver] = self.driver.name
            printer.emit(
                f"{self.driver.name} = self.x_base + self.{self.driver.constant_rate.name} * (t - self.t_base)"
            )

    @property
    def single_contact(self) -> Contact | None:
        """The contact of a single-body model, which rests while stuck, or None."""
        return self.analysis.contacts[0] if self.analysis.rests_when_stuck else None

    def emit_sign_mode(self, printer: ExpressionPrinter, c: Contact, targets: Sequence[Operand]) -> None:
        """Emit the sign of the slip as mode where the law uses it and mode is 0."""
        if len(c.laws) > 1 and any(depends_on(e, (c.mode,)) for e in targets):
            with printer.block(f"if {c.mode.name} == 0:"):
                printer.emit(f"{c.mode.name} = sign({printer.text(c.slip)})")

    def return_lines(self, printer: ExpressionPrinter, targets: Sequence[Operand]) -> list[str]:
        """Return the lines that return the targets.

        They have one block for each item of a choice that the targets use, unless there would be too many blocks.
        """
        tests = choice_tests(targets)
        if not 0 < len(tests) <= MAX_CHOICE_TESTS:
            self.emit_driver(printer, targets)
            printer.count_uses(*targets)
            return emit_return(printer, targets)
        test = tests[0]
        with printer.block(f"if {printer.text(test)}:"):
            printer.lines += self.return_lines(
                self.block_printer(printer), [substitute(e, {test: True}) for e in targets]
            )
        return printer.lines + self.return_lines(
            self.block_printer(printer), [substitute(e, {test: False}) for e in targets]
        )

    def block_printer(self, outer: ExpressionPrinter) -> ExpressionPrinter:
        """Create a printer for a block that knows the names of the lines before it."""
        printer = self.printer(outer.depth, outer.on_trial)
        printer.bound_names.update(outer.bound_names)
        printer.used_names.update(outer.used_names)
        return printer


def emit_return(printer: ExpressionPrinter, targets: Sequence[Operand]) -> list[str]:
    """Emit a return statement for the targets and return all lines."""
    texts = list(map(printer.text, targets))
    if sum(map(len, texts)) <= MAX_RETURN_LENGTH:
        printer.emit("return " + ", ".join(texts))
    else:
        with printer.block("return ("):
            for text in texts:
                printer.emit(f"{text},")
        printer.emit(")")
    return printer.lines


def emit_scales(context: CodegenContext, printer: ExpressionPrinter, sizes: list[Operand]) -> list[Operand]:
    """Return the rounding scales with the scale of the driver position inserted."""
    driver = context.driver
    if driver is None or not any(depends_on(e, (driver,)) for e in sizes):
        return sizes
    scale = Expression()
    scale.name = printer.fresh_name(f"scale_of_{driver.name}")
    printer.emit(
        f"{scale.name} = fabs(self.x_base) + fabs(self.{driver.constant_rate.name}) * (fabs(t) + fabs(self.t_base))"
    )
    printer.bound_names[scale] = scale.name
    return [
        substitute(e, {term: scale for term in subexpressions(e).values() if is_magnitude_of(term, driver)})
        for e in sizes
    ]


def is_magnitude_of(e: Operand, driver: Expression) -> bool:
    """Return whether this is the magnitude of the driver position."""
    return isinstance(e, Term) and e.op == "fabs" and e.args[0] is driver


def method_source(name: str, arguments: Sequence[str], lines: list[str]) -> str:
    """Return the source of a method."""
    return "\n".join([f"{INDENT}def {name}({', '.join(('self', *arguments))}):", *lines])


def rule_status(n: int) -> str:
    """Return the status of the n-th rule of a model."""
    return f"MODEL_RULE + {n}" if n else "MODEL_RULE"


def choice_tests(targets: Sequence[Operand]) -> list[Term]:
    """Return the comparisons with choices in the targets, in the order of the source text."""
    parts: Memo = {}
    for e in targets:
        subexpressions(e, parts)
    return [term for term in parts.values() if isinstance(term, Term) and term.op == "=="]
