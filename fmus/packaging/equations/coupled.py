"""The methods of a written-out model about its contacts where one may be stuck while something moves.

What stuck contacts bear makes the rates of their slips zero.  A contact that acts on no other's slip has its load in
closed form; for the others one linear system is solved, of which a sliding contact has the row F = mode slide.  Rates,
derivatives and impulses of the forces obey systems of the same matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from .algebra import derivative, made, put, same, size
from .declared import SIGN, THRESHOLD, Contact, State
from .expressions import Expression, Operand, Term
from .frame import Frame, method, place_sizes, returned
from .scribe import Scribe


@dataclass
class Unknown:
    """A number of each contact: the expression that stands for it; what it is where the contact slides; and what
    follows where it is stuck, its value or, of contacts that share bodies, the right-hand side."""

    stands: dict[Contact, Operand]
    slides: dict[Contact, Operand]
    held: dict[Contact, Operand]

    @property
    def terms(self) -> list[Operand]:
        return [*self.slides.values(), *self.held.values()]


def coupled(f: Frame) -> list[str]:
    """All of them."""
    if f.alone is not None or not f.an.contacts:
        return []
    slips = [c.slip for c in f.an.contacts]
    return [
        method("slip_velocities", ["t", *f.states], f.returning(f.scribe(), slips)),
        slip_terms(f),
        forces(f),
        changes(f),
        struck(f),
    ]


# ---- what is solved


def force(f: Frame) -> Unknown:
    """The forces themselves."""
    an = f.an
    none = dict.fromkeys(an.contacts, 0.0)
    held = {c: an.load[c] if c in an.lonely else put(an.slip_rate[c], none) for c in an.contacts}
    return Unknown({c: c for c in an.contacts}, {c: Term("*", c.mode, c.slide) for c in an.contacts}, held)


def slope(f: Frame, name: str, by: dict[Expression, Operand]) -> Unknown:
    """The derivatives of the forces along `by`."""
    an, fixed = f.an, by | dict.fromkeys(f.an.contacts, 0.0)
    slides = {c: made("*", c.mode, derivative(c.slide, by)) for c in an.contacts}
    held = {
        c: derivative(an.load[c], by) if c in an.lonely else derivative(an.slip_rate[c], fixed) for c in an.contacts
    }
    zero = {
        c: [slides[c], held[c], *([derivative(an.hold[c], by)] if THRESHOLD in c.laws else [])] for c in an.contacts
    }
    none = {c for c in an.contacts if all(same(e, 0.0) for e in zero[c])}
    none = none if none.issuperset(an.shared) else none & {*an.lonely}
    return Unknown({c: 0.0 if c in none else leaf(f"{name}_{c.name}") for c in an.contacts}, slides, held)


def leaf(name: str) -> Expression:
    """What stands for a local variable."""
    made = Expression()
    made.name = name
    return made


def solve(f: Frame, s: Scribe, unknowns: Sequence[Unknown], law: bool = False) -> None:
    """The lines that calculate them; with `law`, the law in force says what is stuck."""
    shared = f.an.shared
    matrix = {(c, d): s.fresh(f"A_{c.name}_{d.name}") for c in shared for d in shared}
    names = {
        (n, c): c.name if e is c else s.fresh(e.name)
        for n, u in enumerate(unknowns)
        for c, e in u.stands.items()
        if isinstance(e, Expression)
    }
    for n, c in names:
        if s.is_shared(unknowns[n].held[c]):
            s.hold(unknowns[n].held[c])
    for c in f.an.contacts:
        own = [n for n in range(len(unknowns)) if (n, c) in names]
        test = f"{c.mode.name} == 0" + (" and self.friction == HYBRID" if law and SIGN in c.laws else "")
        for head, words in ((f"if {test}:", "held"), ("else:", "slides")) if own else ():
            with s.block(head):
                for n in own:
                    s.say(f"{names[n, c]} = {s.text(getattr(unknowns[n], words)[c])}")
                for d in shared if c in shared else []:
                    s.say(f"{matrix[c, d]} = {s.text(f.an.A[c, d] if words == 'held' else float(c is d))}")
    sides = [{c: names[n, c] for c in shared} for n in range(len(unknowns)) if all((n, c) in names for c in shared)]
    eliminate(s, shared, matrix, sides)
    for (n, c), name in names.items():
        s.given[unknowns[n].stands[c]] = name


def eliminate(
    s: Scribe, rows: list[Contact], A: dict[tuple[Contact, Contact], str], sides: list[dict[Contact, str]]
) -> None:
    """Lines that put the solutions in the places of the right-hand sides.

    No rows are exchanged: the rows of stuck contacts are those of a positive definite matrix, so no pivot is zero.
    """
    for n, k in enumerate(rows):
        for i in rows[n + 1 :]:
            s.say(f"{A[i, k]} = {A[i, k]} / {A[k, k]}")
            for j in rows[n + 1 :]:
                s.say(f"{A[i, j]} = {A[i, j]} - {A[i, k]} * {A[k, j]}")
            for b in sides:
                s.say(f"{b[i]} = {b[i]} - {A[i, k]} * {b[k]}")
    for n, k in reversed(list(enumerate(rows))):
        for b in sides:
            behind = "".join(f" - {A[k, j]} * {b[j]}" for j in rows[n + 1 :])
            s.say(f"{b[k]} = {f'({b[k]}{behind})' if behind else b[k]} / {A[k, k]}")


# ---- the methods


def follow_law(f: Frame, s: Scribe) -> None:
    """The forces under the law in force, and the modes as it has them."""
    contacts = [c for c in f.an.contacts if len(c.laws) > 1]
    if contacts:
        with s.block("if self.friction != HYBRID:"):
            for c in contacts:
                slip, near = s.text(c.slip), f" if fabs({s.text(c.slip)}) >= {s.text(c.eps)} else 0"
                s.say(f"{c.mode.name} = sign({slip}){near if THRESHOLD in c.laws else ''}")
    solve(f, s, [force(f)], law=True)
    for c in contacts:
        if THRESHOLD in c.laws:
            with s.block(f"if {c.mode.name} == 0 and self.friction != HYBRID:"):
                s.say(f"{c.name} = threshold(0.0, 1.0, {c.name}, 0.0, {s.text(f.an.hold[c])})")


def slip_terms(f: Frame) -> str:
    s = f.scribe()
    sizes = place_sizes(f, s, [size(c.slip) for c in f.an.contacts])
    f.place_drive(s, sizes)
    return method("slip_magnitudes", ["t", *f.states], returned(s, sizes))


def forces(f: Frame) -> str:
    """Forces, limits, and the sums of the sizes of what the forces are made of."""
    an, s, u = f.an, f.scribe(), force(f)
    sizes = [size(an.load[c]) if c in an.lonely else made("/", size(an.slip_rate[c]), an.A[c, c]) for c in an.contacts]
    limits = [an.hold[c] for c in an.contacts]
    f.place_drive(s, [*u.terms, *limits])
    s.count(*u.terms, *limits, *sizes)
    solve(f, s, [u])
    sizes = place_sizes(f, s, sizes)
    return method("contact_forces", f.point, returned(s, [*an.contacts, *limits, *sizes]))


def changes(f: Frame) -> str:
    """Rates of forces and limits; what a force lacks to hold its contact, and the rate of that."""
    an, s, u, rate = f.an, f.scribe(), force(f), slope(f, "rate", f.an.flow)
    flow = an.flow | {c: rate.stands[c] for c in an.contacts}
    pulls, pull_rates = [], []
    for c in an.contacts:
        if c in an.lonely:
            pulls.append(made("-", an.load[c], c))
            pull_rates.append(made("-", derivative(an.load[c], an.flow), rate.stands[c]))
        else:
            pulls.append(made("/", an.slip_rate[c], an.A[c, c]))
            pull_rates.append(made("/", derivative(an.slip_rate[c], flow), an.A[c, c]))
    rates = [*rate.stands.values(), *(derivative(an.hold[c], an.flow) for c in an.contacts)]
    targets = [*rates, *pulls, *pull_rates]
    f.place_drive(s, [*u.terms, *rate.terms, *targets])
    s.count(*u.terms, *rate.terms, *targets)
    solve(f, s, [u])
    solve(f, s, [rate])
    return method("contact_rates", f.point, returned(s, targets))


def struck(f: Frame) -> str:
    """The states after impulses that end the slips of stuck contacts, to the last bit where these are sums."""
    an, s = f.an, f.scribe()
    ends = {c: c.slip if c not in an.lonely else made("/", c.slip, an.A[c, c]) for c in an.contacts}
    impulse = Unknown({c: leaf(f"impulse_{c.name}") for c in an.contacts}, dict.fromkeys(an.contacts, 0.0), ends)
    after: dict[State, Operand] = {}
    for state in an.own:
        for c in an.contacts:
            acts = derivative(an.law[state], {c: 1.0})
            if not same(acts, 0.0):
                after[state] = made("+", after.get(state, state), made("*", acts, impulse.stands[c]))
    f.place_drive(s, [*impulse.terms, *after.values()])
    s.count(*impulse.terms, *after.values())
    solve(f, s, [impulse])
    s.say(", ".join(e.name for e in after) + " = " + ", ".join(s.text(e) for e in after.values()))
    for c, state, value in an.pins:
        with s.block(f"if {c.mode.name} == 0:"):
            s.say(f"{state.name} = {s.text(value)}")
    s.say(f"return {', '.join(f.states)}")
    return method("apply_impulses", f.point, s.lines)
