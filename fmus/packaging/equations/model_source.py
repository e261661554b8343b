"""Generates the source of a scalar model class, which is embedded in Python FMUs and translated to C."""

import ast
from inspect import cleandoc, signature
from textwrap import indent, wrap

from ...runtime.active_method import EXACT_ITEM
from ...runtime.oscillator import Oscillator
from ...runtime.variable_declarations import VariableDeclaration
from ..text_output import string_literal
from .codegen_context import CodegenContext, rule_status
from .conditions import Condition
from .coupled_contact_methods import coupled_contact_methods
from .dimensions import DIMENSIONLESS, Dimensions, declared_dimensions, dimensions_of, expression_text
from .expression_printer import INDENT
from .expressions import is_among
from .model_analysis import ModelAnalysis
from .model_declaration import Contact, Fixed, Mode, Output, State, Variable
from .output_methods import condition_methods, law_modes_method, observe_method
from .rate_methods import rate_methods
from .reserved_names import IMPORTS, MATH
from .setup_methods import setup_methods
from .single_contact_methods import single_contact_methods

MODULE_TEMPLATE = '''"""{first}

Generated from the equations in {file}; edit that file instead.
"""

{import_lines}


class Solver(Integrator):
    method = Choice({method}, "integration method", {items})


class {name}({base_class}):
    """{about}"""

{declaration_lines}

{class_attribute_lines}

{methods}
'''
IMPORTS_MARK = "\0"  # marks the place of the imports; model texts cannot contain it
WIDTH = 105
DECLARATION_OPTIONS = {
    parameter.name: parameter.default
    for parameter in signature(VariableDeclaration.__init__).parameters.values()
    if parameter.default is not parameter.empty
}
RUN_SETTINGS = ("stop_time", "step_size", "tolerance")


def model_source(an: ModelAnalysis, file: str) -> str:
    """Return the source of the module."""
    f = CodegenContext(an)
    first, _, rest = escape_docstring(cleandoc(an.model.__doc__ or "")).partition("\n")
    about = indent(f"{first}\n{rest}" + ("\n" if rest else ""), INDENT).strip(" ")
    text = MODULE_TEMPLATE.format(
        first=first,
        file=file,
        import_lines=IMPORTS_MARK,
        method="EXACT" if an.method == EXACT_ITEM[0] else f"{an.method}.NUMBER",
        items="(EXACT_ITEM, *METHOD_ITEMS)" if an.closed_form else "METHOD_ITEMS",
        name=an.name,
        base_class=base_class(an),
        about=about.rstrip(" ") + (INDENT if rest else ""),
        declaration_lines=indent("\n".join(declaration_lines(an)), INDENT),
        class_attribute_lines=indent("\n".join(class_attribute_lines(an)), INDENT),
        methods="\n\n".join(
            [
                *setup_methods(f),
                *rate_methods(f),
                *single_contact_methods(f),
                *coupled_contact_methods(f),
                *condition_methods(f),
                *law_modes_method(f),
                observe_method(f),
            ]
        ),
    )
    return text.replace(IMPORTS_MARK, import_lines(text.replace(IMPORTS_MARK, "")))


def base_class(an: ModelAnalysis) -> str:
    """Return the runtime base class of the model."""
    return "DryFriction" if an.waits else "CoupledFriction" if an.contacts else "Oscillator"


def import_lines(text: str) -> str:
    """Return the import lines for all names used in the text."""
    used = {node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)}
    lines = [f"from math import {', '.join(names)}\n"] if (names := sorted(used & set(MATH))) else []
    for module, available in IMPORTS.items():
        if names := [name for name in available if name in used]:
            lines.append(f"from {f'.runtime.{module}'.rstrip('.')} import {', '.join(names)}")
    return "\n".join(lines)


def declaration_lines(an: ModelAnalysis) -> list[str]:
    """Declare the variables in the order of the model description."""
    lines = [
        f"{e.name} = {'Fixed' if isinstance(e, Fixed) else 'Parameter'}({float(e.start)!r}, {declaration_arguments(e)})"
        for e in an.parameters
    ]
    if an.laws:
        items = ", ".join(f"{law.upper()}_LAW" for law in an.laws)
        lines.append(f'friction = Choice(HYBRID, "friction law", ({items}{"," if len(an.laws) == 1 else ""}))')
    for e in an.choices:
        items = ", ".join(
            f"({string_literal(label)}, {value}, {string_literal(sentence)})" for label, value, sentence in e.items
        )
        lines.append(f"{e.name} = Choice({e.start}, {string_literal(e.text)}, ({items},))")
    lines += [f"{e.name} = Input({float(e.start)!r}, {declaration_arguments(e)})" for e in an.inputs]
    return lines + [f"{e.name} = {output_declaration(an, e)}" for e in an.ordered_outputs]


