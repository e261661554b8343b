"""Roles of the variables of a model: parameters, inputs, states and their rates, drivers, contacts, outputs.

Variables are identified by name and declared role, never by order.
"""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from ...runtime.codes import MAX_INPUT_ORDER
from .algebra import depends_on, differentiate, has_condition_on, is_same_expression, variables_in
from .expressions import Expression, ModelError, Operand, describe, is_among
from .model_declaration import Choice, Contact, Fixed, Input, Mode, Model, Output, Parameter, Rule, State, Variable
from .reserved_names import RESERVED_NAMES, check_name, is_reserved_in_c
from .tables import Table

TIME = Expression()
TIME.name = "t"


class ModelRoles:
    """The variables of a model by role, and the derivatives of those that vary."""

    def __init__(self, model: type[Model], has_input_derivatives: bool = False) -> None:
        self.model, self.name = model, model.__name__
        self.names: dict[Expression, str] = {}  # of derived terms
        if self.name in RESERVED_NAMES or is_reserved_in_c(self.name) or not self.name.isascii():
            raise ModelError(
                f"the class name {self.name} is reserved or not ASCII: choose another name", model.location
            )
        # an alias such as D for mu_s does not count
        self.named_expressions = [e for name, e in vars(model).items() if isinstance(e, Expression) and e.name == name]
        for e in self.named_expressions:
            check_name(e.name, e)
        self.variables: list[Variable] = [e for e in self.named_expressions if isinstance(e, Variable)]
        self.tables = [e for e in self.named_expressions if isinstance(e, Table)]
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
        self.prescribed_inputs = [e for e in self.inputs if e.declared_rate is not None]
        for e in self.prescribed_inputs:
            self._check_declared_rate(e)
        self.input_orders = self._input_orders()
        # symbols for the first derivatives of inputs, and for the second ones of those with a declared rate
        self.input_rates = {
            e: derivative_symbol(e, "rate")
            for e in self.inputs
            if is_among(e, self.prescribed_inputs) or (has_input_derivatives and self._accepts_derivatives(e))
        }
        self.input_second_rates = {e: derivative_symbol(e, "second_rate") for e in self.prescribed_inputs}
        self.time_derivatives = (
            {s: self.rate[s] for s in self.states} | self.explicit_time_derivatives | self.input_derivatives
        )

    def derivative(self, e: Operand, by: Mapping[Expression, Operand]) -> Operand:
        """Return the derivative of e, where `by` gives the derivatives of the variables, and name its terms."""
        return differentiate(e, by, self.names)

    def _of_type(self, *kinds: type) -> list[Any]:
        return [e for e in self.variables if isinstance(e, kinds)]

    def _add_driver_rates(self) -> None:
        """Add an output for the rate of each state with a given rate.

        One driver of constant speed that starts at zero is excluded: its position is known in closed form.
        """
        for s in self.states:
            if s.constant_rate is not None:
                unit = s.constant_rate.unit if isinstance(s.constant_rate, Variable) else f"{s.unit}/s"
                law = Output(unit, f"rate of {s.name}", s.constant_rate, rate_of=s)
                law.name, law.location = f"{s.name}_rate", s.location
                if any(e.name == law.name for e in self.variables):
                    raise ModelError(
                        f"the name {law.name} is reserved for the rate of {s.name}: choose another name", s.location
                    )
                self.variables.append(law)

    def _find_rates(self) -> None:
        """Find the rate of every state; it may be another state."""
        self.rate: dict[State, State | Output] = {}
        for e in self.variables:
            if isinstance(e, (State, Output)) and e.integrates is not None:
                if not is_among(e.integrates, self.states):
                    integrates = getattr(e.integrates, "name", "") or describe(e.integrates)
                    raise ModelError(
                        f"rate_of of {e.name} is {integrates}, which is not a state of the model", e.location
                    )
                if e.integrates in self.rate:
                    names = f"{e.name} and {self.rate[e.integrates].name}"
                    raise ModelError(f"{names} both declare rate_of={e.integrates.name}", e.location)
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
        if isinstance(e, Input) and e.declared_rate is not None:
            return [e.declared_rate]
        if isinstance(e, Contact):
            return [expression for expression in (e.mode, e.slip, e.slide, e.hold, e.eps) if expression is not None]
        return []

    def _input_orders(self) -> dict[Input, int]:
        """Return the order of the polynomial that continues each input with a declared rate."""
        orders: dict[Input, int] = {}
        for e in self.prescribed_inputs:  # a rate is declared before its input
            order_of_rate = max(
                (orders[variable] for variable in orders if depends_on(e.declared_rate, (variable,))), default=0
            )
            orders[e] = min(1 + order_of_rate, MAX_INPUT_ORDER)
        return orders

    def _accepts_derivatives(self, e: Input) -> bool:
        """Return whether the importer may set the derivative of an input.

        An input with a range may not leave it, and one that is the rate of another input would raise its order.
        """
        is_taken = any(variable.name in derivative_names(e) for variable in self.variables)
        is_rate = any(depends_on(variable.declared_rate, (e,)) for variable in self.prescribed_inputs)
        return not is_taken and not is_rate and not has_range(e)

    def is_ramp(self, e: Operand) -> bool:
        """Return whether an expression is linear in time as far as it depends on inputs with declared rates."""
        return not depends_on(e, [variable for variable, order in self.input_orders.items() if order > 1])

    def _check_declared_rate(self, e: Input) -> None:
        """Raise ModelError for a rate by which an input cannot be continued as a polynomial in time."""
        if has_range(e):
            raise ModelError(
                f"{e.name} has a rate and a range, but its rate may lead out of the range: remove one of them",
                e.location,
            )
        for variable in self.variables:
            if variable.name in derivative_names(e):
                raise ModelError(
                    f"the name {variable.name} is reserved for the derivatives of {e.name}: choose another name",
                    variable.location,
                )
        others = [
            variable
            for variable in variables_in(e.declared_rate)
            if not isinstance(variable, (Input, Parameter, Fixed, Choice))
        ]
        if others:
            raise ModelError(
                f"rate of {e.name} depends on {others[0].name}: it must be an input, or an expression of inputs and "
                f"parameters; otherwise declare {e.name} as a State",
                e.location,
            )
        slopes = [differentiate(e.declared_rate, {variable: 1.0}) for variable in self.inputs]
        if has_condition_on(e.declared_rate, self.inputs) or any(depends_on(slope, self.inputs) for slope in slopes):
            raise ModelError(
                f"rate of {e.name} must be linear in the inputs: declare {e.name} as a State with this rate", e.location
            )

    @property
    def rate_inputs(self) -> dict[str, list[str]]:
        """Names of the inputs on which the declared rate of each input depends; without inputs of constant rate 0."""
        return {
            e.label: [variable.label for variable in variables_in(e.declared_rate) if isinstance(variable, Input)]
            for e in self.prescribed_inputs
            if not is_same_expression(e.declared_rate, 0.0)
        }

    @property
    def input_derivatives(self) -> dict[Expression, Operand]:
        """Derivatives of inputs, and of the rates of those with a declared rate."""
        return self.input_rates | {self.input_rates[e]: second for e, second in self.input_second_rates.items()}

    @property
    def input_symbols(self) -> tuple[Expression, ...]:
        """Inputs, and the symbols for their derivatives."""
        return (*self.inputs, *self.input_rates.values(), *self.input_second_rates.values())

    def declared_derivatives(self) -> dict[Expression, Operand]:
        """Return what the declared rates give for the symbols of derivatives: expressions of inputs and parameters."""
        rates: dict[Expression, Operand] = {self.input_rates[e]: e.declared_rate for e in self.prescribed_inputs}
        by = {e: e.declared_rate for e in self.prescribed_inputs}
        seconds = {symbol: differentiate(e.declared_rate, by) for e, symbol in self.input_second_rates.items()}
        return rates | seconds

    @property
    def explicit_time_derivatives(self) -> dict[Expression, Operand]:
        """Derivatives with respect to time at constant states."""
        return {TIME: 1.0} | {d: d.constant_rate for d in self.drivers}

    @property
    def coasting_derivatives(self) -> dict[Expression, Operand]:
        """Time derivatives without acceleration: also inputs at their rates and positions at their speeds."""
        return self.explicit_time_derivatives | self.input_derivatives | {x: self.rate[x] for x in self.positions}

    @property
    def ordered_outputs(self) -> list[Variable]:
        """Outputs in the order of the model description: states, rates, drivers, others, modes."""
        rates = [self.rate[s] for s in self.dynamic_states]
        others = [e for e in self.variables if isinstance(e, (Output, Contact)) and not is_among(e, rates)]
        return [*self.states, *rates, *self.drivers, *others, *self.modes]


def derivative_names(e: Input) -> tuple[str, ...]:
    """Return the names of attributes that belong to the derivatives of an input."""
    return f"{e.name}_rate", f"{e.name}_second_rate", f"{e.name}_polynomial"


def derivative_symbol(e: Input, word: str) -> Parameter:
    """Return a symbol for a derivative of an input."""
    symbol = Parameter(0.0, f"{e.unit}/s", f"rate of {e.name}")
    symbol.name = f"{e.name}_{word}"
    return symbol


def has_range(e: Input) -> bool:
    """Return whether an input has bounds."""
    return any(map(isfinite, (e.low, e.high, e.above, e.below)))
