"""Structural analysis of a model: roles of variables, contact loads, applicable solvers.

Variables are identified by name and declared role, never by order.  The forces that keep all contacts stuck solve the
linear system A F = b, which makes the rates of all slips zero.
"""

from collections.abc import Collection, Mapping
from functools import cached_property
from keyword import iskeyword
from math import inf, isfinite
from sys import float_info
from typing import Any

from ...runtime.active_method import EXACT_ITEM, METHOD_ITEMS
from ...runtime.method_registry import methods
from .algebra import (
    build_term,
    count_occurrences,
    depends_on,
    differentiate,
    factors,
    growth_exponent,
    has_condition_on,
    is_factor,
    is_same_expression,
    is_summand,
    negate,
    solve_for,
    subexpressions,
    substitute,
    unconditional_quotients,
    variables_in,
)
from .conditions import HOLD_TOLERANCE, Condition, find_conditions, is_nonnegative
from .expressions import (
    NO_EQUALITY,
    Expression,
    ModelError,
    Operand,
    Term,
    describe,
    is_among,
    is_comparison,
    is_number,
)
from .model_declaration import Choice, Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State, Variable
from .reserved_names import RESERVED, RESERVED_WHERE_COUPLED, is_reserved_in_c

STEEP_FUNCTIONS = ("exp", "tanh", "atan", "sinh", "cosh", "/")
LARGEST_FLOAT = float_info.max
SMALLEST_DIVISOR = 1e-100  # in place of an inverse mass that vanishes; its square is not zero
METHODS = [label for label, _, _ in (EXACT_ITEM, *METHOD_ITEMS)]
# methods for some models only, with the default methods of these models
OFFERED_WITH = {label: file.OFFERED_WITH for label, file, _ in methods if hasattr(file, "OFFERED_WITH")}
TIME = Expression()
TIME.name = "t"


