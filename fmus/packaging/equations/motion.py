"""The methods of a written-out model that solvers ask: rates, Jacobian, constant push."""

from .algebra import depends, derivative, made, put
from .coupled import follow_law, force, slope, solve
from .declared import THRESHOLD, Contact
from .expressions import Expression, Operand, Term
from .frame import Frame, method, returned
from .friction import by_threshold
from .scribe import Scribe


def motion(f: Frame) -> list[str]:
    """All of them."""
    return [rates(f), jacobian(f), *push(f)]


def rates(f: Frame) -> str:
    """The rates that are no states, in the order of these."""
    an, s, c = f.an, f.scribe(), f.alone
    targets = [law.means for law in f.laws]
    if c is not None and THRESHOLD not in c.laws:
        targets = sliding_now(c, targets)
        f.follow_sign(s, c, targets)
    elif c is not None:
        f.place_drive(s, [*targets, an.load[c]])
        s.count(*targets, an.load[c], c.slide, c.slide, an.hold[c])
        sliding = s.text(Term("*", c.mode, c.slide))
        s.say(f"{c.name} = {sliding} if {c.mode.name} != 0 else {by_threshold(f, s, c)}")
        s.given[c] = c.name
        return method("rates", f.point, returned(s, targets))
    elif an.contacts:
        terms = force(f).terms
        f.place_drive(s, [*targets, *terms])
        s.count(*targets, *terms)
        follow_law(f, s)
        return method("rates", f.point, returned(s, targets))
    return method("rates", f.point, f.returning(s, targets))


def jacobian(f: Frame) -> str:
    """For each of these rates its derivatives by time and by each state."""
    an, s, c = f.an, f.scribe(), f.alone
    ways: list[dict[Expression, Operand]] = [an.by_time | an.ramps, *({state: 1.0} for state in an.states)]
    if c is None and an.contacts:
        return method("jacobian", f.point, slopes(f, s, ways))
    if c is None:
        return method("jacobian", f.point, f.returning(s, [derivative(law, by) for law in f.laws for by in ways]))
    targets = [an.sliding(law, by) for law in f.laws for by in ways]
    if THRESHOLD in c.laws:
        with s.block(f"if {c.mode.name} == 0 and fabs({s.text(c.slip)}) < {s.text(c.eps)}:"):
            inner = f.scribe(s.depth)
            held = [an.held(law, by) for law in f.laws for by in ways]
            f.place_drive(inner, [an.load[c], *held])
            with inner.block(f"if fabs({inner.text(an.load[c])}) <= {inner.text(an.hold[c])}:"):
                inner.say("return " + ", ".join(map(inner.text, held)))
            s.lines += inner.lines
            if depends(c.slide, an.moving) or depends(an.hold[c], an.moving):
                limits = [by | {c: limited(f, c, by)} for by in ways]
                s.lines += f.returning(f.scribe(s.depth), [derivative(law, by) for law in f.laws for by in limits])
    f.follow_sign(s, c, targets)
    return method("jacobian", f.point, f.returning(s, targets))


def slopes(f: Frame, s: Scribe, ways: list[dict[Expression, Operand]]) -> list[str]:
    """The lines that return the derivatives of the rates where some contacts slide and others hold."""
    forces = [slope(f, f"by_{next(iter(by)).name}", by) for by in ways]
    targets = [derivative(law, by | u.stands) for law in f.laws for by, u in zip(ways, forces, strict=True)]
    terms = [e for u in (force(f), *forces) for e in u.terms]
    f.place_drive(s, [*terms, *targets])
    s.count(*terms, *targets)
    follow_law(f, s)
    solve(f, s, forces, law=True)
    for c in f.an.contacts:
        known = [(u.stands[c], by) for u, by in zip(forces, ways, strict=True) if isinstance(u.stands[c], Expression)]
        if THRESHOLD in c.laws and known:
            clips = f"fabs({c.name}) >= {s.text(f.an.hold[c])}"
            with s.block(f"if {c.mode.name} == 0 and self.friction != HYBRID and {clips}:"):
                for e, by in known:
                    s.say(f"{s.text(e)} = {s.text(limited(f, c, by))}")
    return returned(s, targets)


def limited(f: Frame, c: Contact, by: dict[Expression, Operand]) -> Operand:
    """The derivative of a force that the threshold law limits."""
    force = c if f.alone is None else f.an.load[c]
    return made("*", Term("copysign", 1.0, force), derivative(f.an.hold[c], by))


def push(f: Frame) -> list[str]:
    """Where the motion has a closed form: its constants, and the part of the rate that is there where all states are
    zero."""
    if not f.an.closed_form:
        return []
    targets = [law.means for law in f.laws]
    targets = targets if f.alone is None else sliding_now(f.alone, targets)
    at_zero = dict.fromkeys(f.an.states, 0.0)
    piece = method("linear_coefficients", (), f.returning(f.scribe(), f.an.closed_form))
    return [
        piece,
        *[f.of_order("applied_acceleration_derivative", ["t"], [derivative(f.laws[0].means, f.an.ramps)])]
        * bool(f.an.ramps),
        method("applied_acceleration", ["t", *f.modes], f.returning(f.scribe(), [put(e, at_zero) for e in targets])),
    ]


def sliding_now(c: Contact, targets: list[Operand]) -> list[Operand]:
    """Expressions with the force of a contact that slides."""
    return [put(e, {c: Term("*", c.mode, c.slide)}) for e in targets]
