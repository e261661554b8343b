"""Generates the methods for integrators: rates, Jacobian, coefficients of the linear closed form."""

from .algebra import build_term, depends_on, is_same_expression, operands_first, rounding_scales, substitute
from .codegen_context import CodegenContext, emit_return, emit_scales, method_source
from .contact_methods import (
    derivative_unknown,
    emit_friction_forces,
    emit_solution,
    force_unknown,
    slips_of_laws,
    threshold_call,
)
from .expression_printer import ExpressionPrinter
from .expressions import FUNCTIONS, Expression, Operand, Term
from .model_analysis import ModelAnalysis
from .model_declaration import THRESHOLD, Contact


def rate_methods(context: CodegenContext) -> list[str]:
    """Return the source of all methods for integrators.

    A stage of a trial step may leave the domain of the equations.  NaN then rejects the step, where an error would end
    the run.
    """
    return [
        rates_method(context),
        rates_method(context, of_terms=True),
        jacobian_method(context),
        fastest_clock_method(context),
        *closed_form_methods(context),
    ]


def rates_method(context: CodegenContext, of_terms: bool = False) -> str:
    """Rates that are not states, in the order of the states; or bounds on the magnitudes of their terms."""
    name = "rate_magnitudes" if of_terms else "rates"
    analysis, c = context.analysis, context.single_contact
    printer = context.printer(on_trial=analysis.time_varying)
    targets = [rate.expression for rate in context.rate_outputs]
    if c is not None and THRESHOLD not in c.laws:
        targets = with_sliding_force(c, targets)
    if of_terms:
        targets = emit_scales(context, printer, rounding_scales(targets))
    if c is not None and THRESHOLD not in c.laws:
        context.emit_sign_mode(printer, c, targets)
    elif c is not None:
        context.emit_driver(printer, [*targets, analysis.load[c]])
        printer.count_uses(*targets, analysis.load[c], c.slide, c.slide, analysis.holding_limit[c])
        sliding_force = printer.text(Term("*", c.mode, c.slide))
        printer.emit(f"{c.name} = {sliding_force} if {c.mode.name} != 0 else {threshold_call(context, printer, c)}")
        printer.bound_names[c] = c.name
        return method_source(name, context.arguments, emit_return(printer, targets))
    elif analysis.contacts:
        terms = force_unknown(context, analysis.line_contacts).terms
        limits = [analysis.holding_limit[c] for c in analysis.line_contacts] if of_terms else []
        context.emit_driver(printer, [*targets, *terms, *limits, *slips_of_laws(analysis)])
        printer.count_uses(*targets, *terms, *limits)
        emit_friction_forces(context, printer, analysis.line_contacts)
        for c, limit in zip(analysis.line_contacts, limits, strict=False):
            # the force of a stuck contact is a sum that may cancel
            printer.emit(f"{c.name} = fabs({c.name}) + ({printer.text(limit)} if {c.mode.name} == 0 else 0.0)")
        return method_source(name, context.arguments, emit_return(printer, targets))
    return method_source(name, context.arguments, context.return_lines(printer, targets))


