"""Generates model.h: the numerics of a model and of its FMI calls, its variables and the messages."""

import inspect
from collections.abc import Collection, Mapping, Sequence
from string import Formatter
from typing import Any

from ...compiler.c.c_types import BOOL, FLOAT, INT, CType, StructPointer, c_literal
from ...compiler.c.call_graph import CallGraph
from ...compiler.lowering import component_name, model_exchange_run, sibling_module
from ...compiler.text_output import c_comment, c_string_literal
from ...runtime import codes
from ...runtime.codes import INTERRUPTED
from ...runtime.failure_handling import lacks_value_after_failure
from ...runtime.messages import CALL_MESSAGES, INCONSISTENT_RATE, PHASE_NAMES, RUN_MESSAGES, VALUE_MESSAGES
from ...runtime.variable_access import SETTABLE_CAUSALITIES
from ...runtime.variable_declarations import VariableDeclaration, VariableOwner, exported_name
from ..fmi_variables import (
    CONDITION,
    DERIVATIVE_NAME,
    TIME,
    TO_BREAK_AWAY,
    TO_REST,
    all_variables,
    declared_variables,
    derivative_indices,
    event_indicator_indices,
    interpolated_inputs,
)
from .directional_derivative import Tangent, build_tangent_functions, tangent_fields

# Filled by str.format.  Jinja2 would save the doubled braces, but its {{ begins nested initializers in C, and the rows
# and cases would still come from functions.
HEADER = """\
/* {sentence}
 *
 * Generated from {file}.py and the runtime of friction-fmus: structs of the model and the objects it owns, its
 * numerics, the sequence of FMI calls, the variables and the messages.
 */
#ifndef MODEL_H
#define MODEL_H

#include "guid.h"
#include "python_arithmetic.h"
#include "text_buffer.h"
#include "variable.h"

#define MODEL_NAME "{name}"

enum {{
{codes}}};

{numerics}
typedef struct {name} Model;
typedef struct {run_class} Run;

enum {{ VARIABLES = {count}, DECLARED = {declared}, T_NEXT = {ahead}, STATES = {states}, INDICATORS = {indicators} }};

enum {{ DISCRETE = {count_of_discrete} }};

/* Value references of the discrete variables. */
static const uint32_t discrete_variables[DISCRETE] = {{{discrete}}};

/* The state of an instance, which getting and setting FMU states copies. */
typedef struct {{
    Model model;
    Run run;
    double discrete_values[DISCRETE]; /* where they may not change (FMI 3.0) */
}} State;

{items}
static const Variable variables[VARIABLES] = {{
{table}}};

static const State initial = {{
    .model = {image},
    .run = {run},
}};

enum {{ MEMBERS = {count_of_members} }};

static const Member members[MEMBERS] = {{
{members}}};

/* The time as the importer counts it; the solver counts from the start of the run. */
static double current_time(const Run *run)
{{
    return run->solver.start_time + run->solver.t;
}}

/* Append why the run cannot continue, in a communication step of size h from t. */
static COLD void append_run_message(TextBuffer *text, int64_t status,
                                    const Run *run, const Model *model, double t, double h)
{{
    (void)model; /* where no rule has values of the model */
    switch (status) {{
{statuses}    }}
}}

/* Index, from 1, of an input that jumps again and again against its rate; 0 if there is none. */
static int64_t inconsistent_input(const Model *model)
{{
    (void)model; /* where no input has a rate */
    return {inconsistent_input};
}}

/* Append the warning about this input. */
static COLD void append_inconsistent_rate(TextBuffer *text, const Run *run, const Model *model)
{{
    (void)text, (void)run;
    switch (inconsistent_input(model)) {{
{rates}    }}
}}

/* Append why a variable cannot be set to a value. */
static COLD void append_value_message(TextBuffer *text, int64_t reason, const Variable *variable, double value)
{{
    switch (reason) {{
{values}    }}
}}

enum {{ PHASES = {count_of_phases} }};

static const char *const phases[PHASES] = {{{phases}}};

/* Append why a call is refused. */
static COLD void append_call_message(TextBuffer *text, int64_t reason, const Call *call)
{{
    switch (reason) {{
{calls}    }}
}}

#endif
"""
FIELD_CODE = {  # field of a message -> C call that appends it
    **{name: f"append_real(text, {name})" for name in ("t", "h")},
    **{name: f"append_real(text, run->{name}_time)" for name in ("start", "stop")},
    **{"now": "append_real(text, current_time(run))"},
    "t0": "append_real(text, run->solver.start_time + run->solver.step.t0)",
    "value": "append_value(text, variable, value)",
    **{name: f"append(text, variable->{name})" for name in ("name", "unit", "text", "allowed")},
    **{name: f"append(text, call->{name})" for name in ("function", "word", "phase")},
    "reference": "append_integer(text, call->reference)",
}
PYTHON_ONLY_STATUSES = (INTERRUPTED,)  # only the Python FMU has these
DERIVATIVE_ATTRIBUTES = (
    "rate",
    "polynomial.order",
    "polynomial.derivatives",
)  # attributes of an input with derivatives


