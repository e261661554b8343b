"""Declarations in a model file: variables, contacts, rules and the base class Model."""

from collections.abc import MutableMapping
from typing import Any

from ...runtime import variable_declarations
from .expressions import Expression, ModelError, Operand, Term, as_operand, author_location

HYBRID, SIGN, THRESHOLD = "hybrid", "sign", "threshold"


class Variable(Expression, variable_declarations.VariableDeclaration):
    """A declared variable: name, unit, description and range."""

    def __set_name__(self, owner: object, name: str) -> None:
        """Keep the name of the first assignment; an alias such as D = mu_s does not change it."""


class Parameter(Variable, variable_declarations.Parameter):
    """A parameter, tunable at every communication point.

    Parameters
    ----------
    start
        Default value in `unit`.
    unit
        SI unit, such as "N.s/m".
    text
        Short description.
    low, high
        Inclusive bounds.
    above, below
        Exclusive bounds.
    display
        Display unit, such as "deg".
    alias
        Alternative name, exported in FMI 3.0.
    """


class Fixed(Variable, variable_declarations.Fixed):
    """A parameter that is fixed after initialization, such as the start value of a state."""


class Input(Variable, variable_declarations.Input):
    """An input; arguments as for Parameter."""


class Choice(Variable, variable_declarations.Choice):
    """An enumeration with items label=sentence, numbered from 1; the first is the default."""

    def __init__(self, text: str, **items: str) -> None:
        if not items:
            raise ModelError("a Choice needs at least one item: label=sentence")
        super().__init__(1, text, tuple((label, n, sentence) for n, (label, sentence) in enumerate(items.items(), 1)))
        self.tests = {label: Term("==", self, n) for n, label in enumerate(items, 1)}

    def choose(self, **cases: Operand) -> Operand:
        """Return the expression of the selected item; cases are given by label."""
        if set(cases) != set(self.tests):
            raise ModelError(f"choose() needs exactly one case for each of {', '.join(self.tests)}")
        *rest, (_, value) = cases.items()
        for label, case in reversed(rest):
            value = Term("choose", self.tests[label], case, value)
        return value


class State(Variable, variable_declarations.Output):
    """A continuous state.

    Parameters
    ----------
    unit, text
        As for Parameter.
    start
        Initial value: a number or an expression of parameters.
    rate_of
        The state whose derivative this state is, such as the position of a speed.
    rate
        Constant rate of this state, such as the speed of a driver: a parameter or an expression of parameters.
    nominal_velocity
        Smallest magnitude that the integrator must resolve, where the friction law defines one.
    """

    def __init__(
        self,
        unit: str,
        text: str,
        start: Operand = 0.0,
        rate_of: "State | None" = None,
        rate: Operand = None,
        nominal_velocity: Operand = None,
        **more: Any,
    ) -> None:
        super().__init__(unit, text, **more)
        self.start_expression, self.integrates, self.nominal_velocity = as_operand(start), rate_of, nominal_velocity
        self.constant_rate: Operand = None if rate is None else as_operand(rate)


class Output(Variable, variable_declarations.Output):
    """A calculated variable: unit, description, expression; `rate_of` is the state whose derivative it is."""

    def __init__(self, unit: str, text: str, expression: Operand, rate_of: State | None = None, **more: Any) -> None:
        super().__init__(unit, text, **more)
        self.expression, self.integrates = as_operand(expression), rate_of


class Mode(Variable, variable_declarations.Mode):
    """The direction of sliding: -1, 0 while stuck, or 1."""

    def __init__(self, text: str = "-1 sliding backward, 0 stuck, 1 sliding forward") -> None:
        super().__init__(text)


class Contact(Variable, variable_declarations.Output):
    """The force of dry friction in a contact, an unknown of the equations; positive if it opposes a positive slip.

    Parameters
    ----------
    unit, text
        As for Parameter.
    mode
        The declared Mode of the contact.
    slip
        Relative speed: a state or an expression of states, such as v - v_belt.  Several contacts may act on one body.
    slide
        Force while sliding, at least 0.
    hold
        Largest force while stuck, at least `slide`; by default the sliding force at zero slip.
    laws
        (HYBRID,), (HYBRID, SIGN) or (HYBRID, THRESHOLD).
    eps
        Slip below which the law THRESHOLD holds; required with that law.
    lifts_off
        What a negative sliding force means.  None, the default: an error, which ends the run.  True: the contact has
        lifted off; its force is zero and it does not stick.  False: it never occurs, by the form of the equations.
    """

    def __init__(
        self,
        unit: str,
        text: str,
        mode: Mode,
        slip: Operand,
        slide: Operand,
        hold: Operand = None,
        laws: tuple[str, ...] = (HYBRID,),
        eps: Operand = None,
        lifts_off: bool | None = None,
        **more: Any,
    ) -> None:
        super().__init__(unit, text, **more)
        self.mode, self.slip, self.slide, self.laws, self.eps = mode, slip, as_operand(slide), laws, eps
        self.hold = None if hold is None else as_operand(hold)
        self.lifts_off = lifts_off
        if lifts_off:
            touches = Term(">", self.slide, 0.0)
            self.slide = Term("choose", touches, self.slide, 0.0)
            self.hold = None if hold is None else Term("choose", touches, self.hold, 0.0)
        if laws not in ((HYBRID,), (HYBRID, SIGN), (HYBRID, THRESHOLD)):
            raise ModelError(f"laws must be (HYBRID,), (HYBRID, SIGN) or (HYBRID, THRESHOLD), got {laws!r}")
        if (eps is not None) != (THRESHOLD in laws):
            raise ModelError("eps is required with the law THRESHOLD and not allowed without it")


class Rule:
    """A comparison of parameters that must not be true, and the error message, with values as {name!r}."""

    def __init__(self, broken: Operand, sentence: str) -> None:
        self.broken, self.sentence = broken, sentence


class _ClassBody(dict[str, Any]):
    """Namespace of a model class; rejects a second equation for a name."""

    def __setitem__(self, name: str, value: Any) -> None:
        if isinstance(self.get(name), Expression):
            raise ModelError(f"{name} is assigned twice: give the second equation another name")
        if isinstance(value, Expression):
            value.name = value.name or name
        super().__setitem__(name, value)


class _ModelMeta(type):
    location: tuple[str, int]

    @classmethod
    def __prepare__(cls, name: str, bases: tuple[type, ...], /, **_: Any) -> MutableMapping[str, object]:
        return _ClassBody()

    def __new__(cls, name: str, bases: tuple[type, ...], body: dict[str, Any]) -> "_ModelMeta":
        model = super().__new__(cls, name, bases, dict(body))
        model.location = author_location()
        return model


class Model(metaclass=_ModelMeta):
    """Base class of models: the docstring becomes the documentation page, the body declares variables and equations.

    Attributes
    ----------
    rules
        A Rule or a tuple of Rules.
    stop_time, step_size
        Default experiment in s.
    tolerance
        Relative tolerance of the default experiment.
    method
        Label of the default integration method.
    """

    rules: Rule | tuple[Rule, ...] = ()
    stop_time = 4.0
    step_size = 0.004
    tolerance = 1e-6
    method = ""
