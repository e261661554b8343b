"""The methods of a written-out model that solvers ask: rates, Jacobian, constant push."""

from .algebra import put
from .declared import THRESHOLD
from .expressions import Expression, Operand, Term
from .frame import Frame, method
from .friction import by_threshold


def motion(f: Frame) -> list[str]:
    """All of them."""
    return [rates(f), jacobian(f), *push(f)]


def rates(f: Frame) -> str:
    """The rate of the speed."""
    s, c, target = f.scribe(), f.contact, f.rate.means
    if c is not None and THRESHOLD in c.laws:
        load = f.an.load[c]
        f.place_drive(s, [target, load])
        s.count(target, load, c.slide, c.slide, f.an.hold[c])
        sliding = s.text(Term("*", c.mode, c.slide))
        s.say(f"{c.name} = {sliding} if {f.mode} != 0 else {by_threshold(f, s, c)}")
        s.given[c] = c.name
        s.say(f"return {s.text(target)}")
        return method("rates", f.point, s.lines)
    target = sliding_now(f, target)
    f.follow_sign(s, [target])
    return method("rates", f.point, f.returning(s, [target]))


def jacobian(f: Frame) -> str:
    """Derivatives of that rate by time and by each state."""
    an, s, c = f.an, f.scribe(), f.contact
    ways: list[dict[Expression, Operand]] = [an.by_time, {f.x: 1.0}, {f.v: 1.0}]
    targets = [an.sliding(f.rate, by) for by in ways]
    if c is not None and THRESHOLD in c.laws:
        with s.block(f"if {f.mode} == 0 and fabs({f.v.name}) < {s.text(c.eps)}:"):
            inner = f.scribe(s.depth)
            f.place_drive(inner, [an.load[c]])
            with inner.block(f"if fabs({inner.text(an.load[c])}) <= {inner.text(an.hold[c])}:"):
                inner.say("return " + ", ".join(inner.text(an.held(f.rate, by)) for by in ways))
            s.lines += inner.lines
    f.follow_sign(s, targets)
    return method("jacobian", f.point, f.returning(s, targets))


def push(f: Frame) -> list[str]:
    """The part of the rate that is there at zero position and speed, where the motion has a closed form."""
    if not f.an.closed_form:
        return []
    target = put(sliding_now(f, f.rate.means), {f.x: 0.0, f.v: 0.0})
    return [method("push", ["t", f.mode], f.returning(f.scribe(), [target]))]


def sliding_now(f: Frame, e: Operand) -> Operand:
    """An expression with the force of a contact that slides."""
    c = f.contact
    return e if c is None else put(e, {c: Term("*", c.mode, c.slide)})
