"""The methods of a written-out model about the contact of its only body, and the force under the law in force."""

from .algebra import depends, derivative, put, size
from .declared import SIGN, THRESHOLD, Contact
from .expressions import Term
from .frame import Frame, method, place_sizes
from .scribe import Scribe


def friction(f: Frame) -> list[str]:
    """All of them."""
    c = f.alone
    return [] if c is None else [hold(f, c), *load_rate(f, c), terms(f, c), *departure(f, c)]


def hold(f: Frame, c: Contact) -> str:
    """The load on the body at rest, its rate, and the most that is held."""
    an = f.an
    wanted = [an.load[c], put(derivative(an.load[c], an.coasting), {c.slip: 0.0}), an.hold[c]]
    return method("stick_load", ["t", *f.states], f.returning(f.scribe(), wanted))


def load_rate(f: Frame, c: Contact) -> list[str]:
    """The n-th derivative of that load, as far as inputs make it."""
    ramps = f.an.ramps
    return [f.of_order("load_derivative", ["t", *f.states], [derivative(f.an.load[c], ramps)])] if ramps else []


def terms(f: Frame, c: Contact) -> str:
    """The sum of the sizes of what the load is made of."""
    s = f.scribe()
    (sizes,) = place_sizes(f, s, [size(f.an.load[c])])
    f.place_drive(s, [sizes])
    s.count(sizes)
    s.say(f"return {s.text(sizes)}")
    return method("load_magnitude", ["t", *f.states], s.lines)


def departure(f: Frame, c: Contact) -> list[str]:
    """The rate of the slip at a break-away, where the load is just the limit and friction falls to that of a slide."""
    if c.hold is None or any(depends(e, f.an.moving) for e in (c.slide, c.hold)):
        return []
    less = Term("neg", Term("*", c.mode, Term("-", c.hold, c.slide)))
    jump = derivative(f.an.law[c.slip].means, {c: less})
    return [method("breakaway_acceleration", f.point, f.returning(f.scribe(), [jump]))]


def under_the_law(f: Frame, s: Scribe, c: Contact) -> None:
    """The lines that calculate the force; the mode is told as the law has it."""
    load, mode, slip = f.an.load[c], c.mode.name, s.text(c.slip)
    held = s.hold(load) if isinstance(load, Term) else s.text(load)
    if THRESHOLD in c.laws:
        with s.block(f"if {mode} != 0:"):
            s.say(f"{c.name} = {s.text(Term('*', c.mode, c.slide))}")
        with s.block("elif self.friction == HYBRID:"):
            s.say(f"{c.name} = {held}")
        with s.block("else:"):
            s.say(f"{c.name} = {by_threshold(f, s, c)}")
            s.say(f"{mode} = sign({slip}) if fabs({slip}) >= {s.text(c.eps)} else 0")
    else:
        with s.block(f"if {mode} == 0{' and self.friction == HYBRID' if SIGN in c.laws else ''}:"):
            s.say(f"{c.name} = {held}")
        with s.block("else:"):
            f.follow_sign(s, c, [c.mode])
            s.say(f"{c.name} = {s.text(Term('*', c.mode, c.slide))}")
    s.given[c] = c.name


def by_threshold(f: Frame, s: Scribe, c: Contact) -> str:
    """The force by the threshold law."""
    return f"threshold({', '.join(map(s.text, (c.slip, c.eps, f.an.load[c], c.slide, f.an.hold[c])))})"