def output_declaration(an: ModelAnalysis, e: Variable) -> str:
    """Return the declaration of a calculated variable."""
    if isinstance(e, Mode):
        return f"Mode({string_literal(e.text)})"
    more = (
        f", rate_of={string_literal(e.integrates.name)}"
        if isinstance(e, (State, Output)) and e.integrates is not None
        else ""
    )
    if isinstance(e, State):
        more += f", rate={string_literal(e.constant_rate.name)}" if is_among(e, an.drivers) else ""
        return f"State({declaration_arguments(e)}{more})"
    if isinstance(e, Contact):
        return f"Contact({declaration_arguments(e)})"
    return f"Output({declaration_arguments(e)}{more}{', direct=True' if an.has_direct_feedthrough(e) else ''})"


def declaration_arguments(e: Variable) -> str:
    """Return the arguments unit and description, and the options that differ from their defaults."""
    texts = [string_literal(e.unit), string_literal(e.text)]
    for name, default in DECLARATION_OPTIONS.items():
        if (value := getattr(e, name)) != default:
            texts.append(f"{name}={string_literal(value) if default == '' else repr(type(default)(value))}")
    return ", ".join(texts)


def class_attribute_lines(an: ModelAnalysis) -> list[str]:
    """Return the class attributes that the runtime reads."""
    states = ", ".join(f"{string_literal(s.name)}: {string_literal(an.rate[s].name)}" for s in an.states)
    lines = ["solver_class = Solver", f"states = {{{states}}}"]
    if an.contacts:
        slips = ", ".join(
            f"{string_literal(c.mode.name)}: {string_literal(c.slip.name if an.waits else '')}" for c in an.contacts
        )
        lines.append(f"contacts = {{{slips}}}")
    lines += [
        f"{word} = True"
        for word, holds in (
            ("is_linear", an.closed_form),
            ("has_other_laws", an.laws[1:]),
            ("has_driver", an.drivers),
            ("has_input_derivatives", an.ramps),
            ("has_conditions", an.conditions),
            ("checks_event_steps", an.checks_event_steps),
            ("has_nominal_velocity", any(s.nominal_velocity is not None for s in (*an.states, *an.drivers))),
            ("has_variable_levers", not an.waits and an.variable_lever_contacts),
        )
        if holds
    ]
    if n := n_event_functions(an):
        lines.append(
            f"n_event_functions, first_condition, n_switches = {n}, {2 * len(an.contacts)}, {len(an.switches)}"
        )
    if an.conditions:
        lines.append(f"condition_texts = ({', '.join(map(string_literal, condition_texts(an)))},)")
        lines.append(f"condition_units = ({', '.join(string_literal(condition_unit(an, e)) for e in an.conditions)},)")
    if an.limits:
        lines.append(f"first_limit_rule = {rule_status(len(an.rules))}")
    for word in RUN_SETTINGS:
        if (value := float(getattr(an.model, word))) != getattr(Oscillator, word):
            lines.append(f"{word} = {value!r}")
    if an.rules or an.limits:
        inherited = [f"{INDENT}**{base_class(an)}.rules,"] if an.contacts else []
        messages = [rule.sentence for rule in an.rules] + [limit.sentence for limit in an.limits]
        sentences = [f"{INDENT}{rule_status(n)}: {string_lines(message)}," for n, message in enumerate(messages)]
        lines += ["rules = {", *inherited, *sentences, "}"]
    return lines


def n_event_functions(an: ModelAnalysis) -> int:
    """Return the number of event functions: two for each contact, and one for each condition."""
    return 2 * len(an.contacts) + len(an.conditions)


def condition_texts(an: ModelAnalysis) -> list[str]:
    """Return what changes where the event function of a condition falls to zero."""
    switches = [f"{expression_text(condition.comparisons[0])} changes" for condition in an.switches]
    return switches + [condition.sentence.partition(" at t =")[0] for condition in an.limits]


def condition_unit(an: ModelAnalysis, condition: Condition) -> str:
    """Return the unit of the margin of a condition: that of one side, or of any variable with the same dimensions.

    A dimensionless margin has the unit 1 unless one side is a variable, as it can be an angle or a ratio.
    """
    memo: dict[int, Dimensions | None] = {}
    dimensions = next((d for e in condition.sides if (d := dimensions_of(e, memo)) is not None), DIMENSIONLESS)
    variables = [e for e in condition.sides if isinstance(e, Variable)]
    if dimensions != DIMENSIONLESS:
        variables += an.declared
    return next((e.unit for e in variables if declared_dimensions(e) == dimensions), "1")


def string_lines(text: str) -> str:
    """Return a string literal, split over several lines if long."""
    lines = wrap(text, WIDTH, drop_whitespace=False)
    return string_literal(text) if len(lines) == 1 else f"\n{INDENT}".join(map(string_literal, lines))


def escape_docstring(text: str) -> str:
    """Escape a text for a triple-quoted string."""
    text = text.replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    return f'{text[:-1]}\\"' if text.endswith('"') else text
