"""What every output follows from at the start: the parameters and inputs in its equation, with the start values put in,
so that terms which are zero are gone.

The mode of a contact follows from its slip and, where it may stick, from its load and from what it holds, and from the
rates of both, which decide ties; of contacts that share bodies from those of all.
"""

from ..runtime.variable_access import SETTABLE_CAUSALITIES
from ..runtime.variable_declarations import VariableOwner
from .equations.algebra import differentiate, substitute, variables_in
from .equations.expressions import Expression, Operand
from .equations.model_analysis import TIME, ModelAnalysis
from .equations.model_declaration import HYBRID, SIGN, THRESHOLD, Contact
from .fmi_variables import Variables


def initial_dependencies(model: type[VariableOwner], declared: Variables) -> dict[str, list[str]]:
    """For every output the parameters and inputs that it follows from while the model is initialised."""
    outputs = [name for name, meaning in declared if meaning.causality == "output"]
    if not outputs:
        return {}
    an: ModelAnalysis = model.analysis  # type: ignore[attr-defined]
    laws = [label for name, meaning in declared if name == "friction" for label, _, _ in meaning.items] or [HYBRID]
    start: dict[Expression, Operand] = {
        TIME: 0.0,
        **dict.fromkeys(an.drivers, 0.0),
        **{s: s.start_expression for s in an.states},
    }

    def among(*terms: Operand) -> set[Expression]:
        return {leaf for e in terms for leaf in variables_in(substitute(e, start))}

    def of_mode(c: Contact) -> set[Expression]:
        near = [c] if c in an.independent_contacts else an.contacts
        held = [*an.load_expressions(c), *(an.holding_limit[d] for d in near)] if HYBRID in laws else []
        rates = [differentiate(e, an.coasting_derivatives) for e in held]
        others = [e for d in near if d is not c for e in (d.slip, d.slide)]
        return among(c.slip, *held, *rates, *others, *([c.eps] if THRESHOLD in laws else []))

    def of_force(c: Contact) -> set[Expression]:
        return of_mode(c) | among(c.slide, *([] if laws == [SIGN] else [*an.load_expressions(c), an.holding_limit[c]]))

    def follows(e: Expression) -> set[str]:
        found = among(e)
        touched = [of_force(c) if c in found else of_mode(c) for c in an.contacts if {c, c.mode} & found]
        names = {one.name for part in (found, *touched) for one in part}
        return names | {"friction"} if touched and laws[1:] else names

    equations = {e.name: follows(e) for e in an.declared if e.name in outputs}
    known = [name for name, meaning in declared if meaning.causality in SETTABLE_CAUSALITIES]
    return {output: [name for name in known if name in equations[output]] for output in outputs}