def jacobian_method(context: CodegenContext) -> str:
    """Derivatives of each of these rates with respect to time and each state."""
    analysis, c = context.analysis, context.single_contact
    printer = context.printer(on_trial=analysis.time_varying)
    directions: list[dict[Expression, Operand]] = [
        analysis.explicit_time_derivatives | analysis.input_derivatives,
        *({state: 1.0} for state in analysis.states),
    ]
    if c is None and analysis.contacts:
        return method_source("jacobian", context.arguments, coupled_jacobian_lines(context, printer, directions))
    if c is None:
        return method_source(
            "jacobian",
            context.arguments,
            context.return_lines(
                printer, [context.analysis.derivative(rate, by) for rate in context.rate_outputs for by in directions]
            ),
        )
    targets = [analysis.derivative_while_sliding(rate, by) for rate in context.rate_outputs for by in directions]
    if THRESHOLD in c.laws:
        with printer.block(f"if {c.mode.name} == 0 and fabs({printer.text(c.slip)}) < {printer.text(c.eps)}:"):
            inner = context.printer(printer.depth, printer.on_trial)
            stuck_targets = [
                analysis.derivative_while_stuck(rate, by) for rate in context.rate_outputs for by in directions
            ]
            context.emit_driver(inner, [analysis.load[c], *stuck_targets])
            with inner.block(f"if fabs({inner.text(analysis.load[c])}) <= {inner.text(analysis.holding_limit[c])}:"):
                inner.emit("return " + ", ".join(map(inner.text, stuck_targets)))
            printer.lines += inner.lines
            if depends_on(c.slide, analysis.time_varying) or depends_on(
                analysis.holding_limit[c], analysis.time_varying
            ):
                limits = [by | {c: clipped_force_derivative(context, c, by)} for by in directions]
                printer.lines += context.return_lines(
                    context.printer(printer.depth, printer.on_trial),
                    [context.analysis.derivative(rate, by) for rate in context.rate_outputs for by in limits],
                )
    context.emit_sign_mode(printer, c, targets)
    return method_source("jacobian", context.arguments, context.return_lines(printer, targets))


def coupled_jacobian_lines(
    context: CodegenContext, printer: ExpressionPrinter, directions: list[dict[Expression, Operand]]
) -> list[str]:
    """Return the lines that compute the Jacobian while some contacts slide and others stick."""
    contacts = context.analysis.line_contacts
    forces = [derivative_unknown(context, f"by_{next(iter(by)).name}", by, contacts) for by in directions]
    targets = [
        context.analysis.derivative(rate, by | unknown.symbols)
        for rate in context.rate_outputs
        for by, unknown in zip(directions, forces, strict=True)
    ]
    terms = [e for unknown in (force_unknown(context, contacts), *forces) for e in unknown.terms]
    context.emit_driver(printer, [*terms, *targets, *slips_of_laws(context.analysis)])
    printer.count_uses(*terms, *targets)
    emit_friction_forces(context, printer, contacts)
    emit_solution(context, printer, forces, by_law=True)
    for c in contacts:
        columns = [
            (unknown.symbols[c], by)
            for unknown, by in zip(forces, directions, strict=True)
            if isinstance(unknown.symbols[c], Expression)
        ]
        if THRESHOLD in c.laws and columns:
            clips = f"fabs({c.name}) >= {printer.text(context.analysis.holding_limit[c])}"
            with printer.block(f"if {c.mode.name} == 0 and self.friction != HYBRID and {clips}:"):
                for e, by in columns:
                    printer.emit(f"{printer.text(e)} = {printer.text(clipped_force_derivative(context, c, by))}")
    return emit_return(printer, targets)


def clipped_force_derivative(context: CodegenContext, c: Contact, by: dict[Expression, Operand]) -> Operand:
    """Return the derivative of a force that the threshold law clips."""
    clipped_force = c if context.single_contact is None else context.analysis.load[c]
    return build_term(
        "*", Term("copysign", 1.0, clipped_force), context.analysis.derivative(context.analysis.holding_limit[c], by)
    )