def render_model_header(model: Any, fmi: str) -> str:
    """Return the text of model.h for a version of FMI."""
    instance, run = model_exchange_run(model)
    declarations = all_variables(model)
    tangent, tangent_functions = build_tangent_functions(model, declarations)
    call_graph = CallGraph(instance, run, tangent)
    for function_name, propagate in tangent_functions.items():
        call_graph.add_model_entry_point(
            function_name, propagate, StructPointer(type(run.solver)), StructPointer(Tangent)
        )
    for function, arg_types in entry_point_types(model, StructPointer(type(run)), call_graph.layout.model, fmi).items():
        call_graph.add_entry_point(function, arg_types)
    layout = call_graph.layout
    names, interpolated_names = [name for name, _ in declarations], interpolated_inputs(model)
    roots = [("run", type(run)), ("model", type(instance))]
    members = [(path, ctype) for prefix, cls in roots for path, ctype in layout.iter_scalars(cls, f"{prefix}.")]
    members = [(path, ctype) for path, ctype in members if ctype in (INT, BOOL)]
    statuses = {status: message for status, message in RUN_MESSAGES.items() if status not in PYTHON_ONLY_STATUSES}
    discrete = [i for i, (_, meaning) in enumerate(declarations) if meaning.variability == "discrete"]
    rule_fields = {
        name: f"{'append_real' if ctype is FLOAT else 'append_integer'}(text, model->{name})"
        for name, ctype in layout.fields[type(instance)].items()
    } | {"violation_time": "append_real(text, run->solver.start_time + model->violation_time)"}
    return HEADER.format(
        sentence=c_comment((inspect.getdoc(model) or "").splitlines()[0]),
        name=model.__name__,
        run_class=type(run).__name__,
        file=model.__module__.rsplit(".", 1)[-1],
        codes="".join(f"    {name} = {code},\n" for name, code in vars(codes).items() if isinstance(code, int)),
        numerics=call_graph.text(),
        run=layout.initializer(run, "        "),
        image=layout.initializer(instance, "        "),
        items="".join(_items_array(name, meaning) for name, meaning in declarations if meaning.items),
        count=len(names),
        declared=len(declared_variables(model)),
        ahead=names.index("solver.t_next"),
        states=len(derivative_indices(declarations)),
        indicators=len(event_indicator_indices(declarations)),
        discrete=", ".join(map(str, discrete)),
        count_of_discrete=len(discrete),
        count_of_members=len(members),
        members="".join(f"    {{offsetof(State, {path}), {c_literal(ctype is BOOL)}}},\n" for path, ctype in members),
        table="".join(
            _variable_row(
                name,
                meaning,
                attribute_path(model, name),
                tangent_fields(declarations),
                derivative_attributes(instance, name, interpolated_names),
            )
            for name, meaning in declarations
        ),
        statuses=_switch_cases(statuses, FIELD_CODE) + _switch_cases(instance.rules, rule_fields),
        inconsistent_input="model->inconsistent_input" if model.counts_jumps else "0",
        rates=_switch_cases(rate_warnings(model.prescribed_inputs), FIELD_CODE),
        values=_switch_cases(VALUE_MESSAGES, FIELD_CODE),
        calls=_switch_cases(CALL_MESSAGES, FIELD_CODE),
        phases=", ".join(c_string_literal(PHASE_NAMES[phase]) for phase in range(len(PHASE_NAMES))),
        count_of_phases=len(PHASE_NAMES),
    )


def derivative_attributes(instance: VariableOwner, name: str, interpolated_names: Collection[str]) -> tuple[str, ...]:
    """Return those of DERIVATIVE_ATTRIBUTES that a variable has: the last one if the importer may set derivatives."""
    if not hasattr(instance, f"{name}_polynomial"):
        return ()
    return DERIVATIVE_ATTRIBUTES if name in interpolated_names else DERIVATIVE_ATTRIBUTES[:-1]


def rate_warnings(prescribed_inputs: Sequence[tuple[str, str]]) -> dict[int, str]:
    """Return the warning about each input that may jump against its rate, by its index from 1."""
    return {
        n: INCONSISTENT_RATE.replace("{name}", name).replace("{rate}", rate)
        for n, (name, rate) in enumerate(prescribed_inputs, 1)
    }


