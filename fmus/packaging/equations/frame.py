"""What the methods of a written-out model share: its parts by role, its constants, and how a method returns."""

from collections.abc import Sequence

from .algebra import depends, inside, parts, put
from .anatomy import TIME, Anatomy
from .declared import Contact
from .expressions import Expression, Operand, Term
from .scribe import INDENT, Scribe

LONG = 100  # letters in a line


class Frame:
    """A model of any states and contacts."""

    def __init__(self, an: Anatomy) -> None:
        self.an = an
        self.laws = [an.law[s] for s in an.own]  # the rates that must be calculated
        self.drive = an.drives[0] if an.drives else None
        taken = {e.name for e in an.declared}
        for c in an.contacts:
            for name, e in ("load", an.load.get(c)), ("slide", c.slide), ("limit", an.hold[c]):
                name += "" if an.waits else f"_{c.name}"
                if isinstance(e, Term) and not e.name and name not in taken:
                    e.name = name
        for (c, d), e in an.A.items():
            if isinstance(e, Term) and not e.name and not depends(e, an.inputs) and f"A_{c.name}_{d.name}" not in taken:
                e.name = f"A_{c.name}_{d.name}"
        self.states = [s.name for s in an.states]
        self.modes = [c.mode.name for c in an.contacts]
        self.point = ["t", *self.states, *self.modes]
        self.taken = taken | {"self", *self.point}
        self.constants = self._constants()

    def _constants(self) -> list[Term]:
        """Named expressions of parameters alone that the motion needs: prepare() calculates them."""
        an, found = self.an, {}

        def walk(e: Operand) -> None:
            if isinstance(e, Term) and e.name and not depends(e, (*an.moving, *an.inputs)):
                found[id(e)] = e
            else:
                for one in inside(e):
                    walk(one)

        for c in an.contacts:
            for e in (c.slide, an.hold[c], c.eps, *(an.A[c, d] for d in an.contacts if not an.waits)):
                walk(e)
        for e in an.outputs:
            walk(e)
        return list(found.values())

    def scribe(self, depth: int = 2) -> Scribe:
        """The lines of a method, or of a block in it."""
        an = self.an
        given = {s: s.name for s in an.states} | {m: m.name for m in an.modes} | {TIME: "t"}
        return Scribe(given, self.constants, self.taken, depth)

    def place_drive(self, s: Scribe, targets: Sequence[Operand]) -> None:
        """Where the driver is, and what an input that has a rate is, if that is needed."""
        for e, rate in self.an.ramps.items():
            course = f"self.{e.name}_polynomial"
            if e not in s.given and any(depends(one, (e,)) for one in targets):
                s.given[e] = e.name
                s.say(f"{e.name} = {course}.value_at(t - self.t_base)")
            if rate not in s.given and any(depends(one, (rate,)) for one in targets):
                s.given[rate] = rate.name
                s.say(f"{rate.name} = {course}.rate_at(t - self.t_base)")
        if self.drive is not None and any(depends(e, (self.drive,)) for e in targets):
            s.given[self.drive] = self.drive.name
            s.say(f"{self.drive.name} = self.x_base + self.{self.drive.steady.name} * (t - self.t_base)")

    def of_order(self, name: str, arguments: Sequence[str], targets: Sequence[Operand]) -> str:
        """The text of a method that returns targets in which n-th derivatives of inputs stand for their rates."""
        s = self.scribe()
        n = s.fresh("n")
        for e, rate in self.an.ramps.items():
            s.given[rate] = rate.name
            s.say(f"{rate.name} = self.{e.name}_polynomial.derivative_at(t - self.t_base, {n})")
        return method(name, [*arguments, n], self.returning(s, targets))

    @property
    def alone(self) -> Contact | None:
        """The contact of a single body: nothing moves while it is stuck, and nobody asks for rates then."""
        return self.an.contacts[0] if self.an.waits else None

    def follow_sign(self, s: Scribe, c: Contact, targets: Sequence[Operand]) -> None:
        """Where the law itself looks at the slip, that tells the direction."""
        if len(c.laws) > 1 and any(depends(e, (c.mode,)) for e in targets):
            with s.block(f"if {c.mode.name} == 0:"):
                s.say(f"{c.mode.name} = sign({s.text(c.slip)})")

    def returning(self, s: Scribe, targets: Sequence[Operand]) -> list[str]:
        """The lines that return the targets: one block for each item of a choice that they look at."""
        test = next((found for e in targets if (found := choice_in(e)) is not None), None)
        if test is None:
            self.place_drive(s, targets)
            s.count(*targets)
            return returned(s, targets)
        with s.block(f"if {s.text(test)}:"):
            s.lines += self.returning(self.scribe(s.depth), [put(e, {test: True}) for e in targets])
        return s.lines + self.returning(self.scribe(s.depth), [put(e, {test: False}) for e in targets])


def returned(s: Scribe, targets: Sequence[Operand]) -> list[str]:
    """The lines, of which the last return the targets."""
    texts = list(map(s.text, targets))
    if sum(map(len, texts)) <= LONG:
        s.say("return " + ", ".join(texts))
    else:
        with s.block("return ("):
            for text in texts:
                s.say(f"{text},")
        s.say(")")
    return s.lines


def place_sizes(f: Frame, s: Scribe, sizes: list[Operand]) -> list[Operand]:
    """Sizes of what is added up, where the driver's is that of what his position is made of."""
    drive = f.drive
    if drive is None or not any(depends(e, (drive,)) for e in sizes):
        return sizes
    reach = Expression()
    reach.name = drive.name if drive not in s.given else s.fresh(f"reach_of_{drive.name}")
    s.say(f"{reach.name} = fabs(self.x_base) + fabs(self.{drive.steady.name}) * (fabs(t) + fabs(self.t_base))")
    s.given[reach] = reach.name
    return [put(e, {one: reach for one in parts(e).values() if is_size(one, drive)}) for e in sizes]


def is_size(e: Operand, drive: Expression) -> bool:
    """Whether this asks for the size of the position of a driver."""
    return isinstance(e, Term) and e.op == "fabs" and e.args[0] is drive


def method(name: str, arguments: Sequence[str], lines: list[str]) -> str:
    """The text of a method."""
    return "\n".join([f"{INDENT}def {name}({', '.join(('self', *arguments))}):", *lines])


def choice_in(e: Operand) -> Term | None:
    """A test of a choice in an expression."""
    return next((one for one in parts(e).values() if isinstance(one, Term) and one.op == "=="), None)
