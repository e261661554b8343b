"""Generates the source of a scalar model class, which is embedded in Python FMUs and translated to C."""

import ast
from inspect import cleandoc
from json import dumps
from textwrap import indent, wrap

from ...runtime.active_method import EXACT_ITEM
from ...runtime.contact_lcp import CoupledFriction
from ...runtime.oscillator import Oscillator
from ...runtime.planar_contact import PlanarFriction
from ...runtime.stick_slip import DryFriction
from ...runtime.variable_declarations import VariableDeclaration
from ..text_output import string_literal
from .algebra import depends_on, has_condition_on, variables_in
from .codegen_context import CodegenContext, rule_status
from .contact_methods import coupled_contact_methods, single_contact_methods
from .dimensions import DIMENSIONLESS, Dimensions, declared_dimensions, dimensions_of, expression_text
from .expression_printer import INDENT
from .expressions import is_among
from .model_analysis import ModelAnalysis
from .model_conditions import Condition
from .model_declaration import OPTIONS, Contact, Input, Mode, Output, State, Variable
from .output_methods import condition_methods, law_modes_method, observe_method
from .rate_methods import rate_methods
from .reserved_names import IMPORTS, MATH
from .setup_methods import setup_methods
from .tables import EDGE, VARIABLE_KINDS, array_name, table_of

MODULE_TEMPLATE = '''"""{first}

Generated from the equations in {file}; edit that file instead.
"""

{import_lines}


class Solver(Integrator):
    method = Enumeration({method}, "integration method", {items})


class {name}({base_class}):
    """{docstring}"""

{declaration_lines}

{class_attribute_lines}

{methods}
'''
IMPORTS_MARK = "\0"  # marks the place of the imports; model texts cannot contain it
WIDTH = 105
DECLARED_ATTRIBUTES = (
    *("start", *OPTIONS, "causality", "variability", "type", "is_integer"),
    *("role", "direct", "rate_of", "rate", "element"),
)
RUN_SETTINGS = ("stop_time", "step_size", "tolerance")


def model_source(analysis: ModelAnalysis, file: str) -> str:
    """Return the source of the module."""
    context = CodegenContext(analysis)
    first, _, remainder = escape_docstring(cleandoc(analysis.model.__doc__ or "")).partition("\n")
    docstring = indent(f"{first}\n{remainder}" + ("\n" if remainder else ""), INDENT).strip(" ")
    text = MODULE_TEMPLATE.format(
        first=first,
        file=file,
        import_lines=IMPORTS_MARK,
        method="EXACT" if analysis.method == EXACT_ITEM[0] else f"{analysis.method}.NUMBER",
        items="(EXACT_ITEM, *METHOD_ITEMS)" if analysis.closed_form else "METHOD_ITEMS",
        name=analysis.name,
        base_class=base_class(analysis).__name__,
        docstring=docstring.rstrip(" ") + (INDENT if remainder else ""),
        declaration_lines=indent("\n".join(declaration_lines(analysis)), INDENT),
        class_attribute_lines=indent("\n".join(class_attribute_lines(analysis)), INDENT),
        methods="\n\n".join(
            [
                *setup_methods(context),
                *rate_methods(context),
                *single_contact_methods(context),
                *coupled_contact_methods(context),
                *condition_methods(context),
                *law_modes_method(context),
                observe_method(context),
            ]
        ),
    )
    head = "\n".join([import_lines(text.replace(IMPORTS_MARK, "")), *table_lines(analysis)])
    return text.replace(IMPORTS_MARK, head)


def table_lines(analysis: ModelAnalysis) -> list[str]:
    """Return the lines with the arrays of the tables; empty without tables."""
    arrays = {
        array_name(table, kind): column
        for table in analysis.tables
        for kind, column in ((EDGE, table.edges), *table.columns.items())
        if not (table.parameters and kind in VARIABLE_KINDS)
    }
    return ["", *(f"{name} = {column!r}" for name, column in arrays.items())] if arrays else []


def base_class(analysis: ModelAnalysis) -> type[Oscillator]:
    """Return the runtime base class of the model."""
    if analysis.planar_contacts:
        return PlanarFriction
    return DryFriction if analysis.rests_when_stuck else CoupledFriction if analysis.contacts else Oscillator


