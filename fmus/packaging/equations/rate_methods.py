"""Generates the methods for integrators: rates, Jacobian, coefficients of the linear closed form."""

from .algebra import build_term, depends_on, substitute
from .codegen_context import CodegenContext, emit_return, method_source
from .coupled_contact_methods import derivative_unknown, emit_friction_forces, emit_solution, force_unknown
from .expression_printer import ExpressionPrinter
from .expressions import Expression, Operand, Term
from .model_declaration import THRESHOLD, Contact
from .single_contact_methods import threshold_call


def rate_methods(f: CodegenContext) -> list[str]:
    """Return the source of all methods for integrators."""
    return [rates_method(f), jacobian_method(f), *closed_form_methods(f)]


def rates_method(f: CodegenContext) -> str:
    """Rates that are not states, in the order of the states."""
    an, s, c = f.an, f.printer(), f.single_contact
    targets = [law.expression for law in f.rate_expressions]
    if c is not None and THRESHOLD not in c.laws:
        targets = with_sliding_force(c, targets)
        f.emit_sign_mode(s, c, targets)
    elif c is not None:
        f.emit_driver(s, [*targets, an.load[c]])
        s.count_uses(*targets, an.load[c], c.slide, c.slide, an.holding_limit[c])
        sliding = s.text(Term("*", c.mode, c.slide))
        s.emit(f"{c.name} = {sliding} if {c.mode.name} != 0 else {threshold_call(f, s, c)}")
        s.bound_names[c] = c.name
        return method_source("rates", f.arguments, emit_return(s, targets))
    elif an.contacts:
        terms = force_unknown(f).terms
        f.emit_driver(s, [*targets, *terms])
        s.count_uses(*targets, *terms)
        emit_friction_forces(f, s)
        return method_source("rates", f.arguments, emit_return(s, targets))
    return method_source("rates", f.arguments, f.return_lines(s, targets))


def jacobian_method(f: CodegenContext) -> str:
    """Derivatives of each of these rates with respect to time and each state."""
    an, s, c = f.an, f.printer(), f.single_contact
    directions: list[dict[Expression, Operand]] = [
        an.explicit_time_derivatives | an.ramps,
        *({state: 1.0} for state in an.states),
    ]
    if c is None and an.contacts:
        return method_source("jacobian", f.arguments, coupled_jacobian_lines(f, s, directions))
    if c is None:
        return method_source(
            "jacobian",
            f.arguments,
            f.return_lines(s, [f.an.derivative(law, by) for law in f.rate_expressions for by in directions]),
        )
    targets = [an.derivative_while_sliding(law, by) for law in f.rate_expressions for by in directions]
    if THRESHOLD in c.laws:
        with s.block(f"if {c.mode.name} == 0 and fabs({s.text(c.slip)}) < {s.text(c.eps)}:"):
            inner = f.printer(s.depth)
            stuck = [an.derivative_while_stuck(law, by) for law in f.rate_expressions for by in directions]
            f.emit_driver(inner, [an.load[c], *stuck])
            with inner.block(f"if fabs({inner.text(an.load[c])}) <= {inner.text(an.holding_limit[c])}:"):
                inner.emit("return " + ", ".join(map(inner.text, stuck)))
            s.lines += inner.lines
            if depends_on(c.slide, an.time_varying) or depends_on(an.holding_limit[c], an.time_varying):
                limits = [by | {c: clipped_force_derivative(f, c, by)} for by in directions]
                s.lines += f.return_lines(
                    f.printer(s.depth), [f.an.derivative(law, by) for law in f.rate_expressions for by in limits]
                )
    f.emit_sign_mode(s, c, targets)
    return method_source("jacobian", f.arguments, f.return_lines(s, targets))


def coupled_jacobian_lines(
    f: CodegenContext, s: ExpressionPrinter, directions: list[dict[Expression, Operand]]
) -> list[str]:
    """Return the lines that compute the Jacobian while some contacts slide and others stick."""
    forces = [derivative_unknown(f, f"by_{next(iter(by)).name}", by) for by in directions]
    targets = [
        f.an.derivative(law, by | u.symbols)
        for law in f.rate_expressions
        for by, u in zip(directions, forces, strict=True)
    ]
    terms = [e for u in (force_unknown(f), *forces) for e in u.terms]
    f.emit_driver(s, [*terms, *targets])
    s.count_uses(*terms, *targets)
    emit_friction_forces(f, s)
    emit_solution(f, s, forces, law=True)
    for c in f.an.contacts:
        columns = [
            (u.symbols[c], by) for u, by in zip(forces, directions, strict=True) if isinstance(u.symbols[c], Expression)
        ]
        if THRESHOLD in c.laws and columns:
            clips = f"fabs({c.name}) >= {s.text(f.an.holding_limit[c])}"
            with s.block(f"if {c.mode.name} == 0 and self.friction != HYBRID and {clips}:"):
                for e, by in columns:
                    s.emit(f"{s.text(e)} = {s.text(clipped_force_derivative(f, c, by))}")
    return emit_return(s, targets)


def clipped_force_derivative(f: CodegenContext, c: Contact, by: dict[Expression, Operand]) -> Operand:
    """Return the derivative of a force that the threshold law clips."""
    force_unknown = c if f.single_contact is None else f.an.load[c]
    return build_term("*", Term("copysign", 1.0, force_unknown), f.an.derivative(f.an.holding_limit[c], by))


def closed_form_methods(f: CodegenContext) -> list[str]:
    """Coefficients of the linear closed form, and the acceleration at zero states; empty without a closed form."""
    if not f.an.closed_form:
        return []
    targets = [law.expression for law in f.rate_expressions]
    targets = targets if f.single_contact is None else with_sliding_force(f.single_contact, targets)
    at_zero = dict.fromkeys(f.an.states, 0.0)
    methods = [method_source("linear_coefficients", (), f.return_lines(f.printer(), f.an.closed_form))]
    if f.an.ramps:
        slope = f.an.derivative(f.rate_expressions[0].expression, f.an.ramps)
        methods.append(f.nth_derivative_method("applied_acceleration_derivative", ["t"], [slope]))
    lines = f.return_lines(f.printer(), [substitute(e, at_zero) for e in targets])
    return [*methods, method_source("applied_acceleration", ["t", *f.modes], lines)]


def with_sliding_force(c: Contact, targets: list[Operand]) -> list[Operand]:
    """Insert the force of a sliding contact."""
    return [substitute(e, {c: Term("*", c.mode, c.slide)}) for e in targets]
