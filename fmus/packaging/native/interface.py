"""The C header of one model: its numerics, the rules, its declared variables, the sentences."""

import inspect
from collections.abc import Mapping
from string import Formatter

from ...runtime import codes
from ...runtime.codes import FIRST_RULE, INTERRUPTED
from ...runtime.failure_handling import CALCULATED_CAUSALITIES
from ...runtime.messages import CALL_MESSAGES, PHASE_NAMES, RUN_MESSAGES, VALUE_MESSAGES
from ...runtime.variable_access import SETTABLE_CAUSALITIES
from ...runtime.variable_declarations import VariableDeclaration, VariableOwner, variables
from ..fmi_variables import (
    all_variables,
    attribute_path,
    derivative_indices,
    event_indicator_indices,
    model_exchange_instance,
)
from ..lowering import sibling_module
from ..reserved_names import string_literal
from .entries import entries
from .kinds import BOOL, FLOAT, INT, Object, literal
from .program import Program
from .tangent import Tangent, slots, tangent

HEADER = """\
/* {sentence}
 *
 * Frozen from {file}.py and the runtime of friction-fmus: structs for the model and what it owns, its numerics, the
 * rules of its run, its declared variables and all that is said.
 */
#ifndef MODEL_H
#define MODEL_H

#include "guid.h"
#include "numerics.h"
#include "text.h"
#include "variable.h"

#define MODEL_NAME "{name}"

enum {{
{codes}}};

{numerics}
typedef struct {name} Model;

{items}
enum {{ VARIABLES = {count}, DECLARED = {declared}, T_NEXT = {ahead}, STATES = {states}, INDICATORS = {indicators} }};

static const Variable variables[VARIABLES] = {{
{table}}};

/* What of an instance makes its run. */
typedef struct {{
    Model model;
    struct RunState run;
    int64_t turns; /* how many values were refused so far */
    Refusal refused[VARIABLES];
}} State;

static const State initial = {{
    .model = {image},
    .run = {run},
}};

enum {{ MEMBERS = {count_of_members} }};

static const Member members[MEMBERS] = {{
{members}}};

/* Why the run cannot go on, in a communication step of h from t. */
static void tell_status(Text *text, int64_t status, const struct RunState *run, const Model *model, double t, double h)
{{
    switch (status) {{
{statuses}    }}
}}

/* Why a variable cannot be set to a value. */
static void tell_value(Text *text, int64_t reason, const Variable *variable, double value)
{{
    switch (reason) {{
{values}    }}
}}

enum {{ PHASES = {count_of_phases} }};

static const char *const phases[PHASES] = {{{phases}}};

/* Why a call is refused. */
static void tell_call(Text *text, int64_t reason, const Call *call)
{{
    switch (reason) {{
{calls}    }}
}}

#endif
"""
PLACES = {  # field of a sentence -> what adds it to the text
    **{name: f"add_real(text, {name})" for name in ("t", "h")},
    **{name: f"add_real(text, run->{name}_time)" for name in ("start", "stop")},
    **{"now": "add_real(text, model->solver.t)", "t0": "add_real(text, model->solver.step.t0)"},
    **{"t_end": "add_real(text, model->solver.step.t_end)", "value": "add_value(text, variable, value)"},
    **{name: f"add(text, variable->{name})" for name in ("name", "unit", "text", "allowed")},
    **{name: f"add(text, call->{name})" for name in ("function", "word", "phase")},
    "reference": "add_integer(text, call->reference)",
}
ELSEWHERE = (INTERRUPTED,)  # statuses of other kinds
DERIVATIVE_ATTRIBUTES = ("rate", "polynomial.order", "polynomial.derivatives")  # of an input that has derivatives


