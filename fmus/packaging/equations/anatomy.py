"""What a model is: its variables by their roles, all by name and never by order; what follows; what can be run.

The contacts are looked at as a whole: A F = b for the forces that make the rates of all slips zero.
"""

from collections.abc import Collection
from functools import cached_property
from keyword import iskeyword
from math import inf, isfinite
from sys import float_info
from typing import Any

from ...runtime.active_method import EXACT_ITEM, METHOD_ITEMS
from ..words import OF_C
from .algebra import degree, depends, derivative, is_sum, jumps, leaves, made, negative, occurrences, put, same, undone
from .declared import Choice, Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State, Variable
from .expressions import COMPARISONS, Expression, Mistake, Operand, Term
from .names import RESERVED, RESERVED_WHERE_COUPLED

MOST = float_info.max
METHODS = [label for label, _, _ in (EXACT_ITEM, *METHOD_ITEMS)]
TIME = Expression()
TIME.name = "t"


class Anatomy:
    """Everything about a model that numerics, description, page and C ask for."""

    def __init__(self, model: type[Model], ramps: bool = False) -> None:
        self.model, self.name = model, model.__name__
        if self.name in RESERVED or not self.name.isascii():
            raise Mistake(
                f"the name {self.name} is taken, or has letters that C does not take: choose another", model.place
            )
        own = [(name, e) for name, e in vars(model).items() if isinstance(e, Expression) and e.name == name]
        for name, e in own:  # a second name for the same, as D for mu_s, is none
            self._judge_name(name, e)
        self.declared: list[Variable] = [e for _, e in own if isinstance(e, Variable)]
        self.parameters = self._all(Parameter, Fixed)
        self.choices, self.inputs = self._all(Choice), self._all(Input)
        self.drives = [s for s in self._all(State) if isinstance(s.steady, Parameter) and same(s.begins, 0.0)][:1]
        self.states = [s for s in self._all(State) if s not in self.drives]
        self._integrate_drivers()
        self.contacts, self.modes = self._all(Contact), self._all(Mode)
        self.outputs = self._all(Output)
        self.rules: tuple[Rule, ...] = (model.rules,) if isinstance(model.rules, Rule) else model.rules
        if not isinstance(self.rules, (tuple, list)) or not all(isinstance(rule, Rule) for rule in self.rules):
            raise Mistake("rules are one Rule, or several in brackets", model.place)
        self._find_rates()
        self.moving = (TIME, *self.states, *self.drives, *self.contacts, *self.modes)
        self.ramps = {e: rate for e in self.inputs if (rate := self._rate_of(e)) is not None} if ramps else {}
        self.flow = {s: self.rate[s] for s in self.states} | self.by_time | self.ramps
        self._judge_parts()
        self._find_forces()
        self.ramps = {e: rate for e, rate in self.ramps.items() if self._stays_closed(e)}
        self.rules += self._holding()
        for name, e in own if self.contacts and not self.waits else ():
            self._judge_name(name, e, RESERVED_WHERE_COUPLED)

    def _holding(self) -> tuple[Rule, ...]:
        """What slides with more than it holds could neither stay nor go: the rule that refuses it, where both follow
        from parameters and no rule of the author binds these."""
        found = []
        for c in (c for c in self.contacts if c.hold is not None):
            sliding, holding = (set(leaves(e)) & {*self.parameters} for e in (c.slide, c.hold))
            told = any(sliding & set(leaves(rule.broken)) and holding & set(leaves(rule.broken)) for rule in self.rules)
            if not told and not depends(c.slide - c.hold, (*self.moving, *self.inputs)):
                values = ", ".join(f"{e.name} = {{{e.name}!r}}" for e in self.parameters if e in sliding | holding)
                sentence = f"{c.name} slides with more than it holds ({values}): lower what slides, or raise what holds"
                found.append(Rule(c.slide > (1.0 + 1e-9) * c.hold, sentence))
        return tuple(found)

    def _all(self, *kinds: type) -> list[Any]:
        return [e for e in self.declared if isinstance(e, kinds)]

    def _judge_name(self, name: str, e: Expression, reserved: Collection[str] = RESERVED) -> None:
        if name in reserved or name in OF_C or iskeyword(name) or name.startswith("_"):
            raise Mistake(f"the name {name} is taken: it has a meaning in the solver or in C; choose another", e.place)
        if not name.isascii():
            raise Mistake(f"the name {name} has letters that C does not take: choose another", e.place)

    # ---- roles

    def _integrate_drivers(self) -> None:
        """The position of one driver, of constant speed from zero on, is known in closed form; the others are states,
        and each gets an output that is its rate."""
        for s in self.states:
            if s.steady is not None:
                unit = s.steady.unit if isinstance(s.steady, Variable) else f"{s.unit}/s"
                law = Output(unit, f"rate of {s.name}", s.steady, rate_of=s)
                law.name, law.place = f"{s.name}_rate", s.place
                if any(e.name == law.name for e in self.declared):
                    raise Mistake(f"the name {law.name} is taken: it is the rate of {s.name}; choose another", s.place)
                self.declared.append(law)

    def _find_rates(self) -> None:
        """Of every state the variable that is its rate; a state can be that of another."""
        self.rate: dict[State, State | Output] = {}
        for e in self.declared:
            if isinstance(e, (State, Output)) and e.whose is not None:
                if e.whose not in self.states:
                    whose = getattr(e.whose, "name", repr(e.whose))
                    raise Mistake(f"{e.name} says that it is the rate of {whose}, which is no state", e.place)
                if e.whose in self.rate:
                    both = f"{e.name} and {self.rate[e.whose].name}"
                    raise Mistake(f"{both} both say that they are the rate of {e.whose.name}", e.place)
                self.rate[e.whose] = e
        for s in self.states:
            if s not in self.rate:
                raise Mistake(
                    f"nothing is the rate of {s.name}: say rate_of={s.name} where its derivative is declared", s.place
                )
        if not self.states:
            raise Mistake(f"{self.name} has no state: declare one with State()", self.model.place)
        self.positions = [s for s in self.states if self.rate[s] in self.states]
        self.law = {s: e for s, e in self.rate.items() if isinstance(e, Output)}  # rates that must be calculated
        self.own = [s for s in self.states if s in self.law]

    def _judge_parts(self) -> None:
        """That every part is declared in this class, every mode belongs to one contact, starts are of parameters."""
        known, place = set(self.declared), self.model.place
        for e in self.declared:
            for part in self.parts(e):
                for leaf in leaves(part):
                    if leaf not in known:
                        word = leaf.name or "a variable without a name"
                        raise Mistake(f"{e.name} uses {word}, which is not declared in {self.name}", e.place)
            self._judge_declared(e)
            self._judge_alias(e)
        for mode in self.modes:
            owners = [c for c in self.contacts if c.mode is mode]
            if len(owners) != 1:
                raise Mistake(f"{mode.name} is the mode of {len(owners)} contacts, and must be that of one", mode.place)
        for s in (*self.states, *self.drives):
            for word, e in ("start", s.begins), ("rate", s.steady), ("finest", s.finest):
                if depends(e, self.moving):
                    raise Mistake(f"{word} of {s.name} moves: it must follow from parameters", s.place)
        for rule in self.rules:
            if not (isinstance(rule.broken, Term) and rule.broken.op in COMPARISONS):
                raise Mistake(f"a Rule begins with a comparison of parameters, not with {rule.broken!r}", place)
            if depends(rule.broken, (*self.moving, *self.inputs)):
                raise Mistake("a Rule is about parameters, and this one moves", rule.broken.place)
            self._judge_words("the sentence of a Rule", rule.broken.place, rule.sentence)
            try:
                rule.sentence.format_map({e.name: 1.0 for e in (*self.parameters, *self.choices)})
            except (LookupError, ValueError) as error:
                raise Mistake(
                    f"the sentence of a Rule names {error}, which is no parameter", rule.broken.place
                ) from None
        if self.model.method not in ("", *METHODS):
            raise Mistake(f"method = {self.model.method!r} is not known; there are {', '.join(METHODS)}", place)
        for word, most in ("stop_time", inf), ("step_size", inf), ("tolerance", 1.0):
            value = getattr(self.model, word)
            value = getattr(value, "name", value)
            if not isinstance(value, (int, float)) or not 0.0 < value < most:
                raise Mistake(f"{word} = {value!r} is refused: it must be above zero, and below {most:g}", place)
        if not (self.model.__doc__ or "").strip():
            raise Mistake(
                f"{self.name} has no docstring: its first line describes the FMU, the rest is its page", place
            )
        self._judge_words(self.name, place, (self.model.__doc__ or "").replace("\n", " "))

    @staticmethod
    def _judge_declared(e: Variable) -> None:
        """That words are words, numbers are numbers, and a start value is allowed."""
        if not all(isinstance(one, str) for one in (e.unit, e.text, e.display, e.alias)) or not e.text:
            raise Mistake(f"{e.name}: the unit and what it is are texts", e.place)
        Anatomy._judge_words(e.name, e.place, e.text, *(sentence for _, _, sentence in e.items))
        for one in (e.start, e.low, e.high, e.above, e.below):
            if not isinstance(one, (int, float)) or isinstance(one, bool) or MOST < abs(one) < inf:
                raise Mistake(f"{e.name}: start value and bounds are numbers", e.place)
        if isinstance(e, (Parameter, Fixed, Input)) and not e.accepts(e.start):
            raise Mistake(f"{e.name} starts at {e.start!r}, and must be {e.allowed}", e.place)

    def _judge_alias(self, e: Variable) -> None:
        """That another name is one, and that what is calculated has none: some validators take it for an error."""
        if e.alias and not isinstance(e, (Parameter, Fixed, Input)):
            raise Mistake(f"{e.name} has the alias {e.alias}: only a Parameter, Fixed or Input may have one", e.place)
        known = [word for each in self.declared for word in (each.name, each.alias)]
        if e.alias and (not e.alias.isidentifier() or known.count(e.alias) > 1 or e.alias in RESERVED):
            raise Mistake(f"{e.name} has the alias {e.alias!r}: it must be a name that nothing else has", e.place)

    @staticmethod
    def _judge_words(name: str, place: tuple[str, int], *words: str) -> None:
        """That texts can be printed: they go into XML, pages and C."""
        for text in words:
            if not isinstance(text, str) or not text.isprintable():
                raise Mistake(f"{name}: {text!r} is no text of letters that can be printed in one line", place)

    @staticmethod
    def parts(e: Variable) -> list[Operand]:
        """The expressions that a variable is declared with."""
        if isinstance(e, Output):
            return [e.means]
        if isinstance(e, State):
            return [one for one in (e.begins, e.steady, e.finest) if one is not None]
        if isinstance(e, Contact):
            return [one for one in (e.mode, e.slip, e.slide, e.hold, e.eps) if one is not None]
        return []

    # ---- contacts

    def _find_forces(self) -> None:
        """For each contact the rate of its slip, what it holds, and the load: the force that keeps that rate zero."""
        forces = (*self.contacts, *self.modes)
        self.slip_rate: dict[Contact, Operand] = {c: derivative(c.slip, self.flow) for c in self.contacts}
        self.A: dict[tuple[Contact, Contact], Operand] = {}
        for c in self.contacts:
            if depends(c.slip, forces) or depends(c.slide, self.contacts):
                raise Mistake(f"slip and slide of {c.name} must not depend on the force of a contact", c.place)
            for d in self.contacts:
                acts = derivative(self.slip_rate[c], {d: 1.0})
                if depends(acts, forces):
                    raise Mistake(f"{d.name} must enter the rate of the slip of {c.name} linearly", d.place)
                self.A[c, d] = negative(acts)
            if same(self.A[c, c], 0.0):
                raise Mistake(f"{c.name} does not act on its own slip: nothing could hold it", c.place)
        self.lonely = [c for c in self.contacts if all(same(self.A[c, d], 0.0) for d in self.contacts if d is not c)]
        self.shared = [c for c in self.contacts if c not in self.lonely]
        self.hold: dict[Contact, Operand] = {}
        self.load: dict[Contact, Operand] = {}
        for c in self.contacts:
            at_rest = {c.slip: 0.0} if isinstance(c.slip, Expression) else {}
            self.hold[c] = put(c.slide, at_rest) if c.hold is None else c.hold
            if depends(self.hold[c], forces):
                raise Mistake(f"what {c.name} holds depends on its direction: give hold=", c.place)
            if c in self.lonely:
                e = self.slip_rate[c]
                load = undone(e, c) if occurrences(e, c) == 1 else made("/", put(e, {c: 0.0}), self.A[c, c])
                self.load[c] = put(load, {c.mode: 0.0} | (at_rest if isinstance(c.slip, State) else {}))

    def loads(self, c: Contact) -> list[Operand]:
        """What the load of a contact follows from: of those that share bodies from the rates of all slips."""
        return [self.load[c]] if c in self.lonely else [self.slip_rate[d] for d in self.contacts]

    def held(self, e: Operand, by: dict[Expression, Operand]) -> Operand:
        """The derivative of an expression while every contact holds."""
        return derivative(e, by | {c: derivative(self.load[c], by) for c in self.lonely})

    def sliding(self, e: Operand, by: dict[Expression, Operand]) -> Operand:
        """The derivative of an expression while every contact slides."""
        return derivative(e, by | {c: made("*", c.mode, derivative(c.slide, by)) for c in self.contacts})

    # ---- inputs that change by themselves

    def _rate_of(self, e: Input) -> Parameter | None:
        """What stands for the rate of an input; None where the names for it are taken, or it could leave its range."""
        rate = Parameter(0.0, f"{e.unit}/s", f"rate of {e.name}")
        rate.name = f"{e.name}_rate"
        is_taken = any(one.name in (rate.name, f"{e.name}_polynomial") for one in self.declared)
        return None if is_taken or any(map(isfinite, (e.low, e.high, e.above, e.below))) else rate

    def _stays_closed(self, e: Input) -> bool:
        """Whether what is known in closed form stays so while an input changes: a release, and the motion."""
        others = (TIME, *self.drives, *self.inputs)
        if self.waits:
            (c,) = self.contacts
            if depends(self.hold[c], (e,)) or depends(derivative(self.load[c], {e: 1.0}), others):
                return False
        if not self.closed_form:
            return True
        constants = (*self.closed_form, *(c.slide for c in self.contacts))
        acts = derivative(self.law[self.own[0]].means, {e: 1.0})
        return not any(depends(one, (e,)) for one in constants) and not depends(acts, (*self.moving, *self.inputs))

    # ---- what the runtime asks

    @property
    def by_time(self) -> dict[Expression, Operand]:
        """What goes on by itself, while the states stay."""
        return {TIME: 1.0} | {d: d.steady for d in self.drives}

    @property
    def coasting(self) -> dict[Expression, Operand]:
        """What goes on where nothing accelerates: that, inputs at their rates, positions at their speeds."""
        return self.by_time | self.ramps | {x: self.rate[x] for x in self.positions}

    @cached_property
    def closed_form(self) -> tuple[Operand, Operand, Operand, Operand] | None:
        """Mass, damping, stiffness and the speed of the resting point where one body moves under a linear law."""
        if len(self.states) != 2 or len(self.own) != 1 or any(depends(c.slide, self.moving) for c in self.contacts):
            return None
        if self.contacts and not self.waits:
            return None
        if len(self.positions) != 1:
            return None
        (x,), (v,) = self.positions, self.own
        rate = self.law[v].means
        mass, force = (rate.args[1], rate.args[0]) if isinstance(rate, Term) and rate.op == "/" else (1.0, rate)
        damping, stiffness = (negative(derivative(force, {s: 1.0})) for s in (v, x))
        drift, speed = derivative(force, self.by_time), 0.0
        if any(depends(e, self.moving) for e in (mass, damping, stiffness, drift)) or jumps(force, self.moving):
            return None
        if not same(drift, 0.0):
            if len(self.drives) != 1 or not same(damping, 0.0):
                return None
            (drive,) = self.drives
            if not same(derivative(force, {drive: 1.0}), stiffness) or depends(rate, (TIME,)):
                return None
            speed = drive.steady
        return mass, damping, stiffness, speed

    @cached_property
    def waits(self) -> bool:
        """Whether nothing moves while the only contact is stuck, whose load is then linear in time, and whose limit
        stays."""
        if len(self.contacts) != 1 or len(self.positions) != 1 or self.own != [self.contacts[0].slip]:
            return False
        (c,), by_time = self.contacts, (TIME, *self.drives)
        changes = (derivative(self.load[c], self.by_time), self.hold[c])
        return not any(depends(e, by_time) for e in changes) and not jumps(self.load[c], by_time)

    @property
    def pins(self) -> list[tuple[Contact, State, Operand]]:
        """For contacts whose slip is a sum of speeds, one that makes it zero to the last bit, and its value; in an
        order in which no later one disturbs those before."""
        found: list[tuple[Contact, State, Operand]] = []
        left = list(self.contacts)
        while True:
            alone = [
                (c, s)
                for c in left
                for s in self.own
                if is_sum(c.slip, s) and not any(depends(d.slip, (s,)) for d in left if d is not c)
            ]
            if not alone:
                return found
            c, s = alone[0]
            found.insert(0, (c, s, undone(c.slip, s)))
            left.remove(c)

    def judge_runtime(self) -> None:
        """Refuse what the solver cannot run."""
        for c in self.contacts:
            if c.laws != self.contacts[0].laws:
                raise Mistake(
                    f"{c.name} has other laws than {self.contacts[0].name}: give all contacts the same", c.place
                )
            for law in self.law.values():
                if depends(derivative(law, {c: 1.0}), (*self.contacts, *self.modes)):
                    raise Mistake(f"{c.name} must enter {law.name} linearly", law.place)
        self._judge_loads()

    def _judge_loads(self) -> None:
        """That contacts at rest have loads at the start values: each opposes its own slip, and none holds again what
        others hold."""
        start: dict[Expression, Operand] = dict.fromkeys((*self.moving, TIME), 0.0)
        start |= {e: float(e.start) for e in (*self.parameters, *self.choices, *self.inputs)}
        start |= {s: put(s.begins, start) for s in self.states}
        for c in self.contacts:
            least = min(one for one in (put(c.slide, start), put(self.hold[c], start), 0.0) if isinstance(one, float))
            if least < 0.0:
                raise Mistake(f"{c.name} slides or holds with a negative force at the start values", c.place)
        A = {key: put(e, start) for key, e in self.A.items()}
        if any(isinstance(e, Expression) for e in A.values()):
            return  # which hangs on a choice
        left = {c: A[c, c] for c in self.contacts}
        for n, c in enumerate(self.contacts):
            if not left[c] > 0.0:
                sentence = f"{c.name} drives its own slip on, and does not oppose it: change its sign in the rates"
                raise Mistake(sentence, c.place)
            if not A[c, c] > 1e-12 * left[c]:
                others = " and ".join(d.name for d in self.contacts[:n] if not same(self.A[c, d], 0.0))
                raise Mistake(
                    f"{c.name} holds at rest what {others} already holds: nobody can say which bears how much; leave "
                    "one out, or put a spring between them",
                    c.place,
                )
            for d in self.contacts[n + 1 :]:
                share = A[d, c] / A[c, c]
                for e in self.contacts[n + 1 :]:
                    A[d, e] -= share * A[c, e]

    @property
    def methods(self) -> list[str]:
        """The labels of those that are offered."""
        return METHODS if self.closed_form else METHODS[1:]

    @property
    def laws(self) -> list[str]:
        """The labels of the friction laws."""
        return list(dict.fromkeys(law for c in self.contacts for law in c.laws))

    @property
    def method(self) -> str:
        """The default one."""
        if self.model.method == METHODS[0] and not self.closed_form:
            raise Mistake(f"method = {METHODS[0]!r} needs a linear law, and {self.name} has none", self.model.place)
        return self.model.method or (METHODS[0] if self.closed_form else "ode45")

    def direct(self, e: Variable) -> bool:
        """Whether an output follows an input at once."""
        if isinstance(e, (Contact, Mode)):
            (c,) = (c for c in self.contacts if e in (c, c.mode))
            return any(depends(one, self.inputs) for one in (*self.loads(c), c.slide))
        return depends(e, self.inputs) or any(depends(e, (c,)) and self.direct(c) for c in self.contacts)

    @property
    def told(self) -> list[Variable]:
        """The outputs as the description has them: states, rates, drives, then as declared, modes last."""
        rates = [self.rate[s] for s in self.own]
        others = [e for e in self.declared if isinstance(e, (Output, Contact)) and e not in rates]
        return [*self.states, *rates, *self.drives, *others, *self.modes]

    @property
    def first_to_overflow(self) -> list[Variable]:
        """Outputs that are numbers only where all are: the energy if it has squares of all states and no other more."""
        grows = [degree(e, self.moving) for e in (*self.outputs, *(c.slide for c in self.contacts))]
        energies = [e for e in self.outputs if e.unit == "J" and all(depends(e, (s,)) for s in self.states)]
        if energies and max(grows) <= 2.0:
            return energies[:1]
        return [*self.states, *self.outputs, *self.contacts]
