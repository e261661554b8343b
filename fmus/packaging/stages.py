"""Writes the texts of a model at every stage of code generation, for readers who want to follow an equation.

1-declared.py       the model file
2-analysis.txt      the expressions that its equations build, and what the structural analysis derives from them
3-lowered/          the generated class of scalars, and the numerics, lowered to the states of the model
4-c/                the same as C, with the FMI functions
"""

from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

from ..compiler.equations.algebra import differentiate, operands_first
from ..compiler.equations.dimensions import term_operands
from ..compiler.equations.expression_printer import ExpressionPrinter
from ..compiler.equations.expressions import Operand, Term
from ..compiler.equations.model_analysis import ModelAnalysis
from ..compiler.equations.model_declaration import Output, Variable
from ..compiler.equations.model_file import ModelFile
from ..compiler.equations.model_roles import TIME
from ..compiler.lowering import lowered_files, lowered_model, select_features
from .native.native_fmu import collect_sources

MAX_LENGTH = 3000  # characters of an expression inside of another one


def write_stages(source: ModelFile, folder: Path, methods: Sequence[str] = (), laws: Sequence[str] = ()) -> Path:
    """Write the texts of a model to `folder/<model>`, and return that path.

    Parameters
    ----------
    source
        Model file.
    folder
        Folder for all models; it is created if it does not exist.
    methods, laws
        Labels of the methods and friction laws to include; none: all.
    """
    features = select_features(source, methods, laws)
    texts = {
        "1-declared.py": source.source,
        "2-analysis.txt": "\n".join([*expression_lines(source.analysis), "", *analysis_lines(source.analysis), ""]),
    }
    texts |= {f"3-lowered/{path}": text for path, text in lowered_files(source, features).items()}
    texts |= {f"4-c/{name}": text for name, text in collect_sources(lowered_model(source, features), "2").items()}
    for name, text in texts.items():
        path = folder / source.name / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder / source.name


def expression_lines(analysis: ModelAnalysis) -> Iterator[str]:
    """Yield the expressions of outputs and friction forces, with operators in front of their operands.

    A part that is longer than a line has a line of its own, because a model may use it many times.
    """
    targets = [(e.name, e.expression) for e in analysis.outputs]
    for c in analysis.contacts:
        targets += [(f"{c.name}.{part}", getattr(c, part)) for part in ("slip", "slide", "hold")]
    forms: dict[int, str] = {}
    numbers = count(1)
    for name, target in targets:
        if target is None:
            continue
        for e in operands_first(target, operands_of=lambda part: () if id(part) in forms else term_operands(part)):
            if id(e) in forms:
                continue
            forms[id(e)] = e.name if isinstance(e, Variable) else repr(e)
            if isinstance(e, Term):
                form = f"{e.op}({', '.join(forms[id(operand)] for operand in e.args)})"
                if len(form) > MAX_LENGTH and e is not target:
                    forms[id(e)] = f"[{next(numbers)}]"
                    yield f"{forms[id(e)]} = {form}"
                else:
                    forms[id(e)] = form
        yield f"{name} = {forms[id(target)]}"


def analysis_lines(analysis: ModelAnalysis) -> Iterator[str]:
    """Yield the roles of the variables and the derived expressions."""
    names = {e: e.name for e in (TIME, *analysis.variables) if not isinstance(e, Output)}
    printer = ExpressionPrinter(names, (), (), 0)

    def text(e: Operand) -> str:
        result = printer.text(e)
        statements, printer.lines = printer.lines, []
        return "; ".join([*statements, result])

    yield f"states: {', '.join(e.name for e in analysis.states)}"
    for state, rate in analysis.rate.items():
        yield f"d{state.name}/dt = {text(rate)}"
    for contact in analysis.contacts:
        yield f"{contact.name}: slip velocity {text(contact.slip)}, sliding force {text(contact.slide)}"
        if contact in analysis.load:
            yield f"{contact.name}: load while stuck {text(analysis.load[contact])}"
        yield f"{contact.name}: holding limit {text(analysis.holding_limit[contact])}"
    for e in analysis.rate_outputs.values():
        for by in (TIME, *analysis.states):
            derivative = differentiate(e.expression, {by: 1.0})
            yield f"d{e.name}/d{by.name} at constant friction force = {text(derivative)}"
    if analysis.closed_form:
        mass, damping, stiffness, speed = map(text, analysis.closed_form)
        yield f"closed form: mass {mass}, damping {damping}, stiffness {stiffness}, speed of the resting point {speed}"
    else:
        yield "closed form: none"
    yield f"methods: {', '.join(analysis.methods)}; friction laws: {', '.join(analysis.laws)}"
