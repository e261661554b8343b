"""Structural analysis of contacts: loads, limits, and whether and how contacts interact.

The forces that keep all contacts stuck solve the linear system A F = b, which makes the rates of all slips zero.
"""

from functools import cached_property

from .algebra import (
    build_term,
    depends_on,
    has_condition_on,
    is_factor,
    is_same_expression,
    is_summand,
    negate,
    operands_first,
    path_to,
    solve_for,
    substitute,
    variables_in,
)
from .expressions import Expression, ModelError, Operand, Term, is_among
from .model_conditions import HOLD_TOLERANCE, Condition, is_nonnegative, table_limits
from .model_declaration import Contact, PlanarContact, Rule, State
from .model_roles import TIME, ModelRoles

SMALLEST_DIVISOR = 1e-100  # in place of an inverse mass that vanishes; its square is not zero

# A contact has one holding force. With this split, it slides and holds with the force of each direction.
DIRECTION_ADVICE = (
    "pass as slide the mean of the forces of both directions, and add half their difference, forward minus backward, "
    "to the contact force in the equations"
)


class ContactAnalysis(ModelRoles):
    """The contacts of a model: what holds them and how they act on each other."""

    def _find_contact_loads(self) -> None:
        """Derive slip rate, holding limit and load of each contact; the load is the force that keeps the slip zero."""
        forces = (*self.contacts, *self.modes)
        for c in self.contacts:
            self._check_inputs_in_slip(c)
        self.planar_contacts = [c for c in self.contacts if isinstance(c, PlanarContact)]
        self.line_contacts = lines = [c for c in self.contacts if not is_among(c, self.planar_contacts)]
        self.slip_rate: dict[Contact, Operand] = {c: self.derivative(c.slip, self.time_derivatives) for c in lines}
        self.A: dict[tuple[Contact, Contact], Operand] = {(c, d): 0.0 for c in self.contacts for d in self.contacts}
        self.load: dict[Contact, Operand] = {}
        self.planar_rates: dict[PlanarContact, list[Operand]] = {}  # of both slips, without friction
        for planar in self.planar_contacts:
            self._find_planar_load(planar)
        for c in lines:
            if depends_on(c.slip, forces) or depends_on(c.slide, self.contacts):
                raise ModelError(f"slip and slide of {c.name} must not depend on the force of a contact", c.location)
            for d in lines:
                effect = self.derivative(self.slip_rate[c], {d: 1.0})
                if depends_on(effect, forces):
                    raise ModelError(f"{d.name} must enter the rate of the slip of {c.name} linearly", d.location)
                self.A[c, d] = negate(effect)
            if is_same_expression(self.A[c, c], 0.0):
                raise ModelError(f"{c.name} does not act on its own slip, so it can never stick", c.location)
            moved_states = [s for s in self.dynamic_states if depends_on(self.rate_outputs[s], (c,))]
            if any(depends_on(self.derivative(c.slip, {s: 1.0}), moved_states) for s in moved_states):
                raise ModelError(f"slip of {c.name} must be linear in the speeds on which it acts", c.location)
        self.independent_contacts = [
            c for c in self.contacts if all(is_same_expression(self.A[c, d], 0.0) for d in self.contacts if d is not c)
        ]
        self.interacting_contacts = [c for c in self.contacts if not is_among(c, self.independent_contacts)]
        varying_symbols = (*self.time_varying, *self.input_symbols)
        self.variable_lever_contacts = [
            c
            for c in lines
            if any(depends_on(self.derivative(c.slip, {s: 1.0}), varying_symbols) for s in self.dynamic_states)
        ]
        self.holding_limit: dict[Contact, Operand] = {}
        for c in self.contacts:
            at_rest = values_at_rest(c)
            self.holding_limit[c] = substitute(c.slide, at_rest) if c.hold is None else c.hold
            if depends_on(self.holding_limit[c], forces):
                equal = "pass hold=" if c.hold is None else "write a hold= that does not"
                raise ModelError(
                    f"the holding force of {c.name} depends on its direction: {equal} if it holds the same in both "
                    f"directions; otherwise {DIRECTION_ADVICE}",
                    c.location,
                )
            if is_among(c, lines) and is_among(c, self.independent_contacts):
                # other forces that occur in the rate cancel
                e = substitute(self.slip_rate[c], {d: 0.0 for d in self.contacts if d is not c})
                load = (
                    solve_for(e, c)
                    if path_to(e, c) is not None and not is_among(c, self.variable_lever_contacts)
                    else build_term("/", substitute(e, {c: 0.0}), self.divisor(c))
                )
                self.load[c] = substitute(load, {c.mode: 0.0} | (at_rest if isinstance(c.slip, State) else {}))

    def _find_planar_load(self, c: PlanarContact) -> None:
        """Derive the load of a contact in a plane, and the components of its force.

        Its forces act alike in all directions, and on its own slips only.  So the load is a vector, which holds the
        body at rest, and the direction of the friction while it slides is that of the slip.
        """
        if depends_on(c.slide - (0.0 if c.hold is None else c.hold), (*self.contacts, *self.modes, *c.components)):
            raise ModelError(f"slide and hold of {c.name} must not depend on friction or on its mode", c.location)
        rates = [self.derivative(slip, self.time_derivatives) for slip in c.slips]
        inverse_mass, across, other_across, other_inverse_mass = (
            negate(self.derivative(rate, {force: 1.0})) for rate in rates for force in c.components
        )
        for e in (c.slips[0], c.slips[1]):
            if any(depends_on(self.derivative(e, {s: 1.0}), self.time_varying) for s in self.states):
                raise ModelError(f"slip of {c.name} must be sums of speeds, without products or functions", c.location)
        if is_same_expression(inverse_mass, 0.0):
            raise ModelError(f"{c.name}.x does not act on its own slip, so it can never stick", c.location)
        is_alike = is_same_expression(inverse_mass, other_inverse_mass)
        if not (is_alike and is_same_expression(across, 0.0) and is_same_expression(other_across, 0.0)):
            raise ModelError(
                f"{c.name}.x and {c.name}.y do not accelerate their slips alike: a PlanarContact needs the same mass "
                "in all directions, and a body that does not turn",
                c.location,
            )
        for d in self.contacts:
            parts = d.components if isinstance(d, PlanarContact) else (d,)
            slips = d.slips if isinstance(d, PlanarContact) else (d.slip,)
            others = [self.derivative(slip, self.time_derivatives) for slip in slips]
            pairs = [(rate, force) for rate in rates for force in parts]
            pairs += [(rate, force) for rate in others for force in c.components]
            if d is not c and any(
                not is_same_expression(self.derivative(rate, {force: 1.0}), 0.0) for rate, force in pairs
            ):
                raise ModelError(
                    f"{c.name} and {d.name} act on the same motion: put a spring between the bodies, because a "
                    "PlanarContact cannot share the rest of a body with another contact",
                    c.location,
                )
        loads = [
            solve_for(rate, force)
            if path_to(rate, force) is not None
            else build_term("/", substitute(rate, {force: 0.0}), inverse_mass)
            for rate, force in zip(rates, c.components, strict=True)
        ]
        (x, y), (load_x, load_y), total, load = c.slips, loads, 0.0, 0.0
        is_stuck = Term("==", c.mode, 0)
        for force, *pair in (c.x, x, y, load_x, load_y), (c.y, y, x, load_y, load_x):
            direction = Term("slip_direction", *pair, c.slide, c.mode)
            force.expression = Term("choose", is_stuck, pair[2], build_term("*", c.slide, direction))
            total = build_term("+", total, build_term("*", pair[2], direction))
            # at rest, on a belt, the slip has rounding errors
            of_load = Term("slip_direction", 0.0, 0.0, *pair[2:], c.slide, c.mode)
            load = build_term("+", load, build_term("*", pair[2], of_load))
        self.load[c], self.A[c, c] = load, inverse_mass
        self.slip_rate[c] = build_term("*", inverse_mass, build_term("-", total, c))
        self.planar_rates[c] = [substitute(rate, dict.fromkeys(c.components, 0.0)) for rate in rates]

    def _check_inputs_in_slip(self, c: Contact) -> None:
        """Raise ModelError for an input without a rate in a slip: static friction could not follow it."""
        for e in self.inputs:
            if e.declared_rate is None and not is_same_expression(self.derivative(c.slip, {e: 1.0}), 0.0):
                raise ModelError(
                    f"slip of {c.name} contains the input {e.name}, whose rate static friction needs: declare the rate "
                    f"as another input and write {e.name} = Input(..., rate=...), or declare {e.name} as a State with "
                    f"that input as its rate; rate=0.0 means that {e.name} is constant between jumps",
                    c.location,
                )

    @property
    def has_prescribed_slips(self) -> bool:
        """Whether an input with a declared rate is part of a slip."""
        return any(depends_on(c.slip, self.prescribed_inputs) for c in self.contacts)

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
        return self.derivative(e, by | {c: self.sliding_force_derivative(c, by) for c in self.contacts})

    def sliding_force_derivative(self, c: Contact, by: dict[Expression, Operand]) -> Operand:
        """Return the derivative of the friction force of a sliding contact.

        At zero slip, where |slip| has a kink, it is the one on the side to which the contact slides.
        """
        derivative, sign_of_slip = self.derivative(c.slide, by), Term("copysign", 1.0, c.slip)
        direction = {e: c.mode for e in operands_first(derivative) if is_same_expression(e, sign_of_slip)}
        return build_term("*", c.mode, substitute(derivative, direction))

    @cached_property
    def rests_when_stuck(self) -> bool:
        """Whether the model rests while its only contact sticks, with a load linear in time and a constant limit."""
        if any(len(group) != 1 for group in (self.contacts, self.positions, self.dynamic_states)):
            return False
        (c,), by_time = self.contacts, (TIME, *self.drivers)
        if self.dynamic_states[0] is not c.slip:
            return False
        changes = (self.derivative(self.load[c], self.explicit_time_derivatives), self.holding_limit[c])
        prescribed_inputs = self.prescribed_inputs
        slopes = [self.derivative(self.load[c], {e: 1.0}) for e in prescribed_inputs]
        return (
            not any(depends_on(e, by_time) for e in changes)
            and self.is_ramp(self.load[c])
            and not depends_on(self.holding_limit[c], prescribed_inputs)
            and not any(depends_on(slope, (*by_time, *self.inputs)) for slope in slopes)
            and not any(
                has_condition_on(e, (*by_time, *prescribed_inputs))
                for e in (self.load[c], *self._dynamic_expressions())
            )
        )

    @property
    def stick_assignments(self) -> list[tuple[Contact, State, Operand]]:
        """Assignments (contact, speed, value) that make the slips of stuck contacts exactly zero.

        They exist for slips that are sums of speeds, and are ordered so that none changes the slip of an earlier one;
        and for slips that are the product of a lever and a speed.
        """
        result: list[tuple[Contact, State, Operand]] = []
        remaining_slips = [
            (c, slip) for c in self.contacts for slip in (c.slips if isinstance(c, PlanarContact) else (c.slip,))
        ]
        while True:
            candidates = [
                (c, slip, s)
                for c, slip in remaining_slips
                for s in self.dynamic_states
                if (is_summand(slip, s) or (is_factor(slip, s) and depends_on(self.rate_outputs[s], (c,))))
                and not any(depends_on(other, (s,)) for _, other in remaining_slips if other is not slip)
            ]
            if not candidates:
                return result
            c, slip, s = candidates[0]
            result.insert(0, (c, s, solve_for(slip, s) if is_summand(slip, s) else 0.0))
            remaining_slips = [(d, other) for d, other in remaining_slips if other is not slip]

    def _dynamic_expressions(self) -> list[Operand]:
        """Return the expressions that determine the motion."""
        forces = [e for c in self.contacts for e in (c.slip, c.slide, c.hold) if e is not None]
        return [*self.rate_outputs.values(), *forces]

    def _sign_rules(self) -> tuple[Rule, ...]:
        """Return rules that reject values with which friction drives a body instead of opposing its slip.

        They apply where a force, or the inverse mass on which it acts, depends on parameters only and may be negative.
        Forces that vary during the run are limits instead.
        """
        result = []
        for c in self.contacts:
            for e, op, meaning, requirement in (
                (c.slide, "<", "the sliding force is negative", "it is at least 0"),
                (c.hold, "<", "the holding force is negative", "it is at least 0"),
                (self.A[c, c], "<=", "the force accelerates its own slip", "it opposes the slip"),
            ):
                is_constant = isinstance(e, Expression) and not depends_on(e, (*self.time_varying, *self.input_symbols))
                if is_constant and not is_nonnegative(e):
                    values = ", ".join(f"{variable.label} = {{{variable.name}!r}}" for variable in variables_in(e))
                    comparison = Term(op, e, 0.0)
                    comparison.location = c.location
                    result.append(
                        Rule(comparison, f"{c.name}: {meaning} with {values}: set values with which {requirement}")
                    )
        return tuple(result)

    def _holding_rules(self) -> tuple[Rule, ...]:
        """Return a rule for each contact that rejects sliding forces above the holding force.

        It applies where both forces depend on parameters only and no rule of the model compares them.
        """
        result = []
        for c in (c for c in self.contacts if c.hold is not None):
            slide_parameters, hold_parameters = (set(variables_in(e)) & {*self.parameters} for e in (c.slide, c.hold))
            has_rule = any(
                slide_parameters & set(variables_in(rule.broken)) and hold_parameters & set(variables_in(rule.broken))
                for rule in self.rules
            )
            if not has_rule and not depends_on(c.slide - c.hold, (*self.time_varying, *self.input_symbols)):
                values = ", ".join(
                    f"{e.label} = {{{e.name}!r}}" for e in self.parameters if e in slide_parameters | hold_parameters
                )
                sentence = (
                    f"{c.name}: the sliding force exceeds the holding force ({values}): lower slide or raise hold"
                )
                comparison = Term(">", c.slide, build_term("*", 1.0 + HOLD_TOLERANCE, c.hold))
                comparison.location = c.location
                result.append(Rule(comparison, sentence))
        return tuple(result)

    def _find_limits(self) -> list[Condition]:
        """Return the limits of friction forces that vary: not negative, and no sliding above the holding force."""
        varying_symbols = (*self.time_varying, *self.input_symbols)
        result = []
        for c in self.contacts:
            time = "at t = {violation_time!r} s"
            if c.lifts_off is None and depends_on(c.slide, varying_symbols) and not is_nonnegative(c.slide):
                sentence = (
                    f"{c.name}: the sliding force becomes negative {time} ({{violation_value!r}} {c.unit}); if the "
                    "contact lifts off there, declare lifts_off=True"
                )
                result.append(Condition(c.slide, (c.slide,), sentence=sentence))
            at_rest = substitute(c.slide, values_at_rest(c))
            if c.hold is None or depends_on(c.slide, (c.mode,)) or not depends_on(c.hold - at_rest, varying_symbols):
                continue
            surplus = build_term("-", build_term("*", 1.0 + HOLD_TOLERANCE, c.hold), at_rest)
            sentence = (
                f"{c.name}: the sliding force exceeds the holding force {time} (hold - slide = {{violation_value!r}} "
                f"{c.unit}): lower slide or raise hold"
            )
            margin = Term("choose", Term("==", c.mode, 0), surplus, 1.0)
            result.append(Condition(margin, (c.slide,), sentence=sentence))
        expressions = [e for variable in self.variables for e in self.declared_expressions(variable)]
        return [*result, *table_limits(expressions, self.contacts)]

    def check_solvable(self) -> None:
        """Raise ModelError if the solver cannot run the model."""
        for c in self.contacts:
            if c.laws != self.contacts[0].laws:
                raise ModelError(
                    f"{c.name} and {self.contacts[0].name} have different laws: give all contacts the same laws",
                    c.location,
                )
            for law in self.rate_outputs.values():
                if has_condition_on(law, (c,)):
                    raise ModelError(
                        f"a condition in {law.name} compares {c.name}, which follows from {law.name}: use a condition "
                        "on states",
                        law.location,
                    )
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
                expression
                for expression in (substitute(c.slide, start), substitute(self.holding_limit[c], start), 0.0)
                if isinstance(expression, float)
            )
            if least < 0.0:
                raise ModelError(f"slide or hold of {c.name} is negative at the start values", c.location)
        A = {key: substitute(e, start) for key, e in self.A.items()}
        if any(isinstance(e, Expression) for e in A.values()):
            return  # depends on a choice: cannot be decided at build time
        contacts = [c for c in self.contacts if not is_among(c, self.variable_lever_contacts) or A[c, c] != 0.0]
        diagonal = {c: A[c, c] for c in contacts}
        for n, c in enumerate(contacts):
            if not diagonal[c] > 0.0:
                sentence = f"{c.name} accelerates its own slip instead of opposing it: change its sign in the rates"
                raise ModelError(sentence, c.location)
            if not A[c, c] > 1e-12 * diagonal[c]:
                others = [d for d in contacts[:n] if not is_same_expression(self.A[c, d], 0.0)]
                equal = [d for d in others if is_same_expression(c.slip, d.slip) and not (c.lifts_off or d.lifts_off)]
                remedy = "write one contact with the sum of their limits, or " if equal else ""
                names = " and ".join(d.name for d in equal or others)
                raise ModelError(
                    f"{c.name} and {names} hold the same motion at rest, so their forces are not determined: {remedy}"
                    "put a spring between them",
                    c.location,
                )
            for d in contacts[n + 1 :]:
                share = A[d, c] / A[c, c]
                for e in contacts[n + 1 :]:
                    A[d, e] -= share * A[c, e]


def values_at_rest(c: Contact) -> dict[Expression, Operand]:
    """Return the slips of a contact at rest, and for one in a plane also the speeds that are its slips."""
    slips = (c.slip, *(c.slips if isinstance(c, PlanarContact) else ()))
    return {slip: 0.0 for slip in slips if isinstance(slip, Expression)}
