"""Roles of the variables of a model: parameters, inputs, states and their rates, drivers, contacts, outputs.

Variables are identified by name and declared role, never by order.
"""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from .algebra import differentiate, is_same_expression
from .expressions import Expression, ModelError, Operand, describe, is_among
from .model_declaration import Choice, Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State, Variable
from .reserved_names import RESERVED, check_name, is_reserved_in_c

TIME = Expression()
TIME.name = "t"


class ModelRoles:
    """The variables of a model by role, and the derivatives of those that vary."""

    def __init__(self, model: type[Model], has_input_derivatives: bool = False) -> None:
        self.model, self.name = model, model.__name__
        self.names: dict[Expression, str] = {}  # of derived terms
        if self.name in RESERVED or is_reserved_in_c(self.name) or not self.name.isascii():
            raise ModelError(
                f"the class name {self.name} is reserved or not ASCII: choose another name", model.location
            )
        # an alias such as D for mu_s does not count
        self.named = [e for name, e in vars(model).items() if isinstance(e, Expression) and e.name == name]
        for e in self.named:
            check_name(e.name, e)
        self.declared: list[Variable] = [e for e in self.named if isinstance(e, Variable)]
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
        self.input_rates = (
            {e: rate for e in self.inputs if (rate := self._input_rate(e)) is not None} if has_input_derivatives else {}
        )
        self.time_derivatives = (
            {s: self.rate[s] for s in self.states} | self.explicit_time_derivatives | self.input_rates
        )

    def derivative(self, e: Operand, by: Mapping[Expression, Operand]) -> Operand:
        """Return the derivative of e, where `by` gives the derivatives of the variables, and name its terms."""
        return differentiate(e, by, self.names)

    def _of_type(self, *kinds: type) -> list[Any]:
        return [e for e in self.declared if isinstance(e, kinds)]

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

    @staticmethod
    def declared_expressions(e: Variable) -> list[Operand]:
        """Return the expressions in the declaration of a variable."""
        if isinstance(e, Output):
            return [e.expression]
        if isinstance(e, State):
            return [
                expression
                for expression in (e.start_expression, e.constant_rate, e.nominal_velocity)
                if expression is not None
            ]
        if isinstance(e, Contact):
            return [expression for expression in (e.mode, e.slip, e.slide, e.hold, e.eps) if expression is not None]
        return []

    def _input_rate(self, e: Input) -> Parameter | None:
        """Return a symbol for the rate of an input, or None if its names are in use or the input has a range."""
        rate = Parameter(0.0, f"{e.unit}/s", f"rate of {e.name}")
        rate.name = f"{e.name}_rate"
        is_taken = any(variable.name in (rate.name, f"{e.name}_polynomial") for variable in self.declared)
        return None if is_taken or any(map(isfinite, (e.low, e.high, e.above, e.below))) else rate

    @property
    def explicit_time_derivatives(self) -> dict[Expression, Operand]:
        """Derivatives with respect to time at constant states."""
        return {TIME: 1.0} | {d: d.constant_rate for d in self.drivers}

    @property
    def coasting_derivatives(self) -> dict[Expression, Operand]:
        """Time derivatives without acceleration: also inputs at their rates and positions at their speeds."""
        return self.explicit_time_derivatives | self.input_rates | {x: self.rate[x] for x in self.positions}

    @property
    def ordered_outputs(self) -> list[Variable]:
        """Outputs in the order of the model description: states, rates, drivers, others, modes."""
        rates = [self.rate[s] for s in self.dynamic_states]
        others = [e for e in self.declared if isinstance(e, (Output, Contact)) and not is_among(e, rates)]
        return [*self.states, *rates, *self.drivers, *others, *self.modes]
