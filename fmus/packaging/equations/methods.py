"""The methods of a written-out model: what the runtime asks, in the names of the author."""

from collections.abc import Sequence

from .algebra import depends, derivative, inside, made, put, same, size
from .anatomy import TIME, Anatomy
from .declared import SIGN, THRESHOLD, Choice, Contact
from .expressions import Expression, Operand, Term
from .scribe import INDENT, Scribe

LONG = 100  # letters in a line

Values = list[Operand]


class Methods:
    """The text of every method of a model that the solver can run: one position, its speed, at most one contact."""

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
        self.kept = self._constants()

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

    def text(self) -> str:
        """All methods, in the order of today's hand."""
        parts = [self.init(), self.initial(), self.prepare(), self.finest(), self.speed_of_drive()]
        parts += [self.rates(), self.jacobian(), self.push(), *self.friction(), self.observe()]
        return "\n\n".join(part for part in parts if part)

    # ---- pieces

    def scribe(self) -> Scribe:
        an = self.an
        given = {s: s.name for s in an.states} | {m: m.name for m in an.modes} | {TIME: "t"}
        return Scribe(given, self.kept, {e.name for e in an.declared} | {"t", "self", self.mode})

    def place_drive(self, s: Scribe, targets: Sequence[Operand]) -> None:
        """Where the driver is, if that is needed."""
        if self.drive is not None and any(depends(e, (self.drive,)) for e in targets):
            s.given[self.drive] = self.drive.name
            s.say(f"{self.drive.name} = self.x_base + self.{self.drive.steady.name} * (t - self.t_base)")

    def method(self, name: str, *arguments: str, lines: list[str], about: str = "") -> str:
        head = [f"{INDENT}def {name}({', '.join(('self', *arguments))}):"]
        return "\n".join([*head, *([f'{INDENT * 2}"""{about}"""'] if about else []), *lines])

    def returning(self, s: Scribe, targets: Values) -> list[str]:
        """The lines that return the targets: one block for each item of a choice that they look at."""
        test = next((found for e in targets if (found := choice_in(e)) is not None), None)
        if test is None:
            self.place_drive(s, targets)
            s.count(*targets)
            texts = list(map(s.text, targets))
            if sum(map(len, texts)) > LONG:
                with s.block("return ("):
                    for text in texts:
                        s.say(f"{text},")
                s.say(")")
            else:
                s.say("return " + ", ".join(texts))
            return s.lines
        with s.block(f"if {s.text(test)}:"):
            inner = self.scribe()
            inner.depth = s.depth
            s.lines += self.returning(inner, [decided(e, test, True) for e in targets])
        other = self.scribe()
        other.depth = s.depth
        return s.lines + self.returning(other, [decided(e, test, False) for e in targets])

    def follow_sign(self, s: Scribe, targets: Sequence[Operand]) -> None:
        """Where the law itself looks at the speed, that tells the direction."""
        if (
            self.contact is not None
            and len(self.contact.laws) > 1
            and any(depends(e, (self.contact.mode,)) for e in targets)
        ):
            with s.block(f"if {self.mode} == 0:"):
                s.say(f"{self.mode} = sign({self.v.name})")

    # ---- values

    def init(self) -> str:
        lines = ["super().__init__()", "self.solver = Solver()"]
        if self.an.closed_form:
            lines.append("self.exact = Exact()")
        if self.drive is not None:
            lines.append("self.t_base = self.x_base = 0.0")
        if self.kept:
            lines.append(" = ".join(f"self.{e.name}" for e in self.kept) + " = 0.0")
        return self.method("__init__", lines=[INDENT * 2 + line for line in lines])

    def initial(self) -> str:
        s = self.scribe()
        if self.drive is not None:
            s.say("self.t_base, self.x_base = t, 0.0")
        s.say(f"return {s.text(float_of(self.x.begins))}, {s.text(float_of(self.v.begins))}")
        return self.method("initial", "t", lines=s.lines)

    def prepare(self) -> str:
        """A rule is judged as soon as it can be: what it refuses could not be divided by."""
        an, s = self.an, self.scribe()
        done: list[Term] = []
        s.kept = done
        first = 2 if self.contact is not None else 1
        s.count(*self.kept, *(rule.broken for rule in an.rules))

        def calculate(needed: set[int] | None = None) -> None:
            for e in self.kept:
                if (needed is None or id(e) in needed) and not any(e is one for one in done):
                    s.let(f"self.{e.name}", e)
                    done.append(e)

        for number, rule in enumerate(an.rules, first):
            calculate(parts(rule.broken))
            s.say(f"if {s.text(rule.broken)}:")
            s.say(f"{INDENT}return {number}")
        calculate()
        if an.closed_form:
            s.say(f"self.exact.prepare({', '.join(s.text(float_of(e)) for e in an.closed_form)})")
        s.say("return super().prepare()" if self.contact is not None else "return 0")
        return self.method("prepare", lines=s.lines)

    def finest(self) -> str:
        if self.v.finest is None:
            return ""
        s = self.scribe()
        return self.method("finest", lines=self.returning(s, [self.v.finest]))

    def speed_of_drive(self) -> str:
        if self.drive is None:
            return ""
        return self.method("drive", lines=[f"{INDENT * 2}return self.{self.drive.steady.name}"])

    # ---- motion

    def rates(self) -> str:
        s, c, target = self.scribe(), self.contact, self.rate.means
        arguments = ("t", self.x.name, self.v.name, self.mode)
        if c is not None and THRESHOLD in c.laws:
            load = self.an.load[c]
            self.place_drive(s, [target, load])
            s.count(target, load, c.slide, c.slide, self.an.hold[c])
            sliding = s.text(Term("*", c.mode, c.slide))
            s.say(f"{c.name} = {sliding} if {self.mode} != 0 else {self.held_by_threshold(s)}")
            s.given[c] = c.name
            s.say(f"return {s.text(target)}")
            return self.method("rates", *arguments, lines=s.lines)
        if c is not None:
            target = put(target, {c: Term("*", c.mode, c.slide)})
        self.follow_sign(s, [target])
        return self.method("rates", *arguments, lines=self.returning(s, [target]))

    def held_by_threshold(self, s: Scribe) -> str:
        c = self.contact
        assert c is not None
        load, slide, hold = (s.text(e) for e in (self.an.load[c], c.slide, self.an.hold[c]))
        return f"threshold({self.v.name}, {s.text(c.eps)}, {load}, {slide}, {hold})"

    def jacobian(self) -> str:
        """By time and by each state."""
        an, s, c = self.an, self.scribe(), self.contact
        ways: list[dict[Expression, Operand]] = [an.by_time, *({state: 1.0} for state in (self.x, self.v))]
        targets = [float_of(an.sliding(self.rate, by)) for by in ways]
        if c is not None and THRESHOLD in c.laws:
            with s.block(f"if {self.mode} == 0 and fabs({self.v.name}) < {s.text(c.eps)}:"):
                inner = self.scribe()
                inner.depth = s.depth
                self.place_drive(inner, [an.load[c]])
                with inner.block(f"if fabs({inner.text(an.load[c])}) <= {inner.text(an.hold[c])}:"):
                    held = [float_of(an.held(self.rate, by)) for by in ways]
                    inner.say("return " + ", ".join(map(inner.text, held)))
                s.lines += inner.lines
        self.follow_sign(s, targets)
        arguments = ("t", self.x.name, self.v.name, self.mode)
        return self.method("jacobian", *arguments, lines=self.returning(s, targets))

    def push(self) -> str:
        """The part of the acceleration that is there at zero position and speed."""
        if not self.an.closed_form:
            return ""
        target, c = self.rate.means, self.contact
        if c is not None:
            target = put(target, {c: Term("*", c.mode, c.slide)})
        target = put(target, {self.x: 0.0, self.v: 0.0})
        return self.method("push", "t", self.mode, lines=self.returning(self.scribe(), [float_of(target)]))

    def friction(self) -> list[str]:
        """The load at rest, its rate and what is held; the sizes of its terms; the start of a slide."""
        c = self.contact
        if c is None:
            return []
        load, hold, states = self.an.load[c], self.an.hold[c], (self.x.name, self.v.name)
        wanted = [load, float_of(derivative(load, self.an.by_time)), hold]
        parts = [self.method("hold", "t", *states, lines=self.returning(self.scribe(), list(map(float_of, wanted))))]
        parts.append(self.terms(size(load), states))
        if c.hold is not None and not any(depends(e, self.an.moving) for e in (c.slide, c.hold)):
            less = Term("neg", Term("*", c.mode, Term("-", c.hold, c.slide)))
            jump = derivative(self.rate.means, {c: less})
            parts.append(self.method("departure", "t", *states, self.mode, lines=self.returning(self.scribe(), [jump])))
        return parts

    def terms(self, sizes: Operand, states: tuple[str, ...]) -> str:
        s = self.scribe()
        if self.drive is not None and depends(sizes, (self.drive,)):
            way = f"fabs(self.{self.drive.steady.name}) * (fabs(t) + fabs(self.t_base))"
            s.say(f"{self.drive.name} = fabs(self.x_base) + {way}")
            sizes = put(sizes, dict.fromkeys(magnitudes(sizes, self.drive), self.drive))
            s.given[self.drive] = self.drive.name
        s.count(sizes)
        s.say(f"return {s.text(float_of(sizes))}")
        return self.method("terms", "t", *states, lines=s.lines)

    # ---- outputs

    def observe(self) -> str:
        """Sets the outputs, and says whether they are numbers."""
        an, s, c = self.an, self.scribe(), self.contact
        outputs = list(an.outputs)
        self.place_drive(s, outputs + [an.load[c] for c in an.contacts])
        s.count(*outputs, *outputs, *([an.load[c], an.load[c], c.slide] if c is not None else []))
        if c is not None:
            self.force(s, c)
        drives = [self.drive] if self.drive is not None else []
        if self.drive is not None and self.drive not in s.given:
            s.say(f"{self.drive.name} = self.x_base + self.{self.drive.steady.name} * (t - self.t_base)")
            s.given[self.drive] = self.drive.name
        for e in outputs:
            s.hold(e) if isinstance(e.means, Term) else None
        for e in (*an.states, *drives, *outputs, *an.contacts, *an.modes):
            s.say(f"self.{e.name} = {s.text(e)}")
        sizes = (s.text(e) if e.low >= 0.0 else f"fabs({s.text(e)})" for e in an.first_to_overflow)
        s.say(f"return {' + '.join(sizes)} < inf")
        return self.method("observe", "t", self.x.name, self.v.name, self.mode, lines=s.lines)

    def force(self, s: Scribe, c: Contact) -> None:
        """The force of friction under the law in force; the mode is told as that law has it."""
        mode, load = self.mode, self.an.load[c]
        held = s.hold(load) if isinstance(load, Term) else s.text(load)
        if THRESHOLD in c.laws:
            with s.block(f"if {mode} != 0:"):
                s.say(f"{c.name} = {s.text(Term('*', c.mode, c.slide))}")
            with s.block("elif self.friction == HYBRID:"):
                s.say(f"{c.name} = {held}")
            with s.block("else:"):
                s.say(f"{c.name} = {self.held_by_threshold(s)}")
                s.say(f"{mode} = sign({self.v.name}) if fabs({self.v.name}) >= {s.text(c.eps)} else 0")
        else:
            stuck = f"{mode} == 0 and self.friction == HYBRID" if SIGN in c.laws else f"{mode} == 0"
            with s.block(f"if {stuck}:"):
                s.say(f"{c.name} = {held}")
            with s.block("else:"):
                self.follow_sign(s, [c.mode])
                s.say(f"{c.name} = {s.text(Term('*', c.mode, c.slide))}")
        s.given[c] = c.name


def float_of(e: Operand) -> Operand:
    return e if isinstance(e, Expression) else float(e)


def parts(e: Operand) -> set[int]:
    """The identities of all that an expression is made of."""
    return {id(e)}.union(*map(parts, inside(e)))


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


def magnitudes(e: Operand, drive: Expression) -> list[Term]:
    """Where the size of the position of a driver is asked for."""
    if isinstance(e, Term) and e.op == "fabs" and e.args[0] is drive:
        return [e]
    return [found for one in inside(e) for found in magnitudes(one, drive)]
