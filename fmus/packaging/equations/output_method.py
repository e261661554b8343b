"""Generates the method that computes the outputs and returns whether they are finite."""

from .codegen_context import CodegenContext, method_source
from .coupled_contact_methods import emit_friction_forces
from .expressions import Term
from .single_contact_methods import emit_friction_force


def observe_method(f: CodegenContext) -> str:
    """Return the source of the output method."""
    an, s = f.an, f.printer()
    f.emit_driver(s, [*an.drivers, *an.ramps])
    s.count_uses(*an.outputs, *an.outputs)
    s.count_uses(*an.load.values(), *an.load.values(), *(c.slide for c in an.contacts))
    if f.single_contact is not None:
        emit_friction_force(f, s, f.single_contact)
    elif an.contacts:
        emit_friction_forces(f, s)
    for e in an.outputs:
        if isinstance(e.expression, Term):
            s.local_variable(e)
    for e in (*an.ramps, *an.states, *an.drivers, *an.outputs, *an.contacts, *an.modes):
        s.emit(f"self.{e.name} = {s.text(e)}")
    sizes = (s.text(e) if e.low >= 0.0 else f"fabs({s.text(e)})" for e in an.overflow_indicators)
    s.emit(f"return {' + '.join(sizes)} < inf")
    return method_source("compute_outputs", f.arguments, s.lines)