def attribute_path(model: Any, name: str) -> str:
    """Return the path of a variable in State."""
    if name == TIME:
        return "run.model_exchange.time"
    for indicator in (TO_REST, TO_BREAK_AWAY):
        if name.startswith(indicator):
            mode = name.removeprefix(indicator)[1:] or next(iter(model.contacts))  # no name for a single contact
            return component_name(indicator.replace("events", "run.model_exchange", 1), mode)
    if name.startswith(CONDITION[:-2]):
        return f"run.model_exchange.conditions[{int(name.removeprefix(CONDITION[:-2])) - 1}]"
    if name.startswith(DERIVATIVE_NAME[:4]):
        return "run.model_exchange.driver_rate"
    return f"run.{name}" if "." in name else f"model.{name}"


def _items_array(name: str, meaning: VariableDeclaration) -> str:
    """Return the C array with the values of an enumeration."""
    values = ", ".join(str(value) for _, value, _ in meaning.items)
    return f"static const int64_t {_items_array_name(name)}[] = {{{values}}};\n"


def _items_array_name(name: str) -> str:
    return f"items_of_{name.replace('.', '_')}"


def _variable_row(
    name: str,
    meaning: VariableDeclaration,
    path: str,
    tangent_fields: dict[str, str],
    derivatives: Collection[str],
) -> str:
    """Return the table row of a variable; `derivatives` are those of DERIVATIVE_ATTRIBUTES that it has."""
    texts = (exported_name(name, meaning), meaning.text, meaning.unit_suffix, meaning.allowed_range)
    flags = (
        meaning.type == "Real",
        meaning.is_integer,
        meaning.causality not in SETTABLE_CAUSALITIES,
        meaning.variability == "fixed",
        lacks_value_after_failure(meaning),
        "." in name,
        meaning.role == "state" or meaning.causality == "input",
        meaning.type == "Real" and meaning.causality == "parameter",
    )
    bounds = (meaning.low, meaning.high, meaning.above, meaning.below)
    items = (
        f"{_items_array_name(name)}, {_items_array_name(name)} + {len(meaning.items)}"
        if meaning.items
        else "NULL, NULL"
    )
    parts = [
        *map(c_string_literal, texts),
        f"offsetof(State, {path})",
        f"offsetof(struct Tangent, {tangent_fields[name]})" if name in tangent_fields else "NO_OFFSET",
        *map(c_literal, flags),
        ", ".join(
            f"offsetof(State, model.{name}_{part})" if part in derivatives else "NO_OFFSET"
            for part in DERIVATIVE_ATTRIBUTES
        ),
        *(c_literal(float(bound)) for bound in bounds),
        items,
    ]
    return f"    {{{', '.join(parts)}}},\n"


def _switch_cases(messages: Mapping[int, str], field_code: Mapping[str, str]) -> str:
    """Return the cases of a switch over messages with fields."""
    lines = []
    for case, message in messages.items():
        lines.append(f"    case {case}:\n")
        for literal_text, field, _, _ in Formatter().parse(message):
            if literal_text:
                lines.append(f"        append(text, {c_string_literal(literal_text)});\n")
            if field:
                lines.append(f"        {field_code[field]};\n")
        lines.append("        break;\n")
    return "".join(lines)


ENTRY_POINTS = {  # module of the runtime -> its functions; callees come before their callers
    "variable_declarations": ("is_in_range",),
    "call_sequence": (
        *("rejection_reason", "note_change", "set_experiment", "check_experiment", "is_refusal"),
        *("exit_initialization", "do_step", "update_outputs", "update_statistics"),
    ),
    "model_exchange": (
        *("enable", "update_nominals", "begin", "prepare", "set_time", "set_continuous_states", "update_states"),
        *("update_rates", "update_input_rates", "update_indicators", "update_variables", "has_step_event"),
        *("complete_step", "handle_event"),
    ),
    "early_return": ("begin_step", "next_internal_step", "end_step", "complete_event"),  # for FMI 3.0
}
# Parameters of type bool; run and model are structs, a status is an int, all others are floats.
BOOL_PARAMETERS = ("is_calculated", "is_fixed", "is_allowed", "ahead", "defer_events")


def entry_point_types(
    model: type[VariableOwner], run: StructPointer, instance: StructPointer, fmi: str
) -> dict[Any, list[CType]]:
    """Return the entry points of a model with the types of their arguments, which follow from the parameter names."""
    known_types: dict[str, CType] = {"run": run, "model": instance, "status": INT}
    known_types |= dict.fromkeys(BOOL_PARAMETERS, BOOL)
    types = {}
    for file in [file for file in ENTRY_POINTS if file != "early_return" or fmi == "3"]:
        functions = sibling_module(model, f"runtime.{file}")
        for name in ENTRY_POINTS[file]:
            code = getattr(functions, name).__code__
            parameters = code.co_varnames[: code.co_argcount]
            types[getattr(functions, name)] = [known_types.get(parameter, FLOAT) for parameter in parameters]
    return types
