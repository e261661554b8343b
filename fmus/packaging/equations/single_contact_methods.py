"""Generates the methods for the contact of a single-body model, and the friction force under the selected law."""

from .algebra import depends_on, rounding_scale, substitute
from .codegen_context import CodegenContext, emit_scales, method_source
from .expression_printer import ExpressionPrinter
from .expressions import Term
from .model_declaration import SIGN, THRESHOLD, Contact


def single_contact_methods(f: CodegenContext) -> list[str]:
    """Return the source of all methods for a single contact."""
    c = f.single_contact
    return (
        []
        if c is None
        else [load_method(f, c), *load_rate_method(f, c), load_scale_method(f, c), *breakaway_method(f, c)]
    )


def load_method(f: CodegenContext, c: Contact) -> str:
    """Load on the body at rest, its rate, and the holding limit."""
    an = f.an
    targets = [
        an.load[c],
        substitute(f.an.derivative(an.load[c], an.coasting_derivatives), {c.slip: 0.0}),
        an.holding_limit[c],
    ]
    return method_source("stick_load", ["t", *f.states], f.return_lines(f.printer(), targets))


def load_rate_method(f: CodegenContext, c: Contact) -> list[str]:
    """The n-th derivative of the load caused by inputs."""
    ramps = f.an.ramps
    return (
        [f.nth_derivative_method("load_derivative", ["t", *f.states], [f.an.derivative(f.an.load[c], ramps)])]
        if ramps
        else []
    )


def load_scale_method(f: CodegenContext, c: Contact) -> str:
    """Rounding scale of the load."""
    s = f.printer()
    (sizes,) = emit_scales(f, s, [rounding_scale(f.an.load[c])])
    f.emit_driver(s, [sizes])
    s.count_uses(sizes)
    s.emit(f"return {s.text(sizes)}")
    return method_source("load_magnitude", ["t", *f.states], s.lines)


def breakaway_method(f: CodegenContext, c: Contact) -> list[str]:
    """Slip acceleration at breakaway, when friction drops from the holding limit to the sliding force."""
    if c.hold is None or any(depends_on(e, f.an.time_varying) for e in (c.slide, c.hold)):
        return []
    less = Term("neg", Term("*", c.mode, Term("-", c.hold, c.slide)))
    jump = f.an.derivative(f.an.rate_outputs[c.slip].expression, {c: less})
    return [method_source("breakaway_acceleration", f.arguments, f.return_lines(f.printer(), [jump]))]


def emit_friction_force(f: CodegenContext, s: ExpressionPrinter, c: Contact) -> None:
    """Emit the friction force under the selected law."""
    load, mode = f.an.load[c], c.mode.name
    stuck_force = s.local_variable(load) if isinstance(load, Term) else s.text(load)
    if THRESHOLD in c.laws:
        with s.block(f"if {mode} != 0:"):
            s.emit(f"{c.name} = {s.text(Term('*', c.mode, c.slide))}")
        with s.block("elif self.friction == HYBRID:"):
            s.emit(f"{c.name} = {stuck_force}")
        with s.block("else:"):
            s.emit(f"{c.name} = {threshold_call(f, s, c)}")
    else:
        with s.block(f"if {mode} == 0{' and self.friction == HYBRID' if SIGN in c.laws else ''}:"):
            s.emit(f"{c.name} = {stuck_force}")
        with s.block("else:"):
            f.emit_sign_mode(s, c, [c.mode])
            s.emit(f"{c.name} = {s.text(Term('*', c.mode, c.slide))}")
    s.bound_names[c] = c.name


def threshold_call(f: CodegenContext, s: ExpressionPrinter, c: Contact) -> str:
    """Return the call that computes the force of the threshold law."""
    return f"threshold({', '.join(map(s.text, (c.slip, c.eps, f.an.load[c], c.slide, f.an.holding_limit[c])))})"