def rates_of_states(analysis: ModelAnalysis) -> dict[str, str]:
    """Return the rate of each state, which may be a state."""
    return {s.name: analysis.rate[s].name for s in analysis.states}


def slips_of_contacts(analysis: ModelAnalysis) -> dict[str, str]:
    """Return the state that is the slip of each contact, by its mode; an empty text for an expression."""
    return {c.mode.name: c.slip.name if analysis.rests_when_stuck else "" for c in analysis.contacts}


def flags(analysis: ModelAnalysis) -> dict[str, bool]:
    """Return the flags of the model class, apart from those of its base class."""
    varying_symbols = (*analysis.time_varying, *analysis.input_rates)
    return {
        "is_linear": bool(analysis.closed_form),
        "has_other_laws": bool(analysis.laws[1:]),
        "has_driver": bool(analysis.drivers),
        "has_input_derivatives": bool(analysis.input_rates),
        "counts_jumps": any(depends_on(e.declared_rate, analysis.inputs) for e in analysis.prescribed_inputs),
        "has_prescribed_slips": analysis.has_prescribed_slips,
        "has_conditions": bool(analysis.conditions),
        "has_pieces": analysis.has_pieces,
        "checks_event_steps": analysis.checks_event_steps,
        "has_nominal_velocity": any(s.nominal_velocity is not None for s in (*analysis.states, *analysis.drivers)),
        "has_variable_levers": bool(not analysis.rests_when_stuck and analysis.variable_lever_contacts),
        "has_slip_conditions": any(has_condition_on(c.slip, varying_symbols) for c in analysis.contacts),
    }


def import_lines(text: str) -> str:
    """Return the import lines for all names used in the text."""
    used_names = {node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)}
    lines = [f"from math import {', '.join(names)}\n"] if (names := sorted(used_names & set(MATH))) else []
    for module, available in IMPORTS.items():
        if names := [name for name in available if name in used_names]:
            lines.append(f"from {f'.runtime.{module}'.rstrip('.')} import {', '.join(names)}")
    return "\n".join(lines)


def declaration_lines(analysis: ModelAnalysis) -> list[str]:
    """Declare the variables in the order of the model description."""
    lines = [f"{e.name} = {declaration(e)}" for e in analysis.parameters]
    if analysis.laws:
        items = ", ".join(f"{law.upper()}_LAW" for law in analysis.laws)
        lines.append(
            f'friction = Enumeration(HYBRID, "friction law", ({items}{"," if len(analysis.laws) == 1 else ""}))'
        )
    for e in analysis.choices:
        items = ", ".join(
            f"({string_literal(label)}, {value}, {string_literal(sentence)})" for label, value, sentence in e.items
        )
        lines.append(f"{e.name} = Enumeration({e.start}, {string_literal(e.text)}, ({items},))")
    lines += [f"{e.name} = {declaration(e)}" for e in analysis.inputs]
    return lines + [f"{e.name} = {output_declaration(analysis, e)}" for e in analysis.ordered_outputs]


def output_declaration(analysis: ModelAnalysis, e: Variable) -> str:
    """Return the declaration of a calculated variable."""
    options: dict[str, object] = {}
    if isinstance(e, (State, Output)) and e.integrates is not None:
        options["rate_of"] = e.integrates.name
    if isinstance(e, State) and is_among(e, analysis.drivers):
        options["rate"] = e.constant_rate.name
    if isinstance(e, (Contact, Mode)) or (isinstance(e, Output) and analysis.has_direct_feedthrough(e)):
        options["direct"] = True
    return declaration(e, **options)


def declaration(e: Variable, **overrides: object) -> str:
    """Return the declaration of a variable, with the attributes that differ from their defaults."""
    texts = [string_literal(e.unit), string_literal(e.text)]
    for name in DECLARED_ATTRIBUTES:
        value, default = overrides.get(name, getattr(e, name)), getattr(VariableDeclaration, name)
        if not e.is_integer and (name == "start" or name in OPTIONS):  # a number of numpy as one of Python
            value = float(e.start) if name == "start" else OPTIONS[name].type(value)
        if repr(value) != repr(default):
            texts.append(f"{name}={string_literal(value) if isinstance(value, str) else repr(value)}")
    return f"VariableDeclaration({', '.join(texts)})"


