"""Generates the methods for contacts, and the friction forces under the selected law.

A single body rests while its contact sticks.  In all other models, a contact may stick while other bodies move.  There
the forces of stuck contacts make the rates of their slips zero.  An independent contact has its load in closed form.
Interacting contacts share one linear system, in which a sliding contact has the row F = mode * slide.  Rates,
derivatives and impulses of the forces satisfy systems with the same matrix.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .algebra import build_term, depends_on, is_same_expression, magnitudes, rounding_scale, rounding_scales, substitute
from .codegen_context import CodegenContext, emit_return, emit_scales, method_source
from .contact_analysis import SMALLEST_DIVISOR
from .expression_printer import ExpressionPrinter
from .expressions import Expression, Operand, Term, is_among
from .model_analysis import ModelAnalysis
from .model_declaration import SIGN, THRESHOLD, Contact, PlanarContact, State, Variable


@dataclass
class ContactUnknown:
    """An unknown of each contact: its symbol, its value while sliding, and while stuck its value or, for interacting
    contacts, the right-hand side of the linear system."""

    symbols: dict[Contact, Operand]
    sliding_values: dict[Contact, Operand]
    stuck_values: dict[Contact, Operand]

    @property
    def terms(self) -> list[Operand]:
        return [*self.sliding_values.values(), *self.stuck_values.values()]


def coupled_contact_methods(context: CodegenContext) -> list[str]:
    """Return the source of all methods for coupled contacts."""
    if context.single_contact is not None or not context.analysis.contacts:
        return []
    slips = [c.slip for c in context.analysis.contacts]
    return [
        method_source("slip_velocities", ["t", *context.states], context.return_lines(context.printer(), slips)),
        slip_scale_method(context, "slip_magnitudes", slip_scales(context, magnitudes)),
        slip_scale_method(context, "slip_roundings", slip_scales(context, rounding_scales)),
        *slip_deviation_method(context),
        forces_method(context),
        force_rates_method(context),
        impulse_method(context),
        *planar_motion_method(context),
    ]


# ---- unknowns


def force_unknown(context: CodegenContext, contacts: Sequence[Contact]) -> ContactUnknown:
    """Return the forces of some contacts as unknowns."""
    analysis = context.analysis
    no_force = dict.fromkeys(analysis.contacts, 0.0)
    stuck_values = {
        c: analysis.load[c] if c in analysis.load else substitute(analysis.slip_rate[c], no_force) for c in contacts
    }
    sliding_values = {
        c: c.slide if isinstance(c, PlanarContact) else Term("*", c.mode, c.slide) for c in contacts
    }  # in a plane the size
    return ContactUnknown({c: c for c in contacts}, sliding_values, stuck_values)


def derivative_unknown(
    context: CodegenContext, name: str, by: dict[Expression, Operand], contacts: Sequence[Contact]
) -> ContactUnknown:
    """Return the derivatives of the forces of some contacts along `by` as unknowns."""
    analysis, derivatives = context.analysis, by | dict.fromkeys(context.analysis.contacts, 0.0)
    sliding_values = {c: analysis.sliding_force_derivative(c, by) for c in contacts}
    stuck_values = {
        c: analysis.derivative(analysis.load[c], by)
        if c in analysis.load
        else analysis.derivative(analysis.slip_rate[c], derivatives)
        for c in contacts
    }
    terms = {
        c: [
            sliding_values[c],
            stuck_values[c],
            *([analysis.derivative(analysis.holding_limit[c], by)] if THRESHOLD in c.laws else []),
        ]
        for c in contacts
    }
    zeros = {c for c in contacts if all(is_same_expression(e, 0.0) for e in terms[c])}
    if not zeros.issuperset(analysis.interacting_contacts):  # their system has a solution other than zero
        zeros &= {*analysis.independent_contacts}
    return ContactUnknown(
        {c: 0.0 if c in zeros else local_symbol(f"{name}_{c.name}") for c in contacts},
        sliding_values,
        stuck_values,
    )


def local_symbol(name: str) -> Expression:
    """Return a symbol for a local variable."""
    symbol = Expression()
    symbol.name = name
    return symbol


def emit_solution(
    context: CodegenContext, printer: ExpressionPrinter, unknowns: Sequence[ContactUnknown], by_law: bool = False
) -> None:
    """Emit the lines that solve for the unknowns; with `by_law`, the selected law decides which contacts are stuck."""
    analysis, interacting_contacts = context.analysis, context.analysis.interacting_contacts
    matrix = {
        (c, d): printer.fresh_name(f"row_{c.name}_{d.name}") for c in interacting_contacts for d in interacting_contacts
    }
    names = {
        (n, c): c.name if e is c else printer.fresh_name(e.name)
        for n, unknown in enumerate(unknowns)
        for c, e in unknown.symbols.items()
        if isinstance(e, Expression)
    }
    for n, c in names:
        if printer.is_shared(unknowns[n].stuck_values[c]):
            printer.local_variable(unknowns[n].stuck_values[c])
    for c in analysis.contacts:
        indices = [n for n in range(len(unknowns)) if (n, c) in names]
        row = interacting_contacts if is_among(c, interacting_contacts) else []
        test = f"{c.mode.name} == 0" + (" and self.friction == HYBRID" if by_law and SIGN in c.laws else "")
        if indices:
            with printer.block(f"if {test}:"):
                for n in indices:
                    printer.emit(f"{names[n, c]} = {printer.text(unknowns[n].stuck_values[c])}")
                for d in row:
                    printer.emit(f"{matrix[c, d]} = {printer.text(analysis.A[c, d])}")
            with printer.block("else:"):
                for n in indices:
                    printer.emit(f"{names[n, c]} = {printer.text(unknowns[n].sliding_values[c])}")
                for d in row:
                    printer.emit(f"{matrix[c, d]} = {printer.text(float(c is d))}")
    right_sides = [
        {c: names[n, c] for c in interacting_contacts}
        for n in range(len(unknowns))
        if all((n, c) in names for c in interacting_contacts)
    ]
    if right_sides:  # else all derivatives of the forces are zero
        has_variable_levers = any(is_among(c, analysis.variable_lever_contacts) for c in interacting_contacts)
        emit_elimination(printer, interacting_contacts, matrix, right_sides, has_variable_levers)
    for (n, c), name in names.items():
        printer.bound_names[unknowns[n].symbols[c]] = name


def emit_elimination(
    printer: ExpressionPrinter,
    rows: list[Contact],
    A: dict[tuple[Contact, Contact], str],
    right_sides: list[dict[Contact, str]],
    has_variable_levers: bool,
) -> None:
    """Emit a Gaussian elimination that overwrites the right-hand sides with the solutions.

    It needs no pivoting: the rows of stuck contacts belong to a positive definite matrix, so no pivot is zero, unless
    the lever of a contact vanishes.
    """
    for n, k in enumerate(rows):
        if has_variable_levers:
            with printer.block(f"if not fabs({A[k, k]}) > {SMALLEST_DIVISOR!r}:"):
                printer.emit(f"{A[k, k]} = {SMALLEST_DIVISOR!r}")
        for i in rows[n + 1 :]:
            printer.emit(f"{A[i, k]} = {A[i, k]} / {A[k, k]}")
            for j in rows[n + 1 :]:
                printer.emit(f"{A[i, j]} = {A[i, j]} - {A[i, k]} * {A[k, j]}")
            for b in right_sides:
                printer.emit(f"{b[i]} = {b[i]} - {A[i, k]} * {b[k]}")
    for n, k in reversed(list(enumerate(rows))):
        for b in right_sides:
            terms = "".join(f" - {A[k, j]} * {b[j]}" for j in rows[n + 1 :])
            printer.emit(f"{b[k]} = {f'({b[k]}{terms})' if terms else b[k]} / {A[k, k]}")


# ---- the methods


def law_mode(printer: ExpressionPrinter, c: Contact) -> str:
    """Return the mode under a law without stick and slip: the sign of the slip, or 0 where the threshold law holds."""
    slip = printer.text(c.slip)
    return f"sign({slip}) if fabs({slip}) >= {printer.text(c.eps)} else 0" if THRESHOLD in c.laws else f"sign({slip})"


def slips_of_laws(analysis: ModelAnalysis) -> list[Operand]:
    """Return the slips that decide on modes under a law without stick and slip."""
    return [c.slip for c in analysis.contacts if len(c.laws) > 1]


def emit_friction_forces(context: CodegenContext, printer: ExpressionPrinter, contacts: Sequence[Contact]) -> None:
    """Emit the modes, and the forces of some contacts, under the selected law."""
    law_contacts = [c for c in context.analysis.contacts if len(c.laws) > 1]
    if law_contacts:
        with printer.block("if self.friction != HYBRID:"):
            for c in law_contacts:
                printer.emit(f"{c.mode.name} = {law_mode(printer, c)}")
    emit_solution(context, printer, [force_unknown(context, contacts)], by_law=True)
    for c in law_contacts:
        if THRESHOLD in c.laws:
            with printer.block(f"if {c.mode.name} == 0 and self.friction != HYBRID:"):
                limit = printer.text(context.analysis.holding_limit[c])
                printer.emit(f"{c.name} = threshold(0.0, 1.0, {c.name}, 0.0, {limit})")


def slip_scale_method(context: CodegenContext, name: str, scales: list[Operand]) -> str:
    """Return the source of a method for scales of the slips."""
    printer = context.printer()
    sizes = emit_scales(context, printer, scales)
    context.emit_driver(printer, sizes)
    printer.count_uses(*sizes)
    return method_source(name, ["t", *context.states], emit_return(printer, sizes))


def slip_scales(context: CodegenContext, scales: Callable[[Sequence[Operand]], list[Operand]]) -> list[Operand]:
    """Return the scales of the slips; in a plane the sum of those of the components, which a square root would lose."""
    result = []
    for c in context.analysis.contacts:
        parts = scales(c.slips if isinstance(c, PlanarContact) else [c.slip])
        result.append(parts[0] if len(parts) == 1 else build_term("+", *parts))
    return result


def planar_motion_method(context: CodegenContext) -> list[str]:
    """Return the source of the method for the motion in planes; nothing without contacts in planes."""
    analysis = context.analysis
    if not analysis.planar_contacts:
        return []
    rows: list[list[Operand]] = [
        [*c.slips, *analysis.planar_rates[c], build_term("*", analysis.A[c, c], c.slide)]
        if isinstance(c, PlanarContact)
        else [0.0] * 5
        for c in analysis.contacts
    ]
    targets = [row[k] for k in range(5) for row in rows]
    return [method_source("planar_motion", context.arguments, context.return_lines(context.printer(), targets))]


def slip_deviation_method(context: CodegenContext) -> list[str]:
    """Return the source of the method for how far changed rates of inputs move the slips; nothing without them."""
    analysis, printer = context.analysis, context.printer()
    if not analysis.has_prescribed_slips:
        return []
    deviations: list[Operand] = []
    for c in analysis.contacts:
        total: Operand = 0.0
        for e in analysis.prescribed_inputs:
            deviation = local_symbol(f"deviation_{e.name}")
            printer.bound_names[deviation] = f"self.{e.name}_polynomial.deviation"
            slope = analysis.derivative(c.slip, {e: 1.0})
            if not is_same_expression(slope, 0.0):
                size = abs(slope) if not isinstance(slope, Expression) else Term("fabs", slope)
                total = build_term("+", total, build_term("*", size, deviation))
        deviations.append(total)
    context.emit_driver(printer, deviations)
    return [method_source("slip_deviations", ["t", *context.states], emit_return(printer, deviations))]


def forces_method(context: CodegenContext) -> str:
    """Forces, limits, and of both together sizes and rounding scales, larger than the limits where terms cancel."""
    analysis, printer, forces = context.analysis, context.printer(), force_unknown(context, context.analysis.contacts)
    loads = [analysis.load.get(c, analysis.slip_rate[c]) for c in analysis.contacts]
    limits = [analysis.holding_limit[c] for c in analysis.contacts]
    sizes = [
        build_term("+", of_load if c in analysis.load else build_term("/", of_load, analysis.divisor(c)), of_limit)
        for scales in (magnitudes, rounding_scales)
        for c, of_load, of_limit in zip(analysis.contacts, scales(loads), scales(limits), strict=True)
    ]
    context.emit_driver(printer, [*forces.terms, *limits])
    printer.count_uses(*forces.terms, *limits, *sizes)
    emit_solution(context, printer, [forces])
    sizes = emit_scales(context, printer, sizes)
    return method_source(
        "contact_forces", context.arguments, emit_return(printer, [*analysis.contacts, *limits, *sizes])
    )


def force_rates_method(context: CodegenContext) -> str:
    """Rates of forces and limits, residual forces that would hold the contacts, and their rates."""
    analysis, printer = context.analysis, context.printer()
    forces = force_unknown(context, analysis.contacts)
    by_time = analysis.time_derivatives
    force_rates = derivative_unknown(context, "rate", by_time, analysis.contacts)
    by_time_with_forces = by_time | {c: force_rates.symbols[c] for c in analysis.contacts}
    residual_forces, residual_force_rates = [], []
    for c in analysis.contacts:
        if c in analysis.load:
            residual_forces.append(build_term("-", analysis.load[c], c))
            load_rate = analysis.derivative(analysis.load[c], by_time)
            residual_force_rates.append(build_term("-", load_rate, force_rates.symbols[c]))
        else:
            residual_forces.append(build_term("/", analysis.slip_rate[c], analysis.divisor(c)))
            slip_jerk = analysis.derivative(analysis.slip_rate[c], by_time_with_forces)
            residual_force_rates.append(build_term("/", slip_jerk, analysis.divisor(c)))
    rates = [
        *force_rates.symbols.values(),
        *(analysis.derivative(analysis.holding_limit[c], by_time) for c in analysis.contacts),
    ]
    targets = [*rates, *residual_forces, *residual_force_rates]
    context.emit_driver(printer, [*forces.terms, *force_rates.terms, *targets])
    printer.count_uses(*forces.terms, *force_rates.terms, *targets)
    emit_solution(context, printer, [forces])
    emit_solution(context, printer, [force_rates])
    return method_source("contact_rates", context.arguments, emit_return(printer, targets))


def impulse_method(context: CodegenContext) -> str:
    """States after impulses that stop the slips of stuck contacts, exactly where slips are sums of speeds."""
    analysis, printer = context.analysis, context.printer()
    stuck_values = {
        c: c.slip if c not in analysis.load else build_term("/", c.slip, analysis.divisor(c)) for c in analysis.contacts
    }
    impulse = ContactUnknown(
        {
            c: 0.0 if is_among(c, analysis.planar_contacts) else local_symbol(f"impulse_{c.name}")
            for c in analysis.contacts
        },
        dict.fromkeys(analysis.contacts, 0.0),
        stuck_values,
    )
    # the impulse in each contact, or in each component of one in a plane, by the force
    impulses: dict[Variable, Operand] = {c: impulse.symbols[c] for c in analysis.line_contacts}
    components: list[tuple[PlanarContact, Expression, Operand]] = []
    for planar in analysis.planar_contacts:
        for component, slip in zip(planar.components, planar.slips, strict=True):
            symbol = local_symbol(printer.fresh_name(f"impulse_{component.name}"))
            impulses[component] = symbol
            components.append((planar, symbol, build_term("/", slip, analysis.divisor(planar))))
    after: dict[State, Operand] = {}
    for state in analysis.dynamic_states:
        for force, value in impulses.items():
            effect = analysis.derivative(analysis.rate_outputs[state], {force: 1.0})
            if not is_same_expression(effect, 0.0):
                after[state] = build_term("+", after.get(state, state), build_term("*", effect, value))
    values = [*impulse.terms, *(value for _, _, value in components), *after.values()]
    context.emit_driver(printer, values)
    printer.count_uses(*values)
    emit_solution(context, printer, [impulse])
    for planar, symbol, value in components:
        printer.emit(f"{symbol.name} = {printer.text(value)} if {planar.mode.name} == 0 else 0.0")
        printer.bound_names[symbol] = symbol.name
    printer.emit(", ".join(e.name for e in after) + " = " + ", ".join(printer.text(e) for e in after.values()))
    for c, state, value in analysis.stick_assignments:
        with printer.block(f"if {c.mode.name} == 0:"):
            printer.emit(f"{state.name} = {printer.text(value)}")
    printer.emit(f"return {', '.join(context.states)}")
    return method_source("apply_impulses", context.arguments, printer.lines)


# ---- the contact of a single body


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
