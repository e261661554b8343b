"""Generates the methods for models in which a contact may stick while other bodies move.

The forces of stuck contacts make the rates of their slips zero.  An independent contact has its load in closed form.
Interacting contacts share one linear system, in which a sliding contact has the row F = mode * slide.  Rates,
derivatives and impulses of the forces satisfy systems with the same matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from .algebra import build_term, is_same_expression, rounding_scale, substitute
from .codegen_context import CodegenContext, emit_return, emit_scales, method_source
from .contact_analysis import SMALLEST_DIVISOR
from .expression_printer import ExpressionPrinter
from .expressions import Expression, Operand, Term, is_among
from .model_declaration import SIGN, THRESHOLD, Contact, State


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


def coupled_contact_methods(f: CodegenContext) -> list[str]:
    """Return the source of all methods for coupled contacts."""
    if f.single_contact is not None or not f.an.contacts:
        return []
    slips = [c.slip for c in f.an.contacts]
    return [
        method_source("slip_velocities", ["t", *f.states], f.return_lines(f.printer(), slips)),
        slip_scale_method(f),
        forces_method(f),
        force_rates_method(f),
        impulse_method(f),
    ]


# ---- unknowns


def force_unknown(f: CodegenContext) -> ContactUnknown:
    """Return the contact forces as unknowns."""
    an = f.an
    none = dict.fromkeys(an.contacts, 0.0)
    held = {c: an.load[c] if c in an.load else substitute(an.slip_rate[c], none) for c in an.contacts}
    return ContactUnknown({c: c for c in an.contacts}, {c: Term("*", c.mode, c.slide) for c in an.contacts}, held)


def derivative_unknown(f: CodegenContext, name: str, by: dict[Expression, Operand]) -> ContactUnknown:
    """Return the derivatives of the forces along `by` as unknowns."""
    an, fixed = f.an, by | dict.fromkeys(f.an.contacts, 0.0)
    slides = {c: build_term("*", c.mode, an.derivative(c.slide, by)) for c in an.contacts}
    held = {
        c: an.derivative(an.load[c], by) if c in an.load else an.derivative(an.slip_rate[c], fixed) for c in an.contacts
    }
    zero = {
        c: [slides[c], held[c], *([an.derivative(an.holding_limit[c], by)] if THRESHOLD in c.laws else [])]
        for c in an.contacts
    }
    none = {c for c in an.contacts if all(is_same_expression(e, 0.0) for e in zero[c])}
    none = none if none.issuperset(an.interacting_contacts) else none & {*an.independent_contacts}
    return ContactUnknown(
        {c: 0.0 if c in none else local_symbol(f"{name}_{c.name}") for c in an.contacts}, slides, held
    )


def local_symbol(name: str) -> Expression:
    """Return a symbol for a local variable."""
    symbol = Expression()
    symbol.name = name
    return symbol


def emit_solution(
    f: CodegenContext, s: ExpressionPrinter, unknowns: Sequence[ContactUnknown], law: bool = False
) -> None:
    """Emit the lines that solve for the unknowns; with `law`, the selected law decides which contacts are stuck."""
    shared = f.an.interacting_contacts
    matrix = {(c, d): s.fresh_name(f"row_{c.name}_{d.name}") for c in shared for d in shared}
    names = {
        (n, c): c.name if e is c else s.fresh_name(e.name)
        for n, u in enumerate(unknowns)
        for c, e in u.symbols.items()
        if isinstance(e, Expression)
    }
    for n, c in names:
        if s.is_shared(unknowns[n].stuck_values[c]):
            s.local_variable(unknowns[n].stuck_values[c])
    for c in f.an.contacts:
        indices = [n for n in range(len(unknowns)) if (n, c) in names]
        test = f"{c.mode.name} == 0" + (" and self.friction == HYBRID" if law and SIGN in c.laws else "")
        for head, attribute in ((f"if {test}:", "stuck_values"), ("else:", "sliding_values")) if indices else ():
            with s.block(head):
                for n in indices:
                    s.emit(f"{names[n, c]} = {s.text(getattr(unknowns[n], attribute)[c])}")
                for d in shared if is_among(c, shared) else []:
                    s.emit(f"{matrix[c, d]} = {s.text(f.an.A[c, d] if attribute == 'stuck_values' else float(c is d))}")
    sides = [{c: names[n, c] for c in shared} for n in range(len(unknowns)) if all((n, c) in names for c in shared)]
    emit_elimination(s, shared, matrix, sides, any(is_among(c, f.an.variable_lever_contacts) for c in shared))
    for (n, c), name in names.items():
        s.bound_names[unknowns[n].symbols[c]] = name


def emit_elimination(
    s: ExpressionPrinter,
    rows: list[Contact],
    A: dict[tuple[Contact, Contact], str],
    sides: list[dict[Contact, str]],
    has_variable_levers: bool,
) -> None:
    """Emit a Gaussian elimination that overwrites the right-hand sides with the solutions.

    It needs no pivoting: the rows of stuck contacts belong to a positive definite matrix, so no pivot is zero, unless
    the lever of a contact vanishes.
    """
    for n, k in enumerate(rows):
        if has_variable_levers:
            with s.block(f"if not fabs({A[k, k]}) > {SMALLEST_DIVISOR!r}:"):
                s.emit(f"{A[k, k]} = {SMALLEST_DIVISOR!r}")
        for i in rows[n + 1 :]:
            s.emit(f"{A[i, k]} = {A[i, k]} / {A[k, k]}")
            for j in rows[n + 1 :]:
                s.emit(f"{A[i, j]} = {A[i, j]} - {A[i, k]} * {A[k, j]}")
            for b in sides:
                s.emit(f"{b[i]} = {b[i]} - {A[i, k]} * {b[k]}")
    for n, k in reversed(list(enumerate(rows))):
        for b in sides:
            terms = "".join(f" - {A[k, j]} * {b[j]}" for j in rows[n + 1 :])
            s.emit(f"{b[k]} = {f'({b[k]}{terms})' if terms else b[k]} / {A[k, k]}")


# ---- the methods


def emit_friction_forces(f: CodegenContext, s: ExpressionPrinter) -> None:
    """Emit the forces and modes under the selected law."""
    contacts = [c for c in f.an.contacts if len(c.laws) > 1]
    if contacts:
        with s.block("if self.friction != HYBRID:"):
            for c in contacts:
                slip, near = s.text(c.slip), f" if fabs({s.text(c.slip)}) >= {s.text(c.eps)} else 0"
                s.emit(f"{c.mode.name} = sign({slip}){near if THRESHOLD in c.laws else ''}")
    emit_solution(f, s, [force_unknown(f)], law=True)
    for c in contacts:
        if THRESHOLD in c.laws:
            with s.block(f"if {c.mode.name} == 0 and self.friction != HYBRID:"):
                s.emit(f"{c.name} = threshold(0.0, 1.0, {c.name}, 0.0, {s.text(f.an.holding_limit[c])})")


def slip_scale_method(f: CodegenContext) -> str:
    """Rounding scales of the slips."""
    s = f.printer()
    sizes = emit_scales(f, s, [rounding_scale(c.slip) for c in f.an.contacts])
    f.emit_driver(s, sizes)
    return method_source("slip_magnitudes", ["t", *f.states], emit_return(s, sizes))


def forces_method(f: CodegenContext) -> str:
    """Forces, limits and rounding scales of the forces."""
    an, s, u = f.an, f.printer(), force_unknown(f)
    sizes = [
        rounding_scale(an.load[c]) if c in an.load else build_term("/", rounding_scale(an.slip_rate[c]), an.divisor(c))
        for c in an.contacts
    ]
    limits = [an.holding_limit[c] for c in an.contacts]
    f.emit_driver(s, [*u.terms, *limits])
    s.count_uses(*u.terms, *limits, *sizes)
    emit_solution(f, s, [u])
    sizes = emit_scales(f, s, sizes)
    return method_source("contact_forces", f.arguments, emit_return(s, [*an.contacts, *limits, *sizes]))


def force_rates_method(f: CodegenContext) -> str:
    """Rates of forces and limits, residual forces that would hold the contacts, and their rates."""
    an, s, u, rate = f.an, f.printer(), force_unknown(f), derivative_unknown(f, "rate", f.an.time_derivatives)
    flow = an.time_derivatives | {c: rate.symbols[c] for c in an.contacts}
    pulls, pull_rates = [], []
    for c in an.contacts:
        if c in an.load:
            pulls.append(build_term("-", an.load[c], c))
            pull_rates.append(build_term("-", an.derivative(an.load[c], an.time_derivatives), rate.symbols[c]))
        else:
            pulls.append(build_term("/", an.slip_rate[c], an.divisor(c)))
            pull_rates.append(build_term("/", an.derivative(an.slip_rate[c], flow), an.divisor(c)))
    rates = [*rate.symbols.values(), *(an.derivative(an.holding_limit[c], an.time_derivatives) for c in an.contacts)]
    targets = [*rates, *pulls, *pull_rates]
    f.emit_driver(s, [*u.terms, *rate.terms, *targets])
    s.count_uses(*u.terms, *rate.terms, *targets)
    emit_solution(f, s, [u])
    emit_solution(f, s, [rate])
    return method_source("contact_rates", f.arguments, emit_return(s, targets))


def impulse_method(f: CodegenContext) -> str:
    """States after impulses that stop the slips of stuck contacts, exactly where slips are sums of speeds."""
    an, s = f.an, f.printer()
    ends = {c: c.slip if c not in an.load else build_term("/", c.slip, an.divisor(c)) for c in an.contacts}
    impulse = ContactUnknown(
        {c: local_symbol(f"impulse_{c.name}") for c in an.contacts}, dict.fromkeys(an.contacts, 0.0), ends
    )
    after: dict[State, Operand] = {}
    for state in an.dynamic_states:
        for c in an.contacts:
            effect = an.derivative(an.rate_outputs[state], {c: 1.0})
            if not is_same_expression(effect, 0.0):
                after[state] = build_term("+", after.get(state, state), build_term("*", effect, impulse.symbols[c]))
    f.emit_driver(s, [*impulse.terms, *after.values()])
    s.count_uses(*impulse.terms, *after.values())
    emit_solution(f, s, [impulse])
    s.emit(", ".join(e.name for e in after) + " = " + ", ".join(s.text(e) for e in after.values()))
    for c, state, value in an.stick_assignments:
        with s.block(f"if {c.mode.name} == 0:"):
            s.emit(f"{state.name} = {s.text(value)}")
    s.emit(f"return {', '.join(f.states)}")
    return method_source("apply_impulses", f.arguments, s.lines)