def class_attribute_lines(analysis: ModelAnalysis) -> list[str]:
    """Return the class attributes that the runtime reads."""
    lines = ["solver_class = Solver", f"states = {dumps(rates_of_states(analysis))}"]
    if analysis.contacts:
        lines.append(f"contacts = {dumps(slips_of_contacts(analysis))}")
    if analysis.planar_contacts:
        lines.append(f"planar_modes = ({', '.join(string_literal(c.mode.name) for c in analysis.planar_contacts)},)")
    if analysis.angles:
        lines.append(f"angles = ({', '.join(string_literal(s.name) for s in analysis.angles)},)")
    lines += [f"{flag} = True" for flag, is_set in flags(analysis).items() if is_set]
    if n := 2 * len(analysis.contacts) + len(analysis.conditions):
        numbers = f"{n}, {2 * len(analysis.contacts)}, {len(analysis.switches)}"
        lines.append(f"n_event_functions, first_condition, n_switches = {numbers}")
    if analysis.prescribed_inputs:
        pairs = ", ".join(
            f"({string_literal(e.name)}, {string_literal(rate_names(e))})" for e in analysis.prescribed_inputs
        )
        lines.append(f"prescribed_inputs = ({pairs},)")
    if analysis.conditions:
        memo: dict[int, Dimensions | None] = {}
        units = [condition_unit(analysis, condition, memo) for condition in analysis.conditions]
        lines.append(f"condition_texts = ({', '.join(map(string_literal, condition_texts(analysis)))},)")
        lines.append(f"condition_units = ({', '.join(map(string_literal, units))},)")
    if analysis.limits:
        lines.append(f"first_limit_rule = {rule_status(len(analysis.rules))}")
    for attribute in RUN_SETTINGS:
        if (value := float(getattr(analysis.model, attribute))) != getattr(Oscillator, attribute):
            lines.append(f"{attribute} = {value!r}")
    if analysis.rules or analysis.limits:
        inherited_rules = [f"{INDENT}**{base_class(analysis).__name__}.rules,"] if analysis.contacts else []
        messages = [rule.sentence for rule in analysis.rules] + [limit.sentence for limit in analysis.limits]
        sentences = [f"{INDENT}{rule_status(n)}: {string_lines(message)}," for n, message in enumerate(messages)]
        lines += ["rules = {", *inherited_rules, *sentences, "}"]
    return lines


def rate_names(e: Input) -> str:
    """Return the names of the inputs in the declared rate of an input; the rate itself if there are none."""
    inputs = [variable.name for variable in variables_in(e.declared_rate) if isinstance(variable, Input)]
    return " and ".join(inputs) or expression_text(e.declared_rate)


def condition_texts(analysis: ModelAnalysis) -> list[str]:
    """Return what changes where the event function of a condition falls to zero."""
    switches = [
        f"{expression_text(condition.comparisons[0])} changes"
        if condition.piece is None
        else f"{expression_text(condition.piece.args[0])} reaches a point of {table_of(condition.piece)}"
        for condition in analysis.switches
    ]
    return switches + [condition.sentence.partition(" at t =")[0] for condition in analysis.limits]


def condition_unit(analysis: ModelAnalysis, condition: Condition, memo: dict[int, Dimensions | None]) -> str:
    """Return the unit of the margin of a condition: that of one side, or of any variable with the same dimensions.

    A dimensionless margin has the unit 1 unless one side is a variable, as it can be an angle or a ratio.
    """
    dimensions = next((d for e in condition.sides if (d := dimensions_of(e, memo)) is not None), DIMENSIONLESS)
    variables = [e for e in condition.sides if isinstance(e, Variable)]
    if dimensions != DIMENSIONLESS:
        variables += analysis.variables
    return next((e.unit for e in variables if declared_dimensions(e) == dimensions), "1")


def string_lines(text: str) -> str:
    """Return a string literal, split over several lines if long."""
    lines = wrap(text, WIDTH, drop_whitespace=False)
    return string_literal(text) if len(lines) == 1 else f"\n{INDENT}".join(map(string_literal, lines))


def escape_docstring(text: str) -> str:
    """Escape a text for a triple-quoted string."""
    text = text.replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    return f'{text[:-1]}\\"' if text.endswith('"') else text