def fastest_clock_method(context: CodegenContext) -> str:
    """Largest rate at which clocks change functions; in event functions, also that of positions at their speeds.

    In its reciprocal, the argument of sin or cos changes by no more than 2, a divisor by half of its size, and the
    argument u of another function, such as exp, by (1 + |u|)/2: where u is large, the function is nearly constant.
    """
    analysis, printer = context.analysis, context.printer()
    rates = clock_rates(analysis)
    accelerations = {clock: analysis.derivative(rate, rates) for clock, rate in rates.items()}
    positions = (
        {x: analysis.rate[x] for x in analysis.positions}
        if analysis.conditions or context.single_contact is None
        else {}
    )
    events: list[Operand] = [condition.margin for condition in analysis.conditions]
    for c in analysis.contacts:
        events += [analysis.holding_limit[c], *analysis.load_expressions(c)]
    in_events = {id(e) for e in operands_first(*events)}
    others = [
        *(rate.expression for rate in context.rate_outputs),
        *(e for c in analysis.contacts for e in (c.slip, c.slide)),
    ]
    terms: list[Operand] = []
    for e in operands_first(*others, *events):
        if isinstance(e, Term) and (e.op == "/" or (e.op in FUNCTIONS and e.op not in ("fabs", "sqrt"))):
            argument = e.args[-1]
            size = Term("fabs", argument)
            change = {"sin": 4.0, "cos": 4.0, "tan": 4.0, "/": size}.get(e.op, build_term("+", 1.0, size))
            has_positions = id(e) in in_events and e.op != "/"  # a lever, as a divisor, passes zero at a dead point
            slope = analysis.derivative(argument, positions | rates if has_positions else rates)
            bend = analysis.derivative(argument, accelerations)
            rate: Operand = 0.0  # r with |slope| / r + |bend| / (2 r r) <= change / 2
            if not is_same_expression(slope, 0.0):
                rate = build_term("/", build_term("*", 2.0, Term("fabs", slope)), change)
            if not is_same_expression(bend, 0.0):
                rate = build_term("+", rate, Term("sqrt", build_term("/", Term("fabs", bend), change)))
            if not is_same_expression(rate, 0.0):
                terms.append(rate)
    context.emit_driver(printer, terms)
    printer.count_uses(*terms)
    texts = list(dict.fromkeys(map(printer.text, terms))) or ["0.0"]
    largest, other = printer.fresh_name("largest"), printer.fresh_name("rate")
    printer.emit(f"{largest} = {texts[0]}")
    for text in texts[1:]:
        printer.emit(f"{other} = {text}")
        printer.emit(f"{largest} = {other} if {other} > {largest} else {largest}")
    printer.emit(f"return {largest}")
    return method_source("fastest_clock", context.arguments, printer.lines)


def clock_rates(analysis: ModelAnalysis) -> dict[Expression, Operand]:
    """Return the rate of each clock: a driver, an input with derivatives, or a state whose rate is known at rest.

    The rate of such a state depends on parameters, inputs and other clocks only.
    """
    rates: dict[Expression, Operand] = {**analysis.explicit_time_derivatives, **analysis.input_derivatives}
    varying_symbols: set[Expression] = {*analysis.contacts, *analysis.modes, *analysis.states}
    for _ in analysis.states:
        for state, rate in analysis.rate.items():
            if not depends_on(rate, varying_symbols):
                rates[state] = rate
                varying_symbols.discard(state)
    return rates


def closed_form_methods(context: CodegenContext) -> list[str]:
    """Coefficients of the linear closed form, and the acceleration at zero states; empty without a closed form."""
    if not context.analysis.closed_form:
        return []
    targets = [rate.expression for rate in context.rate_outputs]
    targets = targets if context.single_contact is None else with_sliding_force(context.single_contact, targets)
    at_zero = dict.fromkeys(context.analysis.states, 0.0)
    methods = [
        method_source("linear_coefficients", (), context.return_lines(context.printer(), context.analysis.closed_form))
    ]
    if context.analysis.input_rates:
        slope = context.analysis.derivative(context.rate_outputs[0].expression, context.analysis.input_rates)
        lines = context.return_lines(context.printer(), [slope])
        methods.append(method_source("applied_acceleration_rate", ["t"], lines))
    lines = context.return_lines(context.printer(), [substitute(e, at_zero) for e in targets])
    return [*methods, method_source("applied_acceleration", ["t", *context.modes], lines)]


def with_sliding_force(c: Contact, targets: list[Operand]) -> list[Operand]:
    """Insert the force of a sliding contact."""
    return [substitute(e, {c: Term("*", c.mode, c.slide)}) for e in targets]
