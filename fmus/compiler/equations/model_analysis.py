"""Structural analysis of a model: rules and conditions, closed form, methods and laws, order of outputs."""

from functools import cached_property

from ...runtime.method_registry import methods
from .algebra import (
    dependents,
    depends_on,
    factors,
    has_condition_on,
    is_same_expression,
    negate,
    operands,
    operands_first,
    unconditional_quotients,
    variables_in,
)
from .contact_analysis import ContactAnalysis
from .declaration_checks import METHODS, check_declarations
from .expressions import Expression, ModelError, Operand, Term, is_among
from .model_conditions import Condition, find_conditions
from .model_declaration import Contact, Fixed, Input, Mode, Model, Parameter, Rule, State, Variable
from .model_roles import TIME

PERIODIC = ("sin", "cos", "tan")
STEEP_FUNCTIONS = ("exp", "tanh", "atan", "sinh", "cosh", "/")
ANALYSES: dict[type, "ModelAnalysis"] = {}  # of lowered model classes; no attribute of them, see reserved_names.py
# methods for some models only, with the default methods of these models
OFFERED_WITH = {label: file.OFFERED_WITH for label, file, _ in methods if hasattr(file, "OFFERED_WITH")}


class ModelAnalysis(ContactAnalysis):
    """The analysed model, from which numerics, model description, page and C code are generated."""

    def __init__(self, model: type[Model], has_input_derivatives: bool = False) -> None:
        super().__init__(model, has_input_derivatives)
        check_declarations(self)
        self._find_contact_loads()
        self.input_rates = {
            e: rate
            for e, rate in self.input_rates.items()
            if is_among(e, self.prescribed_inputs) or self._keeps_closed_form(e)
        }
        self.rules = (
            *self._division_rules(),
            *self._nominal_velocity_rules(),
            *self.rules,
            *self._sign_rules(),
            *self._holding_rules(),
        )
        self.switches = find_conditions(
            self._dynamic_expressions(), (TIME, *self.states, *self.drivers, *self.input_rates), self.contacts
        )
        self.limits = self._find_limits()

    def _division_rules(self) -> tuple[Rule, ...]:
        """Return a rule for each parameter that divides in every evaluation and may be 0.

        They come first, because other rules may divide by the same parameters.
        """
        result: dict[Expression, Rule] = {}
        for owner in self.variables:
            for quotient in unconditional_quotients(self.declared_expressions(owner)):
                for e in factors(quotient.args[1]):
                    if isinstance(e, (Parameter, Fixed)) and e.accepts(0.0) and e not in result:
                        sentence = f"{e.label} = {{{e.name}!r}} is refused: {owner.name} divides by {e.label}"
                        result[e] = Rule(Term("==", e, 0.0), sentence)
                        result[e].broken.location = quotient.location
        return tuple(result.values())

    def _nominal_velocity_rules(self) -> list[Rule]:
        """Return a rule for each nominal_velocity that is not positive by its range: it bounds steps and errors."""
        result = []
        for s in (*self.states, *self.drivers):
            e = s.nominal_velocity
            if e is not None and not (isinstance(e, (Parameter, Fixed)) and e.above >= 0.0):
                comparison = Term("<=", e, 0.0)
                comparison.location = s.location
                values = ", ".join(f"{variable.label} = {{{variable.name}!r}}" for variable in variables_in(e)) or repr(
                    e
                )
                result.append(Rule(comparison, f"nominal_velocity of {s.name} must be above 0, got {values}"))
        return result

    @property
    def checks_event_steps(self) -> bool:
        """Whether a long step may miss how forces vary: by steep friction laws, or conditions inside of it."""
        laws = [c.slide for c in self.contacts]
        dependent_ids = dependents(laws, self.states)
        steep_laws = any(
            isinstance(e, Term) and e.op in STEEP_FUNCTIONS and id(e.args[-1]) in dependent_ids
            for e in operands_first(*laws)
        )
        return steep_laws or not all(condition.is_frozen for condition in self.switches)

    @property
    def conditions(self) -> list[Condition]:
        """Conditions of choose(), then limits."""
        return [*self.switches, *self.limits]

    @property
    def has_pieces(self) -> bool:
        """Whether the piece of a table may change during a step."""
        return any(condition.piece is not None for condition in self.switches)

    @property
    def angles(self) -> list[State]:
        """States in rad that enter the equations of motion by periodic functions only, and by at least one of these."""
        equations = self._dynamic_expressions()
        margins = [condition.margin for condition in self.conditions]

        def operands_outside(e: Operand) -> tuple[Operand, ...]:
            return () if isinstance(e, Term) and e.op in PERIODIC else operands(e)

        outside_ids = {id(e) for e in operands_first(*equations, *margins, operands_of=operands_outside)}
        inside_ids = {id(e) for e in operands_first(*equations)}
        return [s for s in self.states if s.unit == "rad" and id(s) in inside_ids - outside_ids]

    def _keeps_closed_form(self, e: Input) -> bool:
        """Return whether breakaway and motion keep their closed form while the input changes."""
        others = (TIME, *self.drivers, *self.inputs)
        if self.rests_when_stuck:
            (c,) = self.contacts
            if depends_on(self.holding_limit[c], (e,)) or depends_on(self.derivative(self.load[c], {e: 1.0}), others):
                return False
        return not self.closed_form or self._has_constant_effect(e, self.closed_form)

    def _has_constant_effect(self, e: Input, closed_form: tuple[Operand, ...]) -> bool:
        """Return whether an input is a term of the acceleration of a closed form, with a constant factor."""
        constants = (*closed_form, *(c.slide for c in self.contacts))
        effect = self.derivative(self.rate_outputs[self.dynamic_states[0]].expression, {e: 1.0})
        return not any(depends_on(constant, (e,)) for constant in constants) and not depends_on(
            effect, (*self.time_varying, *self.inputs)
        )

    @cached_property
    def closed_form(self) -> tuple[Operand, Operand, Operand, Operand] | None:
        """Mass, damping, stiffness and speed of the equilibrium point of a linear single-body model, else None."""
        result = self._linear_coefficients()
        if result is None:
            return None
        is_linear = all(
            self._has_constant_effect(e, result) and all(map(self.is_ramp, self.rate_outputs.values()))
            for e in self.prescribed_inputs
        )
        has_condition = any(has_condition_on(rate, self.prescribed_inputs) for rate in self.rate_outputs.values())
        return result if is_linear and not has_condition else None

    def _linear_coefficients(self) -> tuple[Operand, Operand, Operand, Operand] | None:
        """Return the coefficients of the closed form, regardless of inputs."""
        if (
            len(self.states) != 2
            or len(self.dynamic_states) != 1
            or any(depends_on(c.slide, self.time_varying) for c in self.contacts)
        ):
            return None
        if self.contacts and not self.rests_when_stuck:
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
            forces = (*self.load_expressions(c), c.slide)
            return any(depends_on(expression, self.input_symbols) for expression in forces)
        return id(e) in self._direct_outputs

    @cached_property
    def _direct_outputs(self) -> set[int]:
        """The identities of the expressions in outputs that depend directly on an input."""
        contacts = [c for c in self.contacts if self.has_direct_feedthrough(c)]
        return dependents(self.outputs, (*self.inputs, *contacts))