def header(model: type[VariableOwner], fmi: str) -> str:
    """The text of model.h, for a version of FMI."""
    thing = model_exchange_instance(model)
    run = sibling_module(model, "runtime.call_sequence").RunState(thing.tolerance)
    declared = all_variables(thing)
    to, along = tangent(model, thing, declared)
    program = Program(thing, run, to)
    program.entry("along", along, Object(Tangent))
    for function, kinds in entries(model, Object(type(run)), program.layout.model, fmi).items():
        program.exported(function, kinds)
    layout = program.layout
    names = [name for name, _ in declared]
    numbers = [("run", type(run)), ("model", type(thing))]
    members = [(path, kind) for prefix, cls in numbers for path, kind in layout.scalars(cls, f"{prefix}.")]
    members = [(path, kind) for path, kind in members if kind in (INT, BOOL)]
    statuses = {status: sentence for status, sentence in RUN_MESSAGES.items() if status not in ELSEWHERE}
    broken = dict(enumerate(thing.rules, FIRST_RULE + 1))
    own = {
        name: f"{'add_real' if kind is FLOAT else 'add_integer'}(text, model->{name})"
        for name, kind in layout.fields[type(thing)].items()
    }
    return HEADER.format(
        sentence=(inspect.getdoc(model) or "").splitlines()[0],
        name=model.__name__,
        file=model.__module__.rsplit(".", 1)[-1],
        codes="".join(f"    {name} = {code},\n" for name, code in vars(codes).items() if name.isupper()),
        numerics=program.text(),
        run=layout.image(run, "        "),
        image=layout.image(thing, "        "),
        items="".join(_items(name, meaning) for name, meaning in declared if meaning.items),
        count=len(names),
        declared=len(variables(thing)),
        ahead=names.index("solver.t_next"),
        states=len(derivative_indices(declared)),
        indicators=len(event_indicator_indices(declared)),
        count_of_members=len(members),
        members="".join(f"    {{offsetof(State, {path}), {literal(kind is BOOL)}}},\n" for path, kind in members),
        table="".join(
            _line(name, meaning, slots(declared), hasattr(thing, f"{name}_rate")) for name, meaning in declared
        ),
        statuses=_cases(statuses, PLACES) + _cases(broken, own),
        values=_cases(VALUE_MESSAGES, PLACES),
        calls=_cases(CALL_MESSAGES, PLACES),
        phases=", ".join(string_literal(PHASE_NAMES[phase]) for phase in range(len(PHASE_NAMES))),
        count_of_phases=len(PHASE_NAMES),
    )


def _items(name: str, meaning: VariableDeclaration) -> str:
    values = ", ".join(str(value) for _, value, _ in meaning.items)
    return f"static const int64_t {_of(name)}[] = {{{values}}};\n"


def _of(name: str) -> str:
    return f"items_of_{name.replace('.', '_')}"


def _line(name: str, meaning: VariableDeclaration, slots: dict[str, str], ramps: bool) -> str:
    """One variable in the table."""
    words = (name, meaning.text, meaning.unit_suffix, meaning.allowed)
    flags = (
        meaning.type == "Real",
        meaning.causality not in SETTABLE_CAUSALITIES,
        meaning.variability == "fixed",
        meaning.causality in CALCULATED_CAUSALITIES,
        "." in name,
        meaning.role == "state" or meaning.causality == "input",
    )
    bounds = (meaning.low, meaning.high, meaning.above, meaning.below)
    items = f"{_of(name)}, {_of(name)} + {len(meaning.items)}" if meaning.items else "NULL, NULL"
    parts = [
        *map(string_literal, words),
        f"offsetof(Model, {attribute_path(name)})",
        f"offsetof(struct Tangent, {slots[name]})" if name in slots else "NO_SLOPE",
        *map(literal, flags),
        ", ".join(f"offsetof(Model, {name}_{part})" if ramps else "NO_SLOPE" for part in DERIVATIVE_ATTRIBUTES),
        *(literal(float(bound)) for bound in bounds),
        items,
    ]
    return f"    {{{', '.join(parts)}}},\n"


def _cases(sentences: Mapping[int, str], places: Mapping[str, str]) -> str:
    """The cases of a switch over sentences with fields in them."""
    lines = []
    for case, sentence in sentences.items():
        lines.append(f"    case {case}:\n")
        for words, field, _, _ in Formatter().parse(sentence):
            if words:
                lines.append(f"        add(text, {string_literal(words)});\n")
            if field:
                lines.append(f"        {places[field]};\n")
        lines.append("        break;\n")
    return "".join(lines)