class ModelAnalysis:
    """The analysed model, from which numerics, model description, page and C code are generated."""

    def __init__(self, model: type[Model], ramps: bool = False) -> None:
        self.model, self.name = model, model.__name__
        self.names: dict[Expression, str] = {}  # of derived terms
        if self.name in RESERVED or is_reserved_in_c(self.name) or not self.name.isascii():
            raise ModelError(
                f"the class name {self.name} is reserved or not ASCII: choose another name", model.location
            )
        own = [(name, e) for name, e in vars(model).items() if isinstance(e, Expression) and e.name == name]
        for name, e in own:  # an alias such as D for mu_s does not count
            self._check_name(name, e)
        self.declared: list[Variable] = [e for _, e in own if isinstance(e, Variable)]
        self.parameters = self._of_type(Parameter, Fixed)
        self.choices, self.inputs = self._of_type(Choice), self._of_type(Input)
        self.drivers = [
            s
            for s in self._of_type(State)
            if isinstance(s.constant_rate, Parameter) and is_same_expression(s.start_expression, 0.0)
        ][:1]
        self.states = [s for s in self._of_type(State) if not is_among(s, self.drivers)]
        self._add_driver_rates()
        self.contacts, self.modes = self._of_type(Contact), self._of_type(Mode)
        self.outputs = self._of_type(Output)
        self.rules: tuple[Rule, ...] = (model.rules,) if isinstance(model.rules, Rule) else model.rules
        if not isinstance(self.rules, (tuple, list)) or not all(isinstance(rule, Rule) for rule in self.rules):
            raise ModelError("rules must be a Rule or a tuple of Rules", model.location)
        self._find_rates()
        self.time_varying = (TIME, *self.states, *self.drivers, *self.contacts, *self.modes)
        self.ramps = {e: rate for e in self.inputs if (rate := self._input_rate(e)) is not None} if ramps else {}
        self.time_derivatives = {s: self.rate[s] for s in self.states} | self.explicit_time_derivatives | self.ramps
        self._check_declarations()
        self._find_contact_loads()
        self.ramps = {e: rate for e, rate in self.ramps.items() if self._keeps_closed_form(e)}
        self.rules = (*self._division_rules(), *self.rules, *self._holding_rules())
        self.switches = find_conditions(self._dynamic_expressions(), (TIME, *self.states, *self.drivers, *self.ramps))
        self.limits = self._find_limits()
        for name, e in own if self.contacts and not self.waits else ():
            self._check_name(name, e, RESERVED_WHERE_COUPLED)

    def _division_rules(self) -> tuple[Rule, ...]:
        """Return a rule for each parameter that divides in every evaluation and may be 0.

        They come first, because other rules may divide by the same parameters.
        """
        result: dict[Expression, Rule] = {}
        for owner in self.declared:
            for quotient in unconditional_quotients(self.declared_expressions(owner)):
                for e in factors(quotient.args[1]):
                    if isinstance(e, (Parameter, Fixed)) and e.accepts(0.0) and e not in result:
                        sentence = f"{e.name} = {{{e.name}!r}} is refused: {owner.name} divides by {e.name}"
                        result[e] = Rule(Term("==", e, 0.0), sentence)
                        result[e].broken.location = quotient.location
        return tuple(result.values())

    def _holding_rules(self) -> tuple[Rule, ...]:
        """Return a rule for each contact that rejects sliding forces above the holding force.

        It applies where both forces depend on parameters only and no rule of the model compares them.
        """
        result = []
        for c in (c for c in self.contacts if c.hold is not None):
            sliding, holding = (set(variables_in(e)) & {*self.parameters} for e in (c.slide, c.hold))
            has_rule = any(
                sliding & set(variables_in(rule.broken)) and holding & set(variables_in(rule.broken))
                for rule in self.rules
            )
            if not has_rule and not depends_on(c.slide - c.hold, (*self.time_varying, *self.inputs)):
                values = ", ".join(f"{e.name} = {{{e.name}!r}}" for e in self.parameters if e in sliding | holding)
                sentence = (
                    f"{c.name}: the sliding force exceeds the holding force ({values}): lower slide or raise hold"
                )
                broken = Term(">", c.slide, build_term("*", 1.0 + HOLD_TOLERANCE, c.hold))
                broken.location = c.location
                result.append(Rule(broken, sentence))
        return tuple(result)

    def derivative(self, e: Operand, by: Mapping[Expression, Operand]) -> Operand:
        """Return the derivative of e, where `by` gives the derivatives of the variables, and name its terms."""
        return differentiate(e, by, self.names)

    # ---- conditions

    def _dynamic_expressions(self) -> list[Operand]:
        """Return the expressions that determine the motion."""
        forces = [e for c in self.contacts for e in (c.slip, c.slide, c.hold) if e is not None]
        return [*self.rate_outputs.values(), *forces]

    def _find_limits(self) -> list[Condition]:
        """Return the limits of friction forces that vary: not negative, and no sliding above the holding force."""
        varying = (*self.time_varying, *self.inputs)
        result = []
        for c in self.contacts:
            at = "at t = {violation_time!r} s"
            if c.lifts_off is None and depends_on(c.slide, varying) and not is_nonnegative(c.slide):
                sentence = (
                    f"{c.name}: the sliding force becomes negative {at} ({{violation_value!r}} {c.unit}); if the "
                    "contact lifts off there, declare lifts_off=True"
                )
                result.append(Condition(c.slide, (c.slide,), sentence=sentence))
            at_rest = substitute(c.slide, {c.slip: 0.0}) if isinstance(c.slip, Expression) else c.slide
            if c.hold is None or depends_on(c.slide, (c.mode,)) or not depends_on(c.hold - at_rest, varying):
                continue
            surplus = build_term("-", build_term("*", 1.0 + HOLD_TOLERANCE, c.hold), at_rest)
            sentence = (
                f"{c.name}: the sliding force exceeds the holding force {at} (hold - slide = {{violation_value!r}} "
                f"{c.unit}): lower slide or raise hold"
            )
            margin = Term("choose", Term("==", c.mode, 0), surplus, 1.0)
            result.append(Condition(margin, (c.slide,), sentence=sentence))
        return result

    @property
    def checks_event_steps(self) -> bool:
        """Whether a long step may miss how forces vary: by steep friction laws, or conditions inside of it."""
        steep_laws = any(
            isinstance(e, Term) and e.op in STEEP_FUNCTIONS and depends_on(e.args[-1], self.states)
            for c in self.contacts
            for e in subexpressions(c.slide).values()
        )
        return steep_laws or not all(condition.is_frozen for condition in self.switches)

    @property
    def conditions(self) -> list[Condition]:
        """Conditions of choose(), then limits."""
        return [*self.switches, *self.limits]

    def _of_type(self, *kinds: type) -> list[Any]:
        return [e for e in self.declared if isinstance(e, kinds)]

    def _check_name(self, name: str, e: Expression, reserved: Collection[str] = RESERVED) -> None:
        if name in reserved or is_reserved_in_c(name) or iskeyword(name) or name.startswith("_"):
            raise ModelError(f"the name {name} is reserved by the solver or by C: choose another name", e.location)
        if not name.isascii():
            raise ModelError(f"the name {name} is not ASCII, as C requires: choose another name", e.location)

    # ---- roles

    def _add_driver_rates(self) -> None:
        """Add an output for the rate of each state with a given rate.

        One driver of constant speed that starts at zero is excluded: its position is known in closed form.
        """
        for s in self.states:
            if s.constant_rate is not None:
                unit = s.constant_rate.unit if isinstance(s.constant_rate, Variable) else f"{s.unit}/s"
                law = Output(unit, f"rate of {s.name}", s.constant_rate, rate_of=s)
                law.name, law.location = f"{s.name}_rate", s.location
                if any(e.name == law.name for e in self.declared):
                    raise ModelError(
                        f"the name {law.name} is reserved for the rate of {s.name}: choose another name", s.location
                    )
                self.declared.append(law)

    def _find_rates(self) -> None:
        """Find the rate of every state; it may be another state."""
        self.rate: dict[State, State | Output] = {}
        for e in self.declared:
            if isinstance(e, (State, Output)) and e.integrates is not None:
                if not is_among(e.integrates, self.states):
                    integrates = getattr(e.integrates, "name", "") or describe(e.integrates)
                    raise ModelError(
                        f"rate_of of {e.name} is {integrates}, which is not a state of the model", e.location
                    )
                if e.integrates in self.rate:
                    both = f"{e.name} and {self.rate[e.integrates].name}"
                    raise ModelError(f"{both} both declare rate_of={e.integrates.name}", e.location)
                self.rate[e.integrates] = e
        for s in self.states:
            if s not in self.rate:
                raise ModelError(
                    f"{s.name} has no derivative: declare an Output or a State with rate_of={s.name}",
                    s.location,
                )
        if not self.states:
            raise ModelError(f"{self.name} has no state: declare one with State()", self.model.location)
        self.positions = [s for s in self.states if is_among(self.rate[s], self.states)]
        self.rate_outputs = {s: e for s, e in self.rate.items() if isinstance(e, Output)}  # rates that are not states
        self.dynamic_states = [s for s in self.states if s in self.rate_outputs]

    def _check_declarations(self) -> None:
        """Check that all variables are declared in this class, and that modes, starts and rules are valid."""
        known, location = set(self.declared), self.model.location
        for e in self.declared:
            for part in self.declared_expressions(e):
                for leaf in variables_in(part):
                    if not leaf.name:
                        raise ModelError(
                            f"{e.name} uses a variable without a name: assign the variable to a name first", e.location
                        )
                    if leaf not in known:
                        raise ModelError(f"{e.name} uses {leaf.name}, which is not declared in {self.name}", e.location)
                self._check_choices(e, part)
            self._check_variable(e)
            self._check_alias(e)
        for mode in self.modes:
            owners = [c for c in self.contacts if c.mode is mode]
            if len(owners) != 1:
                raise ModelError(
                    f"{mode.name} is the mode of {len(owners)} contacts: each Mode needs exactly one Contact",
                    mode.location,
                )
        for s in (*self.states, *self.drivers):
            for word, e in (
                ("start", s.start_expression),
                ("rate", s.constant_rate),
                ("nominal_velocity", s.nominal_velocity),
            ):
                if depends_on(e, self.time_varying):
                    raise ModelError(
                        f"{word} of {s.name} varies with time: it must depend on parameters only", s.location
                    )
        for rule in self.rules:
            if isinstance(rule.broken, Term) and rule.broken.op == "==":
                raise ModelError(NO_EQUALITY, rule.broken.location)
            if not is_comparison(rule.broken):
                raise ModelError(
                    f"a Rule needs a comparison of parameters first, got {describe(rule.broken)}", location
                )
            if depends_on(rule.broken, (*self.time_varying, *self.inputs)):
                raise ModelError("a Rule must depend on parameters only", rule.broken.location)
            self._check_printable("the sentence of a Rule", rule.broken.location, rule.sentence)
            try:
                rule.sentence.format_map({e.name: 1.0 for e in (*self.parameters, *self.choices)})
            except (LookupError, ValueError) as error:
                raise ModelError(
                    f"the sentence of a Rule refers to {error}, which is not a parameter", rule.broken.location
                ) from None
        if self.model.method not in ("", *METHODS):
            raise ModelError(
                f"method = {self.model.method!r} is unknown; available methods: {', '.join(METHODS)}", location
            )
        for word, most in ("stop_time", inf), ("step_size", inf), ("tolerance", 1.0):
            value = getattr(self.model, word)
            if not is_number(value) or not 0.0 < value < most:
                raise ModelError(
                    f"{word} = {describe(value)} is invalid: it must be a number above 0 and below {most:g}", location
                )
        if not (self.model.__doc__ or "").strip():
            raise ModelError(
                f"{self.name} has no docstring: its first line becomes the description of the FMU, the rest its page",
                location,
            )
        self._check_printable(self.name, location, (self.model.__doc__ or "").replace("\n", " "))

    @staticmethod
    def _check_choices(e: Variable, part: Operand) -> None:
        """Check that an expression does not calculate with the number of a Choice."""
        for one in subexpressions(part).values():
            parts = one.args if isinstance(one, Term) and one.op != "==" else ()
            for choice in (*parts, part):
                if isinstance(choice, Choice):
                    cases = ", ".join(f"{label}=..." for label, _, _ in choice.items)
                    raise ModelError(
                        f"{e.name} calculates with the Choice {choice.name}: write {choice.name}.choose({cases})",
                        e.location,
                    )

    def _check_variable(self, e: Variable) -> None:
        """Check types of texts and numbers, and the range of the start value."""
        if not e.text:
            raise ModelError(f"{e.name} has an empty description: write a text", e.location)
        ModelAnalysis._check_printable(e.name, e.location, e.text, *(sentence for _, _, sentence in e.items))
        for one in (e.start, e.low, e.high, e.above, e.below):
            if not is_number(one) or (isinstance(one, int) and abs(one) > LARGEST_FLOAT):
                got = "an expression" if isinstance(one, Expression) else describe(one)
                raise ModelError(f"{e.name}: start value and bounds must be numbers, got {got}", e.location)
        if not max(e.low, e.above) <= min(e.high, e.below):
            raise ModelError(f"{e.name} has an empty range: no number is {e.allowed}", e.location)
        if isinstance(e, Contact) and is_among(e.slip, self.positions):
            raise ModelError(
                f"slip of {e.name} is {e.slip.name}, but a slip is a speed: write slip={self.rate[e.slip].name}",
                e.location,
            )
        if isinstance(e, (Parameter, Fixed, Input)) and not e.accepts(e.start):
            raise ModelError(f"{e.name} has the start value {e.start!r}; it must be {e.allowed}", e.location)

    def _check_alias(self, e: Variable) -> None:
        """Check that the alias is an identifier that nothing else uses."""
        known = [word for each in self.declared for word in (each.name, each.alias)]
        if e.alias and (not e.alias.isidentifier() or known.count(e.alias) > 1 or e.alias in RESERVED):
            raise ModelError(
                f"{e.name} has the alias {e.alias!r}: it must be an identifier that nothing else uses", e.location
            )

    @staticmethod
    def _check_printable(name: str, location: tuple[str, int], *words: str) -> None:
        """Check that texts are printable, because they go into XML, HTML and C."""
        for text in words:
            if not isinstance(text, str) or not text.isprintable():
                raise ModelError(f"{name}: {text!r} must be printable text on one line", location)

    @staticmethod
    def declared_expressions(e: Variable) -> list[Operand]:
        """Return the expressions in the declaration of a variable."""
        if isinstance(e, Output):
            return [e.expression]
        if isinstance(e, State):
            return [one for one in (e.start_expression, e.constant_rate, e.nominal_velocity) if one is not None]
        if isinstance(e, Contact):
            return [one for one in (e.mode, e.slip, e.slide, e.hold, e.eps) if one is not None]
        return []

    # ---- contacts

    def _find_contact_loads(self) -> None:
        """Derive slip rate, holding limit and load of each contact; the load is the force that keeps the slip zero."""
        forces = (*self.contacts, *self.modes)
        self.slip_rate: dict[Contact, Operand] = {
            c: self.derivative(c.slip, self.time_derivatives) for c in self.contacts
        }
        self.A: dict[tuple[Contact, Contact], Operand] = {}
        for c in self.contacts:
            if depends_on(c.slip, forces) or depends_on(c.slide, self.contacts):
                raise ModelError(f"slip and slide of {c.name} must not depend on the force of a contact", c.location)
            for d in self.contacts:
                acts = self.derivative(self.slip_rate[c], {d: 1.0})
                if depends_on(acts, forces):
                    raise ModelError(f"{d.name} must enter the rate of the slip of {c.name} linearly", d.location)
                self.A[c, d] = negate(acts)
            if is_same_expression(self.A[c, c], 0.0):
                raise ModelError(f"{c.name} does not act on its own slip, so it can never stick", c.location)
            moved = [s for s in self.dynamic_states if depends_on(self.rate_outputs[s], (c,))]
            if any(depends_on(self.derivative(c.slip, {s: 1.0}), moved) for s in moved):
                raise ModelError(f"slip of {c.name} must be linear in the speeds on which it acts", c.location)
        self.independent_contacts = [
            c for c in self.contacts if all(is_same_expression(self.A[c, d], 0.0) for d in self.contacts if d is not c)
        ]
        self.interacting_contacts = [c for c in self.contacts if not is_among(c, self.independent_contacts)]
        moving = (*self.time_varying, *self.inputs)
        self.variable_lever_contacts = [
            c
            for c in self.contacts
            if any(depends_on(self.derivative(c.slip, {s: 1.0}), moving) for s in self.dynamic_states)
        ]
        self.holding_limit: dict[Contact, Operand] = {}
        self.load: dict[Contact, Operand] = {}
        for c in self.contacts:
            at_rest = {c.slip: 0.0} if isinstance(c.slip, Expression) else {}
            self.holding_limit[c] = substitute(c.slide, at_rest) if c.hold is None else c.hold
            if depends_on(self.holding_limit[c], forces):
                raise ModelError(f"the holding force of {c.name} depends on its direction: pass hold=", c.location)
            if is_among(c, self.independent_contacts):
                e = self.slip_rate[c]
                load = (
                    solve_for(e, c)
                    if count_occurrences(e, c) == 1 and not is_among(c, self.variable_lever_contacts)
                    else build_term("/", substitute(e, {c: 0.0}), self.divisor(c))
                )
                self.load[c] = substitute(load, {c.mode: 0.0} | (at_rest if isinstance(c.slip, State) else {}))

    def divisor(self, c: Contact) -> Operand:
        """Return how a contact force acts on its own slip, as a divisor: not zero where its lever vanishes."""
        e = self.A[c, c]
        if not is_among(c, self.variable_lever_contacts):
            return e
        return build_term("choose", Term(">", Term("fabs", e), SMALLEST_DIVISOR), e, SMALLEST_DIVISOR)

    def load_expressions(self, c: Contact) -> list[Operand]:
        """Return the expressions that determine the load of a contact: for interacting contacts all slip rates."""
        return [self.load[c]] if is_among(c, self.independent_contacts) else [self.slip_rate[d] for d in self.contacts]

    def derivative_while_stuck(self, e: Operand, by: dict[Expression, Operand]) -> Operand:
        """Return the derivative of an expression while all contacts stick."""
        return self.derivative(e, by | {c: self.derivative(self.load[c], by) for c in self.independent_contacts})

    def derivative_while_sliding(self, e: Operand, by: dict[Expression, Operand]) -> Operand:
        """Return the derivative of an expression while all contacts slide."""
        return self.derivative(
            e, by | {c: build_term("*", c.mode, self.derivative(c.slide, by)) for c in self.contacts}
        )

    # ---- inputs with derivatives

    def _input_rate(self, e: Input) -> Parameter | None:
        """Return a symbol for the rate of an input, or None if its names are in use or the input has a range."""
        rate = Parameter(0.0, f"{e.unit}/s", f"rate of {e.name}")
        rate.name = f"{e.name}_rate"
        is_taken = any(one.name in (rate.name, f"{e.name}_polynomial") for one in self.declared)
        return None if is_taken or any(map(isfinite, (e.low, e.high, e.above, e.below))) else rate

    def _keeps_closed_form(self, e: Input) -> bool:
        """Return whether breakaway and motion keep their closed form while the input changes."""
        others = (TIME, *self.drivers, *self.inputs)
        if self.waits:
            (c,) = self.contacts
            if depends_on(self.holding_limit[c], (e,)) or depends_on(self.derivative(self.load[c], {e: 1.0}), others):
                return False
        if not self.closed_form:
            return True
        constants = (*self.closed_form, *(c.slide for c in self.contacts))
        acts = self.derivative(self.rate_outputs[self.dynamic_states[0]].expression, {e: 1.0})
        return not any(depends_on(one, (e,)) for one in constants) and not depends_on(
            acts, (*self.time_varying, *self.inputs)
        )

    # ---- facts for the runtime

    @property
    def explicit_time_derivatives(self) -> dict[Expression, Operand]:
        """Derivatives with respect to time at constant states."""
        return {TIME: 1.0} | {d: d.constant_rate for d in self.drivers}

    @property
    def coasting_derivatives(self) -> dict[Expression, Operand]:
        """Time derivatives without acceleration: also inputs at their rates and positions at their speeds."""
        return self.explicit_time_derivatives | self.ramps | {x: self.rate[x] for x in self.positions}

    @cached_property
    def closed_form(self) -> tuple[Operand, Operand, Operand, Operand] | None:
        """Mass, damping, stiffness and speed of the equilibrium point of a linear single-body model, else None."""
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
        damping, stiffness = (negate(self.derivative(force, {s: 1.0})) for s in (v, x))
        drift, speed = self.derivative(force, self.explicit_time_derivatives), 0.0
        if any(depends_on(e, self.time_varying) for e in (mass, damping, stiffness, drift)) or has_condition_on(
            force, self.time_varying
        ):
            return None
        if not is_same_expression(drift, 0.0):
            if len(self.drivers) != 1 or not is_same_expression(damping, 0.0):
                return None
            (drive,) = self.drivers
            if not is_same_expression(self.derivative(force, {drive: 1.0}), stiffness) or depends_on(rate, (TIME,)):
                return None
            speed = drive.constant_rate
        return mass, damping, stiffness, speed

    @cached_property
    def waits(self) -> bool:
        """Whether the model rests while its only contact sticks, with a load linear in time and a constant limit."""
        if any(len(one) != 1 for one in (self.contacts, self.positions, self.dynamic_states)):
            return False
        (c,), by_time = self.contacts, (TIME, *self.drivers)
        if self.dynamic_states[0] is not c.slip:
            return False
        changes = (self.derivative(self.load[c], self.explicit_time_derivatives), self.holding_limit[c])
        return not any(depends_on(e, by_time) for e in changes) and not any(
            has_condition_on(e, by_time) for e in (self.load[c], *self._dynamic_expressions())
        )

    @property
    def stick_assignments(self) -> list[tuple[Contact, State, Operand]]:
        """Assignments (contact, speed, value) that make the slips of stuck contacts exactly zero.

        They exist for slips that are sums of speeds, and are ordered so that none changes the slip of an earlier one;
        and for slips that are the product of a lever and a speed.
        """
        result: list[tuple[Contact, State, Operand]] = []
        left = list(self.contacts)
        while True:
            alone = [
                (c, s)
                for c in left
                for s in self.dynamic_states
                if (is_summand(c.slip, s) or (is_factor(c.slip, s) and depends_on(self.rate_outputs[s], (c,))))
                and not any(depends_on(d.slip, (s,)) for d in left if d is not c)
            ]
            if not alone:
                return result
            c, s = alone[0]
            result.insert(0, (c, s, solve_for(c.slip, s) if is_summand(c.slip, s) else 0.0))
            left = [d for d in left if d is not c]

    def check_solvable(self) -> None:
        """Raise ModelError if the solver cannot run the model."""
        for c in self.contacts:
            if c.laws != self.contacts[0].laws:
                raise ModelError(
                    f"{c.name} and {self.contacts[0].name} have different laws: give all contacts the same laws",
                    c.location,
                )
            for law in self.rate_outputs.values():
                if depends_on(self.derivative(law, {c: 1.0}), (*self.contacts, *self.modes)):
                    raise ModelError(f"{c.name} must enter {law.name} linearly", law.location)
        self._check_loads()

    def _check_loads(self) -> None:
        """Check at the start values that each contact opposes its own slip and that stuck contacts are independent."""
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
                raise ModelError(f"slide or hold of {c.name} is negative at the start values", c.location)
        A = {key: substitute(e, start) for key, e in self.A.items()}
        if any(isinstance(e, Expression) for e in A.values()):
            return  # depends on a choice: cannot be decided at build time
        contacts = [c for c in self.contacts if not is_among(c, self.variable_lever_contacts) or A[c, c] != 0.0]
        left = {c: A[c, c] for c in contacts}
        for n, c in enumerate(contacts):
            if not left[c] > 0.0:
                sentence = f"{c.name} accelerates its own slip instead of opposing it: change its sign in the rates"
                raise ModelError(sentence, c.location)
            if not A[c, c] > 1e-12 * left[c]:
                others = " and ".join(d.name for d in contacts[:n] if not is_same_expression(self.A[c, d], 0.0))
                raise ModelError(
                    f"{c.name} and {others} hold the same motion at rest, so their forces are not determined: remove "
                    "one or put a spring between them",
                    c.location,
                )
            for d in contacts[n + 1 :]:
                share = A[d, c] / A[c, c]
                for e in contacts[n + 1 :]:
                    A[d, e] -= share * A[c, e]

    @property
    def methods(self) -> list[str]:
        """Labels of the integration methods that an FMU of the model includes by default."""
        return [label for label in self.available_methods if self.method in OFFERED_WITH.get(label, (self.method,))]

    @property
    def available_methods(self) -> list[str]:
        """Labels of all integration methods that can solve the model."""
        return METHODS if self.closed_form else METHODS[1:]

    @property
    def laws(self) -> list[str]:
        """Labels of the friction laws of the model."""
        return list(dict.fromkeys(law for c in self.contacts for law in c.laws))

    @property
    def method(self) -> str:
        """Label of the default integration method."""
        if self.model.method == METHODS[0] and not self.closed_form:
            raise ModelError(
                f"method = {METHODS[0]!r} needs a linear equation of motion, which {self.name} does not have",
                self.model.location,
            )
        return self.model.method or (METHODS[0] if self.closed_form else "ode45")

    def has_direct_feedthrough(self, e: Variable) -> bool:
        """Return whether an output depends directly on an input."""
        if isinstance(e, (Contact, Mode)):
            (c,) = (c for c in self.contacts if e is c or e is c.mode)
            return any(depends_on(one, self.inputs) for one in (*self.load_expressions(c), c.slide))
        return depends_on(e, self.inputs) or any(
            depends_on(e, (c,)) and self.has_direct_feedthrough(c) for c in self.contacts
        )

    @property
    def ordered_outputs(self) -> list[Variable]:
        """Outputs in the order of the model description: states, rates, drivers, others, modes."""
        rates = [self.rate[s] for s in self.dynamic_states]
        others = [e for e in self.declared if isinstance(e, (Output, Contact)) and not is_among(e, rates)]
        return [*self.states, *rates, *self.drivers, *others, *self.modes]

    @property
    def overflow_indicators(self) -> list[Variable]:
        """Outputs that are finite only if all are: the energy, if it is quadratic and nothing grows faster."""
        grows = [growth_exponent(e, self.time_varying) for e in (*self.outputs, *(c.slide for c in self.contacts))]
        energies = [e for e in self.outputs if e.unit == "J" and all(depends_on(e, (s,)) for s in self.states)]
        if energies and max(grows) <= 2.0:
            return energies[:1]
        return [*self.states, *self.outputs, *self.contacts]
