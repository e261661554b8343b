"""The methods of a written-out model that solvers ask: rates, Jacobian, constant push."""

from .algebra import put
from .declared import THRESHOLD, Contact
from .expressions import Expression, Operand, Term
from .frame import Frame, method, returned
from .friction import by_threshold, under_the_law
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
    elif an.contacts:
        f.place_drive(s, [*targets, *an.load.values()])
        s.count(*targets, *an.load.values(), *(each for one in an.contacts for each in (one.slide, one.slide)))
        for one in an.contacts:
            force(f, s, one)
        return method("rates", f.point, returned(s, targets))
    return method("rates", f.point, f.returning(s, targets))


def force(f: Frame, s: Scribe, c: Contact) -> None:
    """The force of a contact, at a mode that it may have here."""
    if f.alone is None:
        under_the_law(f, s, c)
    else:
        s.count(f.an.hold[c])
        sliding = s.text(Term("*", c.mode, c.slide))
        s.say(f"{c.name} = {sliding} if {c.mode.name} != 0 else {by_threshold(f, s, c)}")
        s.given[c] = c.name


def jacobian(f: Frame) -> str:
    """For each of these rates its derivatives by time and by each state."""
    an, s, c = f.an, f.scribe(), f.alone
    ways: list[dict[Expression, Operand]] = [an.by_time, *({state: 1.0} for state in an.states)]
    if c is None:
        return method("jacobian", f.point, f.returning(s, [an.either(law, by) for law in f.laws for by in ways]))
    targets = [an.sliding(law, by) for law in f.laws for by in ways]
    if THRESHOLD in c.laws:
        with s.block(f"if {c.mode.name} == 0 and fabs({s.text(c.slip)}) < {s.text(c.eps)}:"):
            inner = f.scribe(s.depth)
            f.place_drive(inner, [an.load[c]])
            with inner.block(f"if fabs({inner.text(an.load[c])}) <= {inner.text(an.hold[c])}:"):
                inner.say("return " + ", ".join(inner.text(an.held(law, by)) for law in f.laws for by in ways))
            s.lines += inner.lines
    f.follow_sign(s, c, targets)
    return method("jacobian", f.point, f.returning(s, targets))


def push(f: Frame) -> list[str]:
    """Where the motion has a closed form: its constants, and the part of the rate that is there where all states are
    zero."""
    if not f.an.closed_form:
        return []
    targets = [law.means for law in f.laws]
    targets = targets if f.alone is None else sliding_now(f.alone, targets)
    at_zero = dict.fromkeys(f.an.states, 0.0)
    piece = method("piece", (), f.returning(f.scribe(), f.an.closed_form))
    return [piece, method("push", ["t", *f.modes], f.returning(f.scribe(), [put(e, at_zero) for e in targets]))]


def sliding_now(c: Contact, targets: list[Operand]) -> list[Operand]:
    """Expressions with the force of a contact that slides."""
    return [put(e, {c: Term("*", c.mode, c.slide)}) for e in targets]
