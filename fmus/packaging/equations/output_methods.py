"""Generates the methods that evaluate outputs, modes and conditions at a point."""

from .algebra import rounding_scale
from .codegen_context import CodegenContext, emit_return, emit_scales, method_source
from .coupled_contact_methods import emit_friction_forces
from .expressions import Term
from .model_declaration import THRESHOLD
from .single_contact_methods import emit_friction_force


def law_modes_method(f: CodegenContext) -> list[str]:
    """Return the source of the method for the modes under a law without stick and slip; nothing without such laws."""
    contacts, s = f.an.contacts, f.printer()
    if all(len(c.laws) == 1 for c in contacts):
        return []
    slips = [c.slip for c in contacts]
    f.emit_driver(s, slips)
    s.count_uses(*slips, *slips)
    modes = []
    for c in contacts:
        slip = s.text(c.slip)
        is_held = THRESHOLD in c.laws
        modes.append(f"sign({slip}) if fabs({slip}) >= {s.text(c.eps)} else 0" if is_held else f"sign({slip})")
    s.emit(f"return {', '.join(modes)}")
    return [method_source("law_modes", ["t", *f.states], s.lines)]


def observe_method(f: CodegenContext) -> str:
    """Return the source of the output method."""
    an, s = f.an, f.printer()
    for mode in an.modes:
        s.emit(f"self.{mode.name} = {s.text(mode)}")
    if any(len(c.laws) > 1 for c in an.contacts):
        with s.block("if self.friction != HYBRID:"):  # as InternalStep.force_modes
            s.emit(" = ".join([*(c.mode.name for c in an.contacts if len(c.laws) > 1), "0"]))
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
    for e in (*an.ramps, *an.states, *an.drivers, *an.outputs, *an.contacts):
        s.emit(f"self.{e.name} = {s.text(e)}")
    sizes = (s.text(e) if e.low >= 0.0 else f"fabs({s.text(e)})" for e in an.overflow_indicators)
    s.emit(f"return {' + '.join(sizes)} < inf")
    return method_source("compute_outputs", f.arguments, s.lines)


def condition_methods(f: CodegenContext) -> list[str]:
    """Return the source of the method; nothing without conditions."""
    margins = [condition.margin for condition in f.an.conditions]
    if not margins:
        return []
    s = f.printer()
    f.emit_driver(s, margins)
    scales = emit_scales(f, s, [rounding_scale(e) for e in margins])
    f.emit_driver(s, scales)
    s.count_uses(*margins, *scales)
    return [method_source("condition_margins", f.arguments, emit_return(s, [*margins, *scales]))]
