"""Checks the declarations of a model: names, types, ranges, start values, rules and settings."""

from math import inf
from sys import float_info

from ...runtime.active_method import EXACT_ITEM, METHOD_ITEMS
from .algebra import depends_on, operands, operands_first, subexpressions
from .expressions import (
    NO_EQUALITY,
    Expression,
    ModelError,
    Operand,
    Term,
    describe,
    is_among,
    is_comparison,
    is_number,
)
from .model_declaration import OPTIONS, Choice, Contact, Output, SettableVariable, Variable
from .model_roles import ModelRoles

LARGEST_FLOAT = float_info.max
METHODS = [label for label, _, _ in (EXACT_ITEM, *METHOD_ITEMS)]


def check_declarations(analysis: ModelRoles) -> None:
    """Check that all variables are declared in this class, and that modes, starts and rules are valid."""
    variables, location = set(analysis.variables), analysis.model.location

    def operands_in_declaration(e: Operand) -> tuple[Operand, ...]:
        return () if isinstance(e, Output) and e in variables else operands(e)

    for e in analysis.variables:
        for part in analysis.declared_expressions(e):
            parts = operands_first(part, operands_of=operands_in_declaration)
            for leaf in parts:
                if not isinstance(leaf, Expression) or isinstance(leaf, (Term, Output)):
                    continue
                if not leaf.name:
                    raise ModelError(
                        f"{e.name} uses a variable without a name: assign the variable to a name in the class first",
                        e.location,
                    )
                if leaf not in variables:
                    raise ModelError(f"{e.name} uses {leaf.name}, which is not declared in {analysis.name}", e.location)
            _check_choices(e, parts)
        _check_variable(analysis, e)
    for mode in analysis.modes:
        owners = [c for c in analysis.contacts if c.mode is mode]
        if len(owners) != 1:
            raise ModelError(
                f"{mode.name} is the mode of {len(owners)} contacts: each Mode needs exactly one Contact",
                mode.location,
            )
    for s in (*analysis.states, *analysis.drivers):
        for word, e in (
            ("start", s.start_expression),
            ("rate", s.constant_rate),
            ("nominal_velocity", s.nominal_velocity),
        ):
            if depends_on(e, analysis.time_varying):
                raise ModelError(f"{word} of {s.name} varies with time: it must depend on parameters only", s.location)
    for rule in analysis.rules:
        if isinstance(rule.broken, Term) and rule.broken.op == "==":
            raise ModelError(NO_EQUALITY, rule.broken.location)
        if not is_comparison(rule.broken):
            raise ModelError(f"a Rule needs a comparison of parameters first, got {describe(rule.broken)}", location)
        if depends_on(rule.broken, (*analysis.time_varying, *analysis.inputs)):
            raise ModelError("a Rule must depend on parameters only", rule.broken.location)
        _check_printable("the sentence of a Rule", rule.broken.location, rule.sentence)
        try:
            rule.sentence.format_map({e.name: 1.0 for e in (*analysis.parameters, *analysis.choices)})
        except (LookupError, ValueError) as error:
            raise ModelError(
                f"the sentence of a Rule refers to {error}, which is not a parameter", rule.broken.location
            ) from None
    if analysis.model.method not in ("", *METHODS):
        raise ModelError(
            f"method = {analysis.model.method!r} is unknown; available methods: {', '.join(METHODS)}", location
        )
    for word, limit in ("stop_time", inf), ("step_size", inf), ("tolerance", 1.0):
        value = getattr(analysis.model, word)
        if not is_number(value) or not 0.0 < value < limit:
            raise ModelError(
                f"{word} = {describe(value)} is invalid: it must be a number above 0 and below {limit:g}", location
            )
    if analysis.model.step_size > analysis.model.stop_time:
        raise ModelError(
            f"step_size = {analysis.model.step_size!r} s is longer than the default run: set it to at most "
            f"stop_time = {analysis.model.stop_time!r} s",
            location,
        )
    if not isinstance(analysis.model.__doc__, str) or not analysis.model.__doc__.strip():
        raise ModelError(
            f"{analysis.name} has no docstring: its first line becomes the description of the FMU, the rest its page",
            location,
        )
    _check_printable(analysis.name, location, analysis.model.__doc__.replace("\n", " "))


def _check_choices(e: Variable, parts: list[Operand]) -> None:
    """Check that an expression, given by its parts, does not calculate with the number of a Choice."""
    for term in parts:
        for choice in (*(term.args if isinstance(term, Term) and term.op != "==" else ()), parts[-1]):
            if isinstance(choice, Choice):
                cases = ", ".join(f"{label}=..." for label, _, _ in choice.items)
                raise ModelError(
                    f"{e.name} calculates with the Choice {choice.name}: write {choice.name}.choose({cases})",
                    e.location,
                )


def _check_variable(analysis: ModelRoles, e: Variable) -> None:
    """Check types of texts and numbers, and the range of the start value."""
    if not e.text:
        raise ModelError(f"{e.name} has an empty description: write a text", e.location)
    _check_printable(e.name, e.location, e.text, *(sentence for _, _, sentence in e.items))
    numbers = {name: vars(e)[name] for name, option in OPTIONS.items() if option.type is float and name in vars(e)}
    for word, value in {"start": e.start, **numbers}.items():
        if not is_number(value) or (isinstance(value, int) and abs(value) > LARGEST_FLOAT):
            description = "an expression" if isinstance(value, Expression) else describe(value)
            raise ModelError(f"{word} of {e.name} must be a number, got {description}", e.location)
    if not max(e.low, e.above) <= min(e.high, e.below):
        raise ModelError(f"{e.label} has an empty range: no number is {e.allowed_range}", e.location)
    if isinstance(e, Contact) and is_among(e.slip, analysis.positions):
        raise ModelError(
            f"slip of {e.name} is {e.slip.name}, but a slip is a speed: write slip={analysis.rate[e.slip].name}",
            e.location,
        )
    if isinstance(e, SettableVariable) and not e.accepts(e.start):
        raise ModelError(f"{e.label} has the start value {e.start!r}; it must be {e.allowed_range}", e.location)


def _check_printable(name: str, location: tuple[str, int], *words: str) -> None:
    """Check that texts are printable, because they go into XML, HTML and C."""
    for text in words:
        if not isinstance(text, str) or not text.isprintable():
            raise ModelError(f"{name}: {text!r} must be printable text on one line", location)


def check_use(analysis: ModelRoles) -> None:
    """Raise ModelError for a parameter, choice or input that no equation and no rule reads."""
    used_operands: dict[int, Operand] = {}
    for part in (
        *(rule.broken for rule in analysis.rules),
        *(expression for e in analysis.variables for expression in analysis.declared_expressions(e)),
    ):
        subexpressions(part, used_operands)
    used_operands |= {id(table): table for table in analysis.tables if table.is_called}
    for e in (*analysis.parameters, *analysis.choices, *analysis.inputs, *analysis.tables):
        if id(e) not in used_operands:
            raise ModelError(f"no equation uses {e.name}: use it, or remove its declaration", e.location)
