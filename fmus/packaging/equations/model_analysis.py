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
from ..reserved_names import C_NAMES
from .algebra import (
    build_term,
    count_occurrences,
    depends_on,
    differentiate,
    growth_exponent,
    has_condition_on,
    is_same_expression,
    is_summand,
    negate,
    solve_for,
    substitute,
    variables_in,
)
from .expressions import COMPARISONS, Expression, ModelError, Operand, Term
from .generated_names import RESERVED, RESERVED_WHERE_COUPLED
from .model_declaration import Choice, Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State, Variable

LARGEST_FLOAT = float_info.max
METHODS = [label for label, _, _ in (EXACT_ITEM, *METHOD_ITEMS)]
TIME = Expression()
TIME.name = "t"


class ModelAnalysis:
    """Everything about a model that numerics, description, page and C ask for."""

    def __init__(self, model: type[Model], ramps: bool = False) -> None:
        self.model, self.name = model, model.__name__
        if self.name in RESERVED or not self.name.isascii():
            raise ModelError(
                f"the name {self.name} is taken, or has letters that C does not take: choose another", model.location
            )
        own = [(name, e) for name, e in vars(model).items() if isinstance(e, Expression) and e.name == name]
        for name, e in own:  # a second name for the same, as D for mu_s, is none
            self._check_name(name, e)
        self.declared: list[Variable] = [e for _, e in own if isinstance(e, Variable)]
        self.parameters = self._of_type(Parameter, Fixed)
        self.choices, self.inputs = self._of_type(Choice), self._of_type(Input)
        self.drivers = [
            s
            for s in self._of_type(State)
            if isinstance(s.constant_rate, Parameter) and is_same_expression(s.start_expression, 0.0)
        ][:1]
        self.states = [s for s in self._of_type(State) if s not in self.drivers]
        self._add_driver_rates()
        self.contacts, self.modes = self._of_type(Contact), self._of_type(Mode)
        self.outputs = self._of_type(Output)
        self.rules: tuple[Rule, ...] = (model.rules,) if isinstance(model.rules, Rule) else model.rules
        if not isinstance(self.rules, (tuple, list)) or not all(isinstance(rule, Rule) for rule in self.rules):
            raise ModelError("rules are one Rule, or several in brackets", model.location)
        self._find_rates()
        self.time_varying = (TIME, *self.states, *self.drivers, *self.contacts, *self.modes)
        self.ramps = {e: rate for e in self.inputs if (rate := self._input_rate(e)) is not None} if ramps else {}
        self.time_derivatives = {s: self.rate[s] for s in self.states} | self.explicit_time_derivatives | self.ramps
        self._check_declarations()
        self._find_contact_loads()
        self.ramps = {e: rate for e, rate in self.ramps.items() if self._keeps_closed_form(e)}
        self.rules += self._holding_rules()
        for name, e in own if self.contacts and not self.waits else ():
            self._check_name(name, e, RESERVED_WHERE_COUPLED)

    def _holding_rules(self) -> tuple[Rule, ...]:
        """What slides with more than it holds could neither stay nor go: the rule that refuses it, where both follow
        from parameters and no rule of the author binds these."""
        found = []
        for c in (c for c in self.contacts if c.hold is not None):
            sliding, holding = (set(variables_in(e)) & {*self.parameters} for e in (c.slide, c.hold))
            told = any(
                sliding & set(variables_in(rule.broken)) and holding & set(variables_in(rule.broken))
                for rule in self.rules
            )
            if not told and not depends_on(c.slide - c.hold, (*self.time_varying, *self.inputs)):
                values = ", ".join(f"{e.name} = {{{e.name}!r}}" for e in self.parameters if e in sliding | holding)
                sentence = f"{c.name} slides with more than it holds ({values}): lower what slides, or raise what holds"
                found.append(Rule(c.slide > (1.0 + 1e-9) * c.hold, sentence))
        return tuple(found)

    def _of_type(self, *kinds: type) -> list[Any]:
        return [e for e in self.declared if isinstance(e, kinds)]

    def _check_name(self, name: str, e: Expression, reserved: Collection[str] = RESERVED) -> None:
        if name in reserved or name in C_NAMES or iskeyword(name) or name.startswith("_"):
            raise ModelError(
                f"the name {name} is taken: it has a meaning in the solver or in C; choose another", e.location
            )
        if not name.isascii():
            raise ModelError(f"the name {name} has letters that C does not take: choose another", e.location)

    # ---- roles

    def _add_driver_rates(self) -> None:
        """The position of one driver, of constant speed from zero on, is known in closed form; the others are states,
        and each gets an output that is its rate."""
        for s in self.states:
            if s.constant_rate is not None:
                unit = s.constant_rate.unit if isinstance(s.constant_rate, Variable) else f"{s.unit}/s"
                law = Output(unit, f"rate of {s.name}", s.constant_rate, rate_of=s)
                law.name, law.location = f"{s.name}_rate", s.location
                if any(e.name == law.name for e in self.declared):
                    raise ModelError(
                        f"the name {law.name} is taken: it is the rate of {s.name}; choose another", s.location
                    )
                self.declared.append(law)

    def _find_rates(self) -> None:
        """Of every state the variable that is its rate; a state can be that of another."""
        self.rate: dict[State, State | Output] = {}
        for e in self.declared:
            if isinstance(e, (State, Output)) and e.integrates is not None:
                if e.integrates not in self.states:
                    integrates = getattr(e.integrates, "name", repr(e.integrates))
                    raise ModelError(
                        f"{e.name} says that it is the rate of {integrates}, which is no state", e.location
                    )
                if e.integrates in self.rate:
                    both = f"{e.name} and {self.rate[e.integrates].name}"
                    raise ModelError(f"{both} both say that they are the rate of {e.integrates.name}", e.location)
                self.rate[e.integrates] = e
        for s in self.states:
            if s not in self.rate:
                raise ModelError(
                    f"nothing is the rate of {s.name}: say rate_of={s.name} where its derivative is declared",
                    s.location,
                )
        if not self.states:
            raise ModelError(f"{self.name} has no state: declare one with State()", self.model.location)
        self.positions = [s for s in self.states if self.rate[s] in self.states]
        self.rate_outputs = {
            s: e for s, e in self.rate.items() if isinstance(e, Output)
        }  # rates that must be calculated
        self.dynamic_states = [s for s in self.states if s in self.rate_outputs]

    def _check_declarations(self) -> None:
        """That every part is declared in this class, every mode belongs to one contact, starts are of parameters."""
        known, location = set(self.declared), self.model.location
        for e in self.declared:
            for part in self.declared_expressions(e):
                for leaf in variables_in(part):
                    if leaf not in known:
                        word = leaf.name or "a variable without a name"
                        raise ModelError(f"{e.name} uses {word}, which is not declared in {self.name}", e.location)
            self._check_variable(e)
            self._check_alias(e)
        for mode in self.modes:
            owners = [c for c in self.contacts if c.mode is mode]
            if len(owners) != 1:
                raise ModelError(
                    f"{mode.name} is the mode of {len(owners)} contacts, and must be that of one", mode.location
                )
        for s in (*self.states, *self.drivers):
            for word, e in (
                ("start", s.start_expression),
                ("rate", s.constant_rate),
                ("nominal_velocity", s.nominal_velocity),
            ):
                if depends_on(e, self.time_varying):
                    raise ModelError(f"{word} of {s.name} moves: it must follow from parameters", s.location)
        for rule in self.rules:
            if not (isinstance(rule.broken, Term) and rule.broken.op in COMPARISONS):
                raise ModelError(f"a Rule begins with a comparison of parameters, not with {rule.broken!r}", location)
            if depends_on(rule.broken, (*self.time_varying, *self.inputs)):
                raise ModelError("a Rule is about parameters, and this one moves", rule.broken.location)
            self._check_printable("the sentence of a Rule", rule.broken.location, rule.sentence)
            try:
                rule.sentence.format_map({e.name: 1.0 for e in (*self.parameters, *self.choices)})
            except (LookupError, ValueError) as error:
                raise ModelError(
                    f"the sentence of a Rule names {error}, which is no parameter", rule.broken.location
                ) from None
        if self.model.method not in ("", *METHODS):
            raise ModelError(f"method = {self.model.method!r} is not known; there are {', '.join(METHODS)}", location)
        for word, most in ("stop_time", inf), ("step_size", inf), ("tolerance", 1.0):
            value = getattr(self.model, word)
            value = getattr(value, "name", value)
            if not isinstance(value, (int, float)) or not 0.0 < value < most:
                raise ModelError(f"{word} = {value!r} is refused: it must be above zero, and below {most:g}", location)
        if not (self.model.__doc__ or "").strip():
            raise ModelError(
                f"{self.name} has no docstring: its first line describes the FMU, the rest is its page", location
            )
        self._check_printable(self.name, location, (self.model.__doc__ or "").replace("\n", " "))

    @staticmethod
    def _check_variable(e: Variable) -> None:
        """That words are words, numbers are numbers, and a start value is allowed."""
        if not all(isinstance(one, str) for one in (e.unit, e.text, e.display, e.alias)) or not e.text:
            raise ModelError(f"{e.name}: the unit and what it is are texts", e.location)
        ModelAnalysis._check_printable(e.name, e.location, e.text, *(sentence for _, _, sentence in e.items))
        for one in (e.start, e.low, e.high, e.above, e.below):
            if not isinstance(one, (int, float)) or isinstance(one, bool) or LARGEST_FLOAT < abs(one) < inf:
                raise ModelError(f"{e.name}: start value and bounds are numbers", e.location)
        if isinstance(e, (Parameter, Fixed, Input)) and not e.accepts(e.start):
            raise ModelError(f"{e.name} starts at {e.start!r}, and must be {e.allowed}", e.location)

    def _check_alias(self, e: Variable) -> None:
        """That another name is one, and that what is calculated has none: some validators take it for an error."""
        if e.alias and not isinstance(e, (Parameter, Fixed, Input)):
            raise ModelError(
                f"{e.name} has the alias {e.alias}: only a Parameter, Fixed or Input may have one", e.location
            )
        known = [word for each in self.declared for word in (each.name, each.alias)]
        if e.alias and (not e.alias.isidentifier() or known.count(e.alias) > 1 or e.alias in RESERVED):
            raise ModelError(f"{e.name} has the alias {e.alias!r}: it must be a name that nothing else has", e.location)

    @staticmethod
    def _check_printable(name: str, location: tuple[str, int], *words: str) -> None:
        """That texts can be printed: they go into XML, pages and C."""
        for text in words:
            if not isinstance(text, str) or not text.isprintable():
                raise ModelError(f"{name}: {text!r} is no text of letters that can be printed in one line", location)

    @staticmethod
    def declared_expressions(e: Variable) -> list[Operand]:
        """The expressions that a variable is declared with."""
        if isinstance(e, Output):
            return [e.expression]
        if isinstance(e, State):
            return [one for one in (e.start_expression, e.constant_rate, e.nominal_velocity) if one is not None]
        if isinstance(e, Contact):
            return [one for one in (e.mode, e.slip, e.slide, e.hold, e.eps) if one is not None]
        return []

    # ---- contacts

    def _find_contact_loads(self) -> None:
        """For each contact the rate of its slip, what it holds, and the load: the force that keeps that rate zero."""
        forces = (*self.contacts, *self.modes)
        self.slip_rate: dict[Contact, Operand] = {
            c: differentiate(c.slip, self.time_derivatives) for c in self.contacts
        }
        self.A: dict[tuple[Contact, Contact], Operand] = {}
        for c in self.contacts:
            if depends_on(c.slip, forces) or depends_on(c.slide, self.contacts):
                raise ModelError(f"slip and slide of {c.name} must not depend on the force of a contact", c.location)
            for d in self.contacts:
                acts = differentiate(self.slip_rate[c], {d: 1.0})
                if depends_on(acts, forces):
                    raise ModelError(f"{d.name} must enter the rate of the slip of {c.name} linearly", d.location)
                self.A[c, d] = negate(acts)
            if is_same_expression(self.A[c, c], 0.0):
                raise ModelError(f"{c.name} does not act on its own slip: nothing could hold it", c.location)
        self.independent_contacts = [
            c for c in self.contacts if all(is_same_expression(self.A[c, d], 0.0) for d in self.contacts if d is not c)
        ]
        self.interacting_contacts = [c for c in self.contacts if c not in self.independent_contacts]
        self.holding_limit: dict[Contact, Operand] = {}
        self.load: dict[Contact, Operand] = {}
        for c in self.contacts:
            at_rest = {c.slip: 0.0} if isinstance(c.slip, Expression) else {}
            self.holding_limit[c] = substitute(c.slide, at_rest) if c.hold is None else c.hold
            if depends_on(self.holding_limit[c], forces):
                raise ModelError(f"what {c.name} holds depends on its direction: give hold=", c.location)
            if c in self.independent_contacts:
                e = self.slip_rate[c]
                load = (
                    solve_for(e, c)
                    if count_occurrences(e, c) == 1
                    else build_term("/", substitute(e, {c: 0.0}), self.A[c, c])
                )
                self.load[c] = substitute(load, {c.mode: 0.0} | (at_rest if isinstance(c.slip, State) else {}))

    def load_expressions(self, c: Contact) -> list[Operand]:
        """What the load of a contact follows from: of those that share bodies from the rates of all slips."""
        return [self.load[c]] if c in self.independent_contacts else [self.slip_rate[d] for d in self.contacts]

    def derivative_while_stuck(self, e: Operand, by: dict[Expression, Operand]) -> Operand:
        """The derivative of an expression while every contact holds."""
        return differentiate(e, by | {c: differentiate(self.load[c], by) for c in self.independent_contacts})

    def derivative_while_sliding(self, e: Operand, by: dict[Expression, Operand]) -> Operand:
        """The derivative of an expression while every contact slides."""
        return differentiate(e, by | {c: build_term("*", c.mode, differentiate(c.slide, by)) for c in self.contacts})

    # ---- inputs that change by themselves

    def _input_rate(self, e: Input) -> Parameter | None:
        """What stands for the rate of an input; None where the names for it are taken, or it could leave its range."""
        rate = Parameter(0.0, f"{e.unit}/s", f"rate of {e.name}")
        rate.name = f"{e.name}_rate"
        is_taken = any(one.name in (rate.name, f"{e.name}_polynomial") for one in self.declared)
        return None if is_taken or any(map(isfinite, (e.low, e.high, e.above, e.below))) else rate

    def _keeps_closed_form(self, e: Input) -> bool:
        """Whether what is known in closed form stays so while an input changes: a release, and the motion."""
        others = (TIME, *self.drivers, *self.inputs)
        if self.waits:
            (c,) = self.contacts
            if depends_on(self.holding_limit[c], (e,)) or depends_on(differentiate(self.load[c], {e: 1.0}), others):
                return False
        if not self.closed_form:
            return True
        constants = (*self.closed_form, *(c.slide for c in self.contacts))
        acts = differentiate(self.rate_outputs[self.dynamic_states[0]].expression, {e: 1.0})
        return not any(depends_on(one, (e,)) for one in constants) and not depends_on(
            acts, (*self.time_varying, *self.inputs)
        )

    # ---- what the runtime asks

    @property
    def explicit_time_derivatives(self) -> dict[Expression, Operand]:
        """What goes on by itself, while the states stay."""
        return {TIME: 1.0} | {d: d.constant_rate for d in self.drivers}

    @property
    def coasting_derivatives(self) -> dict[Expression, Operand]:
        """What goes on where nothing accelerates: that, inputs at their rates, positions at their speeds."""
        return self.explicit_time_derivatives | self.ramps | {x: self.rate[x] for x in self.positions}

    @cached_property
    def closed_form(self) -> tuple[Operand, Operand, Operand, Operand] | None:
        """Mass, damping, stiffness and the speed of the resting point where one body moves under a linear law."""
        if (
            len(self.states) != 2
            or len(self.dynamic_states) != 1
            or any(depends_on(c.slide, self.time_varying) for c in self.contacts)
        ):
            return None
        if self.contacts and not self.waits:
            return None
        if len(self.positions) != 1:
            return None
        (x,), (v,) = self.positions, self.dynamic_states
        rate = self.rate_outputs[v].expression
        mass, force = (rate.args[1], rate.args[0]) if isinstance(rate, Term) and rate.op == "/" else (1.0, rate)
        damping, stiffness = (negate(differentiate(force, {s: 1.0})) for s in (v, x))
        drift, speed = differentiate(force, self.explicit_time_derivatives), 0.0
        if any(depends_on(e, self.time_varying) for e in (mass, damping, stiffness, drift)) or has_condition_on(
            force, self.time_varying
        ):
            return None
        if not is_same_expression(drift, 0.0):
            if len(self.drivers) != 1 or not is_same_expression(damping, 0.0):
                return None
            (drive,) = self.drivers
            if not is_same_expression(differentiate(force, {drive: 1.0}), stiffness) or depends_on(rate, (TIME,)):
                return None
            speed = drive.constant_rate
        return mass, damping, stiffness, speed

    @cached_property
    def waits(self) -> bool:
        """Whether nothing moves while the only contact is stuck, whose load is then linear in time, and whose limit
        stays."""
        if len(self.contacts) != 1 or len(self.positions) != 1 or self.dynamic_states != [self.contacts[0].slip]:
            return False
        (c,), by_time = self.contacts, (TIME, *self.drivers)
        changes = (differentiate(self.load[c], self.explicit_time_derivatives), self.holding_limit[c])
        return not any(depends_on(e, by_time) for e in changes) and not has_condition_on(self.load[c], by_time)

    @property
    def stick_assignments(self) -> list[tuple[Contact, State, Operand]]:
        """For contacts whose slip is a sum of speeds, one that makes it zero to the last bit, and its value; in an
        order in which no later one disturbs those before."""
        found: list[tuple[Contact, State, Operand]] = []
        left = list(self.contacts)
        while True:
            alone = [
                (c, s)
                for c in left
                for s in self.dynamic_states
                if is_summand(c.slip, s) and not any(depends_on(d.slip, (s,)) for d in left if d is not c)
            ]
            if not alone:
                return found
            c, s = alone[0]
            found.insert(0, (c, s, solve_for(c.slip, s)))
            left.remove(c)

    def check_solvable(self) -> None:
        """Refuse what the solver cannot run."""
        for c in self.contacts:
            if c.laws != self.contacts[0].laws:
                raise ModelError(
                    f"{c.name} has other laws than {self.contacts[0].name}: give all contacts the same", c.location
                )
            for law in self.rate_outputs.values():
                if depends_on(differentiate(law, {c: 1.0}), (*self.contacts, *self.modes)):
                    raise ModelError(f"{c.name} must enter {law.name} linearly", law.location)
        self._check_loads()

    def _check_loads(self) -> None:
        """That contacts at rest have loads at the start values: each opposes its own slip, and none holds again what
        others hold."""
        start: dict[Expression, Operand] = dict.fromkeys((*self.time_varying, TIME), 0.0)
        start |= {e: float(e.start) for e in (*self.parameters, *self.choices, *self.inputs)}
        start |= {s: substitute(s.start_expression, start) for s in self.states}
        for c in self.contacts:
            least = min(
                one
                for one in (substitute(c.slide, start), substitute(self.holding_limit[c], start), 0.0)
                if isinstance(one, float)
            )
            if least < 0.0:
                raise ModelError(f"{c.name} slides or holds with a negative force at the start values", c.location)
        A = {key: substitute(e, start) for key, e in self.A.items()}
        if any(isinstance(e, Expression) for e in A.values()):
            return  # which hangs on a choice
        left = {c: A[c, c] for c in self.contacts}
        for n, c in enumerate(self.contacts):
            if not left[c] > 0.0:
                sentence = f"{c.name} drives its own slip on, and does not oppose it: change its sign in the rates"
                raise ModelError(sentence, c.location)
            if not A[c, c] > 1e-12 * left[c]:
                others = " and ".join(d.name for d in self.contacts[:n] if not is_same_expression(self.A[c, d], 0.0))
                raise ModelError(
                    f"{c.name} holds at rest what {others} already holds: nobody can say which bears how much; leave "
                    "one out, or put a spring between them",
                    c.location,
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
            raise ModelError(
                f"method = {METHODS[0]!r} needs a linear law, and {self.name} has none", self.model.location
            )
        return self.model.method or (METHODS[0] if self.closed_form else "ode45")

    def has_direct_feedthrough(self, e: Variable) -> bool:
        """Whether an output follows an input at once."""
        if isinstance(e, (Contact, Mode)):
            (c,) = (c for c in self.contacts if e in (c, c.mode))
            return any(depends_on(one, self.inputs) for one in (*self.load_expressions(c), c.slide))
        return depends_on(e, self.inputs) or any(
            depends_on(e, (c,)) and self.has_direct_feedthrough(c) for c in self.contacts
        )

    @property
    def ordered_outputs(self) -> list[Variable]:
        """The outputs as the description has them: states, rates, drives, then as declared, modes last."""
        rates = [self.rate[s] for s in self.dynamic_states]
        others = [e for e in self.declared if isinstance(e, (Output, Contact)) and e not in rates]
        return [*self.states, *rates, *self.drivers, *others, *self.modes]

    @property
    def overflow_indicators(self) -> list[Variable]:
        """Outputs that are numbers only where all are: the energy if it has squares of all states and no other more."""
        grows = [growth_exponent(e, self.time_varying) for e in (*self.outputs, *(c.slide for c in self.contacts))]
        energies = [e for e in self.outputs if e.unit == "J" and all(depends_on(e, (s,)) for s in self.states)]
        if energies and max(grows) <= 2.0:
            return energies[:1]
        return [*self.states, *self.outputs, *self.contacts]
