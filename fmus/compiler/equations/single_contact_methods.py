"""Generates the methods for the contact of a single-body model, and the friction force under the selected law."""

from .algebra import depends_on, rounding_scale, substitute
from .codegen_context import CodegenContext, emit_scales, method_source
from .expression_printer import ExpressionPrinter
from .expressions import Term
from .model_declaration import SIGN, THRESHOLD, Contact


def single_contact_methods(context: CodegenContext) -> list[str]:
    """Return the source of all methods for a single contact."""
    c = context.single_contact
    return (
        []
        if c is None
        else [
            load_method(context, c),
            load_scale_method(context, c),
            *breakaway_method(context, c),
        ]
    )


def load_method(context: CodegenContext, c: Contact) -> str:
    """Load on the body at rest, its rate, and the holding limit."""
    analysis = context.analysis
    targets = [
        analysis.load[c],
        substitute(context.analysis.derivative(analysis.load[c], analysis.coasting_derivatives), {c.slip: 0.0}),
        analysis.holding_limit[c],
    ]
    return method_source("stick_load", ["t", *context.states], context.return_lines(context.printer(), targets))


def load_scale_method(context: CodegenContext, c: Contact) -> str:
    """Rounding scale of the load."""
    printer = context.printer()
    (sizes,) = emit_scales(context, printer, [rounding_scale(context.analysis.load[c])])
    context.emit_driver(printer, [sizes])
    printer.count_uses(sizes)
    printer.emit(f"return {printer.text(sizes)}")
    return method_source("load_magnitude", ["t", *context.states], printer.lines)


def breakaway_method(context: CodegenContext, c: Contact) -> list[str]:
    """Slip acceleration at breakaway, when friction drops from the holding limit to the sliding force."""
    if c.hold is None or any(depends_on(e, context.analysis.time_varying) for e in (c.slide, c.hold)):
        return []
    force_drop = Term("neg", Term("*", c.mode, Term("-", c.hold, c.slide)))
    acceleration = context.analysis.derivative(context.analysis.rate_outputs[c.slip].expression, {c: force_drop})
    return [
        method_source(
            "breakaway_acceleration", context.arguments, context.return_lines(context.printer(), [acceleration])
        )
    ]


def emit_friction_force(context: CodegenContext, printer: ExpressionPrinter, c: Contact) -> None:
    """Emit the friction force under the selected law."""
    load, mode = context.analysis.load[c], c.mode.name
    stuck_force = printer.local_variable(load) if isinstance(load, Term) else printer.text(load)
    if THRESHOLD in c.laws:
        with printer.block(f"if {mode} != 0:"):
            printer.emit(f"{c.name} = {printer.text(Term('*', c.mode, c.slide))}")
        with printer.block("elif self.friction == HYBRID:"):
            printer.emit(f"{c.name} = {stuck_force}")
        with printer.block("else:"):
            printer.emit(f"{c.name} = {threshold_call(context, printer, c)}")
    else:
        with printer.block(f"if {mode} == 0{' and self.friction == HYBRID' if SIGN in c.laws else ''}:"):
            printer.emit(f"{c.name} = {stuck_force}")
        with printer.block("else:"):
            context.emit_sign_mode(printer, c, [c.mode])
            printer.emit(f"{c.name} = {printer.text(Term('*', c.mode, c.slide))}")
    printer.bound_names[c] = c.name


def threshold_call(context: CodegenContext, printer: ExpressionPrinter, c: Contact) -> str:
    """Return the call that computes the force of the threshold law."""
    arguments = (c.slip, c.eps, context.analysis.load[c], c.slide, context.analysis.holding_limit[c])
    return f"threshold({', '.join(map(printer.text, arguments))})"
