"""The variables that an author declares, and what says how they hang together."""

from collections.abc import MutableMapping
from typing import Any

from ...runtime import variable_declarations
from .expressions import Expression, ModelError, Operand, Term, as_operand, author_location

HYBRID, SIGN, THRESHOLD = "hybrid", "sign", "threshold"


class Variable(Expression, variable_declarations.VariableDeclaration):
    """What has a name, a unit, words and a range."""

    def __set_name__(self, owner: object, name: str) -> None:
        """It has its name since it was first assigned: D = mu_s does not change that."""


class Parameter(Variable, variable_declarations.Parameter):
    """Set by the user, tunable at every communication point.

    Parameter(start, unit, text): the start value in `unit`, which is SI, and what it is in a few words.  A range is
    given by `low`, `high` (at least, at most), `above`, `below`; a unit that people rather read by `display`; the name
    that it has elsewhere, and in FMI 3.0 here too, by `alias`.
    """


class Fixed(Variable, variable_declarations.Fixed):
    """As Parameter, but set before initialisation ends: where a state starts, for example."""


class Input(Variable, variable_declarations.Input):
    """As Parameter, but set by the importer while it runs."""


class Choice(Variable, variable_declarations.Choice):
    """An enumeration, label=sentence for each item: numbered from 1, and the first is the default."""

    def __init__(self, text: str, **items: str) -> None:
        if not items:
            raise ModelError("a Choice has items, each with what it is: label=sentence")
        super().__init__(1, text, tuple((label, n, sentence) for n, (label, sentence) in enumerate(items.items(), 1)))
        self.tests = {label: Term("==", self, n) for n, label in enumerate(items, 1)}

    def choose(self, **cases: Operand) -> Operand:
        """The expression of the item in force, by its label."""
        if set(cases) != set(self.tests):
            raise ModelError(f"choose() has a case for each of {', '.join(self.tests)}, and for nothing else")
        *rest, (_, value) = cases.items()
        for label, case in reversed(rest):
            value = Term("choose", self.tests[label], case, value)
        return value


class State(Variable, variable_declarations.Output):
    """A continuous state.

    `start`: a number or an expression of parameters.  `rate_of`: the state that this one is the rate of, as a speed is
    of a position.  `rate`: what the rate of this one is for all time, as of a driver, a parameter or an expression of
    such.  `nominal_velocity`: the size that a tolerance must resolve, where the law has one of its own.
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
    """What is calculated: unit, words, expression.  `rate_of`: the state whose rate it is."""

    def __init__(self, unit: str, text: str, expression: Operand, rate_of: State | None = None, **more: Any) -> None:
        super().__init__(unit, text, **more)
        self.expression, self.integrates = as_operand(expression), rate_of


class Mode(Variable, variable_declarations.Mode):
    """The direction of sliding: -1, 0 while stuck, or 1."""

    def __init__(self, text: str = "-1 sliding backward, 0 stuck, 1 sliding forward") -> None:
        super().__init__(text)


class Contact(Variable, variable_declarations.Output):
    """The force of dry friction in a contact, an unknown of the equations; positive where it opposes a positive slip.

    mode: its declared Mode.  slip: the relative speed, a state or an expression of such, as v - v_belt; several of them
    may push one body.  slide: the force while it slides, at least 0.  hold: the most that it holds, at least as much;
    left out, the sliding force at zero slip.  laws: HYBRID, and beside it SIGN or THRESHOLD, which needs eps, the slip
    below which it holds.
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
        **more: Any,
    ) -> None:
        super().__init__(unit, text, **more)
        self.mode, self.slip, self.slide, self.laws, self.eps = mode, slip, as_operand(slide), laws, eps
        self.hold = None if hold is None else as_operand(hold)
        if laws not in ((HYBRID,), (HYBRID, SIGN), (HYBRID, THRESHOLD)):
            raise ModelError(f"laws = {laws!r} is refused: HYBRID comes first, and beside it SIGN or THRESHOLD")
        if (eps is not None) != (THRESHOLD in laws):
            raise ModelError("eps is given with the law THRESHOLD, and with no other")


class Rule:
    """A comparison of parameters that must not hold, and the sentence about it, with values as {name!r}."""

    def __init__(self, broken: Operand, sentence: str) -> None:
        self.broken, self.sentence = broken, sentence


class _ClassBody(dict[str, Any]):
    """The body of the class of a model, in which no name has two equations."""

    def __setitem__(self, name: str, value: Any) -> None:
        if isinstance(self.get(name), Expression):
            raise ModelError(f"{name} has two equations: give the second another name")
        if isinstance(value, Expression):
            value.name = value.name or name
        super().__setitem__(name, value)


class _ModelMeta(type):
    location: tuple[str, int]

    @classmethod
    def __prepare__(cls, name: str, bases: tuple[type, ...], /, **_: Any) -> MutableMapping[str, object]:
        return _ClassBody()

    def __new__(cls, name: str, bases: tuple[type, ...], body: dict[str, Any]) -> "_ModelMeta":
        made = super().__new__(cls, name, bases, dict(body))
        made.location = author_location()
        return made


class Model(metaclass=_ModelMeta):
    """What a model derives from: its docstring is its page, its body its variables and equations.

    `rules`: one Rule or several.  The default run: `stop_time` and `step_size` in s, relative `tolerance`, `method`.
    """

    rules: Rule | tuple[Rule, ...] = ()
    stop_time = 4.0
    step_size = 0.004
    tolerance = 1e-6
    method = ""
