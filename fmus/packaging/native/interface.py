"""The C header of one model: its numerics, its declared variables, its sentences."""

import inspect
from string import Formatter
from typing import Any

from ...runtime.codes import DIVERGED, OK
from ...runtime.declare import Declared, Declaring
from ...runtime.hosted import CALCULATED, SENTENCES
from ..description import declared_by
from .entries import ENTRIES
from .kinds import BOOL, FLOAT, INT, Kind, literal
from .program import Program

HEADER = """\
/* {sentence}
 *
 * Frozen from {file}.py and the runtime of friction-fmus: structs for the model and what it owns, its numerics, its
 * declared variables and what is said about them.
 */
#ifndef MODEL_H
#define MODEL_H

#include "guid.h"
#include "numerics.h"
#include "text.h"
#include "variable.h"

#define MODEL_NAME "{name}"
#define TOLERANCE {tolerance}
enum {{ OK = {ok}, DIVERGED = {diverged} }};

{numerics}
typedef struct {name} Model;

static const Model initial = {image};

{items}
enum {{ VARIABLES = {count}, T_NEXT = {ahead} }};

static const Variable variables[VARIABLES] = {{
{table}}};

enum {{ MEMBERS = {count_of_members} }};

static const Member members[MEMBERS] = {{
{members}}};

/* Why the motion ended at t, in a communication step from start on. */
static void tell_failure(int64_t status, double t, double start, Text *text)
{{
{failures}}}

/* The rule that the values break. */
static void tell_rule(const Model *self, int64_t rule, Text *text)
{{
{rules}}}

#endif
"""


class _Gap:
    """Stands for the value in a sentence."""

    def __repr__(self) -> str:
        return "\0"


def header(model: type[Declaring]) -> str:
    """The text of model.h."""
    thing: Any = model()
    program = Program(thing)
    for entry, kinds in ENTRIES.items():
        program.entry(entry.__name__, entry, *kinds)
    declared = declared_by(model)
    names = [name for name, _ in declared]
    fields: dict[str, tuple[Kind, str]] = {
        name: (kind, f"self->{name}") for name, kind in program.layout.fields[model].items()
    }
    members = [(path, kind) for path, kind in program.layout.scalars(model) if kind in (INT, BOOL)]
    rules = dict(enumerate(thing.rules, 1))
    return HEADER.format(
        sentence=(inspect.getdoc(model) or "").splitlines()[0],
        name=model.__name__,
        file=model.__module__.rsplit(".", 1)[-1],
        tolerance=literal(thing.tolerance),
        ok=OK,
        diverged=DIVERGED,
        numerics=program.text(),
        image=program.layout.image(thing),
        items="".join(_items(name, meaning) for name, meaning in declared if meaning.items),
        count=len(names),
        ahead=names.index("solver.t_next"),
        count_of_members=len(members),
        members="".join(f"    {{offsetof(Model, {path}), {literal(kind is BOOL)}}},\n" for path, kind in members),
        table="".join(_row(name, meaning) for name, meaning in declared),
        failures=_told("status", SENTENCES, {name: (FLOAT, name) for name in ("t", "start")}),
        rules=_told("rule", rules, fields),
    )


def _text(words: str) -> str:
    """A string literal of C."""
    return '"' + words.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _items(name: str, meaning: Declared) -> str:
    items: tuple[tuple, ...] = meaning.items
    values = ", ".join(str(value) for _, value, _ in items)
    return f"static const int64_t {_of(name)}[] = {{{values}}};\n"


def _of(name: str) -> str:
    return f"items_of_{name.replace('.', '_')}"


def _row(name: str, meaning: Declared) -> str:
    """One variable in the table."""
    _, refusal = meaning.refusal(name, _Gap()).split("\0")
    flags = (meaning.type == "Real", meaning.causality in CALCULATED, meaning.variability == "fixed", "." in name)
    bounds = (meaning.low, meaning.high, meaning.above, meaning.below)
    items = f"{_of(name)}, {_of(name)} + {len(meaning.items)}" if meaning.items else "NULL, NULL"
    parts = [
        f"{_text(name)}, {_text(meaning.text)}, offsetof(Model, {name})",
        *map(literal, flags),
        *(literal(float(bound)) for bound in bounds),
        items,
        _text(refusal),
    ]
    return f"    {{{', '.join(parts)}}},\n"


def _told(number: str, sentences: dict[int, str], fields: dict[str, tuple[Kind, str]]) -> str:
    """A switch over sentences with numbers in them; every parameter is used, whatever the sentences are."""
    lines = [f"    switch ({number}) {{\n"]
    for case, sentence in sentences.items():
        lines.append(f"    case {case}:\n")
        for words, field, _, _ in Formatter().parse(sentence):
            if words:
                lines.append(f"        add(text, {_text(words)});\n")
            if field:
                kind, place = fields[field]
                lines.append(f"        {'add_real' if kind is FLOAT else 'add_integer'}(text, {place});\n")
        lines.append("        break;\n")
    return "".join([*lines, "    }\n"])
