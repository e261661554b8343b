"""Dependencies of outputs on parameters, inputs and states, from the equations.

The mode of a contact depends on its slip and, if it can stick, on its load, its holding limit and the rates of both,
which decide ties.  For contacts that share bodies it depends on those of all these contacts.
"""

from ..compiler.equations.algebra import differentiate, substitute, variables_in
from ..compiler.equations.expressions import Expression, Operand
from ..compiler.equations.model_analysis import ANALYSES
from ..compiler.equations.model_declaration import HYBRID, SIGN, THRESHOLD, Contact
from ..compiler.equations.model_roles import TIME
from ..runtime.variable_access import SETTABLE_CAUSALITIES
from ..runtime.variable_declarations import VariableOwner
from .fmi_variables import Variables, friction_laws


def output_dependencies(model: type[VariableOwner], declarations: Variables, at_start: bool) -> dict[str, list[str]]:
    """Return for every output the variables that it depends on: parameters, inputs, and states unless `at_start`.

    At the start the states have the values of parameters.
    """
    outputs = [name for name, meaning in declarations if meaning.causality == "output"]
    if not outputs:
        return {}
    analysis = ANALYSES[model]
    laws = friction_laws(model) or [HYBRID]
    start: dict[Expression, Operand] = {
        TIME: 0.0,
        **dict.fromkeys(analysis.drivers, 0.0),
        **{s: s.start_expression for s in analysis.states},
    }
    values = start if at_start else {}
    rates = analysis.declared_derivatives()

    def variables_of(*terms: Operand) -> set[Expression]:
        return {leaf for e in terms for leaf in variables_in(substitute(substitute(e, values), rates))}

    def of_mode(c: Contact) -> set[Expression]:
        contacts = [c] if c in analysis.load else analysis.contacts
        holding_terms = (
            [*analysis.load_expressions(c), *(analysis.holding_limit[d] for d in contacts)] if HYBRID in laws else []
        )
        load_rates = [differentiate(e, analysis.coasting_derivatives) for e in holding_terms]
        others = [e for d in contacts if d is not c for e in (d.slip, d.slide)]
        return variables_of(c.slip, *holding_terms, *load_rates, *others, *([c.eps] if THRESHOLD in laws else []))

    def of_force(c: Contact) -> set[Expression]:
        return of_mode(c) | variables_of(
            c.slide, *([] if laws == [SIGN] else [*analysis.load_expressions(c), analysis.holding_limit[c]])
        )

    def follows(e: Expression) -> set[str]:
        variables = variables_of(e)
        contact_variables = [
            of_force(c) if c in variables else of_mode(c) for c in analysis.contacts if {c, c.mode} & variables
        ]
        names = {variable.name for part in (variables, *contact_variables) for variable in part}
        return names | {"friction"} if contact_variables and laws[1:] else names

    equations = {e.name: follows(e) for e in analysis.variables if e.name in outputs}
    knowns = {name for name, meaning in declarations if meaning.causality in SETTABLE_CAUSALITIES}
    knowns |= set() if at_start else {name for name, meaning in declarations if meaning.role == "state"}
    return {output: [name for name, _ in declarations if name in knowns & equations[output]] for output in outputs}
