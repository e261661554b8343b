"""The class of a model in plain scalars, as text: what travels inside an FMU, and what is frozen to C."""

import ast
from inspect import cleandoc
from math import isfinite
from textwrap import indent, wrap

from ...runtime.active_method import EXACT_ITEM
from ...runtime.oscillator import Oscillator
from ..words import quoted
from .anatomy import Anatomy
from .coupled import coupled
from .declared import Contact, Fixed, Mode, Output, State, Variable
from .frame import Frame
from .friction import friction
from .motion import motion
from .names import IMPORTS, MATH
from .outputs import observe
from .scribe import INDENT
from .values import values

HEAD = '''"""{first}

Written out from the equations in {file}: change those, not this.
"""

{imports}


class Solver(Integrator):
    method = Choice({method}, "integration method", {items})


class {name}({base}):
    """{about}"""

{declarations}

{facts}

{methods}
'''
HERE = "\0"  # where imports go; no text of an author's has it
WIDTH = 105
RUN = ("stop_time", "step_size", "tolerance")


def written(an: Anatomy, file: str) -> str:
    """The text of the module."""
    f = Frame(an)
    first, _, rest = escaped(cleandoc(an.model.__doc__ or "")).partition("\n")
    about = indent(f"{first}\n{rest}" + ("\n" if rest else ""), INDENT).strip(" ")
    text = HEAD.format(
        first=first,
        file=file,
        imports=HERE,
        method="EXACT" if an.method == EXACT_ITEM[0] else f"{an.method}.NUMBER",
        items="(EXACT_ITEM, *METHOD_ITEMS)" if an.closed_form else "METHOD_ITEMS",
        name=an.name,
        base=base(an),
        about=about.rstrip(" ") + (INDENT if rest else ""),
        declarations=indent("\n".join(declarations(an)), INDENT),
        facts=indent("\n".join(facts(an)), INDENT),
        methods="\n\n".join([*values(f), *motion(f), *friction(f), *coupled(f), observe(f)]),
    )
    return text.replace(HERE, imports(text.replace(HERE, "")))


def base(an: Anatomy) -> str:
    """The class of the runtime that it derives from."""
    return "DryFriction" if an.waits else "CoupledFriction" if an.contacts else "Oscillator"


def imports(text: str) -> str:
    """What the text needs."""
    used = {node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)}
    lines = [f"from math import {', '.join(names)}\n"] if (names := sorted(used & set(MATH))) else []
    for module, offered in IMPORTS.items():
        if names := [name for name in offered if name in used]:
            lines.append(f"from {f'.runtime.{module}'.rstrip('.')} import {', '.join(names)}")
    return "\n".join(lines)


def declarations(an: Anatomy) -> list[str]:
    """The variables in the order of the description: parameters, choices, inputs, outputs."""
    lines = [
        f"{e.name} = {'Fixed' if isinstance(e, Fixed) else 'Parameter'}({float(e.start)!r}, {described(e)})"
        for e in an.parameters
    ]
    if an.laws:
        items = ", ".join(f"{law.upper()}_LAW" for law in an.laws)
        lines.append(f'friction = Choice(HYBRID, "friction law", ({items}{"," if len(an.laws) == 1 else ""}))')
    for e in an.choices:
        items = ", ".join(f"({quoted(label)}, {value}, {quoted(sentence)})" for label, value, sentence in e.items)
        lines.append(f"{e.name} = Choice({e.start}, {quoted(e.text)}, ({items},))")
    lines += [f"{e.name} = Input({float(e.start)!r}, {described(e)})" for e in an.inputs]
    return lines + [f"{e.name} = {output(an, e)}" for e in an.told]


def output(an: Anatomy, e: Variable) -> str:
    """The declaration of what is calculated."""
    if isinstance(e, Mode):
        return f"Mode({quoted(e.text)})"
    more = f", rate_of={quoted(e.whose.name)}" if isinstance(e, (State, Output)) and e.whose is not None else ""
    if isinstance(e, State):
        more += f", rate={quoted(e.steady.name)}" if e in an.drives else ""
        return f"State({described(e)}{more})"
    if isinstance(e, Contact):
        return f"Contact({described(e)})"
    return f"Output({described(e)}{more}{', direct=True' if an.direct(e) else ''})"


def described(e: Variable) -> str:
    """Unit, words and range."""
    bounds = [(key, getattr(e, key)) for key in ("low", "high", "above", "below")]
    more = [f"{key}={float(bound)!r}" for key, bound in bounds if isfinite(bound)]
    more += [f"{key}={quoted(getattr(e, key))}" for key in ("display", "alias") if getattr(e, key)]
    return ", ".join([quoted(e.unit), quoted(e.text), *more])


def facts(an: Anatomy) -> list[str]:
    """What the runtime asks of the class."""
    states = ", ".join(f"{quoted(s.name)}: {quoted(an.rate[s].name)}" for s in an.states)
    lines = [f"states = {{{states}}}"]
    if an.contacts:
        slips = ", ".join(f"{quoted(c.mode.name)}: {quoted(c.slip.name if an.waits else '')}" for c in an.contacts)
        lines.append(f"contacts = {{{slips}}}")
    lines += [
        f"{word} = True"
        for word, holds in (
            ("is_linear", an.closed_form),
            ("has_driver", an.drives),
            ("has_input_derivatives", an.ramps),
        )
        if holds
    ]
    for word in RUN:
        if (value := float(getattr(an.model, word))) != getattr(Oscillator, word):
            lines.append(f"{word} = {value!r}")
    if an.rules:
        inherited = [f"{INDENT}*{base(an)}.rules,"] if an.contacts else []
        sentences = [f"{INDENT}{lines_of(rule.sentence)}," for rule in an.rules]
        lines += ["rules = (", *inherited, *sentences, ")"]
    return lines


def lines_of(text: str) -> str:
    """A string literal over several lines, if it is long."""
    lines = wrap(text, WIDTH, drop_whitespace=False)
    return quoted(text) if len(lines) == 1 else f"\n{INDENT}".join(map(quoted, lines))


def escaped(text: str) -> str:
    """A text as it stands between three quotes."""
    text = text.replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    return f'{text[:-1]}\\"' if text.endswith('"') else text
