"""What the methods of a written-out model share: its parts by role, its constants, and how a method returns."""

from collections.abc import Sequence

from .algebra import depends, inside, made, same
from .anatomy import TIME, Anatomy
from .declared import Choice, Contact
from .expressions import Expression, Operand, Term
from .scribe import INDENT, Scribe

LONG = 100  # letters in a line


class Frame:
    """A model that the solver can run: one position, its speed, at most one driver and one contact."""

    def __init__(self, an: Anatomy) -> None:
        self.an = an
        (self.x,), (self.v,) = an.positions, an.own
        self.rate = an.law[self.v]
        self.drive = an.drives[0] if an.drives else None
        self.contact: Contact | None = an.contacts[0] if an.contacts else None
        taken = {e.name for e in an.declared}
        self.mode = "mode_" if "mode" in taken else "mode"
        if self.contact is not None:
            c, self.mode = self.contact, self.contact.mode.name
            for name, e in ("load", an.load[c]), ("slide", c.slide), ("limit", an.hold[c]):
                if isinstance(e, Term) and not e.name and name not in taken:
                    e.name = name
        self.states = self.x.name, self.v.name
        self.point = "t", *self.states, self.mode
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
            for e in (c.slide, an.hold[c], c.eps):
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
        """Where the driver is, if that is needed."""
        if self.drive is not None and any(depends(e, (self.drive,)) for e in targets):
            s.given[self.drive] = self.drive.name
            s.say(f"{self.drive.name} = self.x_base + self.{self.drive.steady.name} * (t - self.t_base)")

    def follow_sign(self, s: Scribe, targets: Sequence[Operand]) -> None:
        """Where the law itself looks at the speed, that tells the direction."""
        c = self.contact
        if c is not None and len(c.laws) > 1 and any(depends(e, (c.mode,)) for e in targets):
            with s.block(f"if {self.mode} == 0:"):
                s.say(f"{self.mode} = sign({self.v.name})")

    def returning(self, s: Scribe, targets: Sequence[Operand]) -> list[str]:
        """The lines that return the targets: one block for each item of a choice that they look at."""
        test = next((found for e in targets if (found := choice_in(e)) is not None), None)
        if test is None:
            self.place_drive(s, targets)
            s.count(*targets)
            texts = list(map(s.text, targets))
            if sum(map(len, texts)) <= LONG:
                s.say("return " + ", ".join(texts))
            else:
                with s.block("return ("):
                    for text in texts:
                        s.say(f"{text},")
                s.say(")")
            return s.lines
        with s.block(f"if {s.text(test)}:"):
            s.lines += self.returning(self.scribe(s.depth), [decided(e, test, True) for e in targets])
        return s.lines + self.returning(self.scribe(s.depth), [decided(e, test, False) for e in targets])


def method(name: str, arguments: Sequence[str], lines: list[str]) -> str:
    """The text of a method."""
    return "\n".join([f"{INDENT}def {name}({', '.join(('self', *arguments))}):", *lines])


def choice_in(e: Operand) -> Term | None:
    """A test of a choice in an expression."""
    if isinstance(e, Term) and e.op == "==" and isinstance(e.args[0], Choice):
        return e
    return next((found for one in inside(e) if (found := choice_in(one)) is not None), None)


def decided(e: Operand, test: Term, holds: bool) -> Operand:
    """The expression where a test has been settled."""
    if isinstance(e, Term) and e.op == "choose" and same(e.args[0], test):
        return decided(e.args[1 if holds else 2], test, holds)
    if not isinstance(e, Expression) or choice_in(e) is None:
        return e
    found = [decided(one, test, holds) for one in inside(e)]
    return made(e.op, *found) if isinstance(e, Term) else found[0]
