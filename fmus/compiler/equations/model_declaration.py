"""Declarations in a model file: variables, contacts, rules and the base class Model."""

from collections.abc import Callable, MutableMapping
from difflib import get_close_matches
from functools import cached_property
from inspect import Parameter as Argument
from inspect import Signature, cleandoc, signature
from linecache import getline
from types import FunctionType, ModuleType
from typing import Annotated, Any, ClassVar, NamedTuple, TypedDict, Unpack, get_type_hints

from ...runtime.variable_declarations import VariableDeclaration, exported_name
from .expressions import Expression, ModelError, Operand, Term, as_operand, author_location, describe, is_comparison

HYBRID, SIGN, THRESHOLD = "hybrid", "sign", "threshold"
SETTINGS = ("rules", "stop_time", "step_size", "tolerance", "method")  # attributes of Model
FUNCTION_TYPES = (FunctionType, property, staticmethod, classmethod, cached_property)
OPTIONS_ENTRY = "**options\n    See the table of options."  # of docstrings


class Options(TypedDict, total=False):
    """Options of variables: type, meaning and, for some, the attribute of a Real in the XML."""

    low: Annotated[float, "Inclusive lower bound."]
    high: Annotated[float, "Inclusive upper bound."]
    above: Annotated[float, "Exclusive lower bound."]
    below: Annotated[float, "Exclusive upper bound."]
    display: Annotated[str, 'Display unit, such as "deg".', "displayUnit"]


class Option(NamedTuple):
    """Type, meaning and XML attribute of an option."""

    type: type
    text: str
    attribute: str = ""


OPTIONS = {
    name: Option(hint.__origin__, *hint.__metadata__)
    for name, hint in get_type_hints(Options, include_extras=True).items()
}


def signature_text(function: Callable[..., object]) -> str:
    """Return the arguments of a function or class, with those that can be left out as name=."""
    texts = [
        str(parameter).split(":")[0] if parameter.default is parameter.empty else f"{parameter.name}="
        for parameter in signature(function).parameters.values()
    ]
    return f"({', '.join(texts)})"


class Variable(Expression, VariableDeclaration):
    """A declared variable: name, unit, description and options such as its range."""

    __signature__: ClassVar[Signature]

    def __init_subclass__(cls) -> None:
        """Name the single options instead of **options in the signature and the docstring, which help() shows."""
        _, *arguments = signature(cls.__init__).parameters.values()
        if arguments[-1].name == "options":
            arguments[-1:] = [Argument(name, Argument.KEYWORD_ONLY, default=None) for name in OPTIONS]
        cls.__signature__ = Signature(arguments)
        texts = "\n".join(f"{name}\n    {option.text}" for name, option in OPTIONS.items())
        cls.__doc__ = cleandoc(cls.__doc__ or "").replace(OPTIONS_ENTRY, texts)

    def __init__(self, unit: str, text: str, **options: Unpack[Options]) -> None:
        for word in options:
            if word not in OPTIONS:
                raise TypeError(f"{type(self).__name__}() got an unexpected keyword argument {word!r}")
        texts = {word: value for word, value in options.items() if OPTIONS[word].type is str}
        for word, value in {"unit": unit, "text": text, **texts}.items():
            if not isinstance(value, str):
                raise ModelError(
                    f"{word} of a declaration must be a string, got {describe(value)}: write "
                    f"{type(self).__name__}{signature_text(type(self))}"
                )
        VariableDeclaration.__init__(self, unit, text, **options)
        self.location = author_location()

    def __set_name__(self, owner: object, name: str) -> None:
        """Keep the name of the first assignment; an alias such as D = mu_s does not change it."""

    @property
    def label(self) -> str:
        """Name in the FMU."""
        return exported_name(self.name, self)


class SettableVariable(Variable):
    """A variable with a value that the user or another FMU sets."""

    def __init__(self, start: float, unit: str, text: str, **options: Unpack[Options]) -> None:
        Variable.__init__(self, unit, text, **options)
        self.start = start


class Parameter(SettableVariable):
    """A parameter, tunable at every communication point.

    Parameters
    ----------
    start
        Default value in `unit`.
    unit
        SI unit, such as "N.s/m".
    text
        Short description.
    **options
        See the table of options.
    """

    causality, variability = "parameter", "tunable"


class Fixed(SettableVariable):
    """A parameter that is fixed after initialization, such as the start value of a state.

    Parameters
    ----------
    start, unit, text
        As for Parameter.
    **options
        See the table of options.
    """

    causality, variability = "parameter", "fixed"


class Input(SettableVariable):
    """An input, set by another FMU or by the importer during the run. ::

        F_ext = Input(0.0, "N", "external force on the mass")
        a_belt = Input(0.0, "m/s2", "acceleration of the belt")
        v_belt = Input(0.2, "m/s", "speed of the belt", rate=a_belt)

    An input with a rate has no range.

    Parameters
    ----------
    start, unit, text
        As for Parameter.
    rate
        Derivative of the input by time: another input, or a linear expression of inputs with parameters as
        coefficients.  It continues the input between communication points.  An input in the slip of a contact needs
        it; rate=0.0 means constant between jumps.
    **options
        See the table of options.
    """

    causality = "input"

    def __init__(
        self,
        start: float,
        unit: str,
        text: str,
        rate: Operand = None,
        **options: Unpack[Options],
    ) -> None:
        SettableVariable.__init__(self, start, unit, text, **options)
        self.declared_rate: Operand = None if rate is None else as_operand(rate)


class Choice(Variable):
    """An enumeration, numbered from 1; the first item is the default.

    Parameters
    ----------
    text
        Short description.
    **items
        Items as label="meaning".
    """

    type, is_integer, causality, variability = "Enumeration", True, "parameter", "fixed"

    def __init__(self, text: str, **items: str) -> None:
        if not items:
            raise ModelError("a Choice needs at least one item: label=sentence")
        Variable.__init__(self, "", text)
        self.start = 1
        self.items = tuple((label, n, sentence) for n, (label, sentence) in enumerate(items.items(), 1))
        self.tests = {label: Term("==", self, n) for n, label in enumerate(items, 1)}

    def choose(self, **cases: Operand) -> Operand:
        """Return the expression of the selected item; cases are given by label."""
        if set(cases) != set(self.tests):
            raise ModelError(f"choose() needs exactly one case for each of {', '.join(self.tests)}")
        *rest, (_, value) = cases.items()
        for label, case in reversed(rest):
            value = Term("choose", self.tests[label], case, value)
        return value


class State(Variable):
    """A continuous state. ::

        x = State("m", "position", start=0.1)
        v = State("m/s", "speed", rate_of=x)
        a = Output("m/s2", "acceleration", (-k * x - F_friction) / m, rate_of=v)
        x_driver = State("m", "position of the driver", rate=v_driver)

    Its rate is the state or output with `rate_of`, or its own constant `rate`.  Its range is a property of the solution
    and is not enforced.

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
    **options
        See the table of options.
    """

    role = "state"

    def __init__(
        self,
        unit: str,
        text: str,
        start: Operand = 0.0,
        rate_of: "State | None" = None,
        rate: Operand = None,
        nominal_velocity: Operand = None,
        **options: Unpack[Options],
    ) -> None:
        Variable.__init__(self, unit, text, **options)
        self.start_expression, self.integrates, self.nominal_velocity = as_operand(start), rate_of, nominal_velocity
        self.constant_rate: Operand = None if rate is None else as_operand(rate)


class Output(Variable):
    """A calculated variable; its range is a property of the solution and is not enforced.

    Parameters
    ----------
    unit, text
        As for Parameter.
    expression
        The value, an expression of other variables.
    rate_of
        The state whose derivative this is.
    **options
        See the table of options.
    """

    def __init__(
        self,
        unit: str,
        text: str,
        expression: Operand,
        rate_of: State | None = None,
        **options: Unpack[Options],
    ) -> None:
        Variable.__init__(self, unit, text, **options)
        self.expression, self.integrates = as_operand(expression), rate_of


class Mode(Variable):
    """The direction of sliding: -1, 0 while stuck, or 1."""

    type, is_integer, variability, start = "Integer", True, "discrete", 0

    def __init__(self, text: str = "-1 sliding backward, 0 stuck, 1 sliding forward") -> None:
        Variable.__init__(self, "", text)
        self.low, self.high = -1, 1


class Contact(Variable):
    """The force of dry friction in a contact, an unknown of the equations; positive if it opposes a positive slip. ::

        mode = Mode()
        F_friction = Contact("N", "friction force", mode=mode, slip=v, slide=mu_d * m * g, hold=mu_s * m * g)
        a = Output("m/s2", "acceleration", (F_ext - F_friction) / m, rate_of=v)

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
        lifted off; its force is zero and it does not stick.  A sliding force that depends on the direction says nothing
        about rest: there the contact has lifted off while `hold` is negative.  False: it never occurs, by the form of
        the equations.
    **options
        See the table of options.
    """

    role = "contact"

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
        **options: Unpack[Options],
    ) -> None:
        Variable.__init__(self, unit, text, **options)
        if not isinstance(mode, Mode):
            raise ModelError(f"mode of a Contact must be a Mode that is declared before it, got {describe(mode)}")
        if not isinstance(slip, Expression) or is_comparison(slip):
            raise ModelError(f"slip of a Contact must be an expression of states, got {describe(slip)}")
        self.mode, self.slide, self.laws, self.eps = mode, as_operand(slide), laws, eps
        self.slide_while_closed = self.slide
        self.slip: Operand = slip
        self.hold = None if hold is None else as_operand(hold)
        if lifts_off not in (None, True, False):
            raise ModelError(f"lifts_off must be True, False or None, got {describe(lifts_off)}")
        self.lifts_off = lifts_off
        if laws not in ((HYBRID,), (HYBRID, SIGN), (HYBRID, THRESHOLD)):
            raise ModelError(f"laws must be (HYBRID,), (HYBRID, SIGN) or (HYBRID, THRESHOLD), got {laws!r}")
        if (eps is not None) != (THRESHOLD in laws):
            raise ModelError("eps is required with the law THRESHOLD and not allowed without it")


class PlanarContact(Contact):
    """The force of dry friction of a body on a plane, with the same limit in all directions. ::

        mode = Mode("0 stuck, 1 sliding")
        R = PlanarContact("N", "friction", mode=mode, slip=(v_x, v_y), slide=mu * m * g)
        a_x = Output("m/s2", "acceleration along x", (F_x - R.x) / m, rate_of=v_x)
        a_y = Output("m/s2", "acceleration along y", (F_y - R.y) / m, rate_of=v_y)

    `R` is the size of the force, and `R.x` and `R.y` are its components, which oppose the slip: they are outputs of the
    FMU as well.  `R.speed` is the size of the slip, and `R.direction` the pair of components of its direction; at rest,
    those of the direction of the load.

    Parameters
    ----------
    unit, text
        As for Parameter.
    mode
        The declared Mode of the contact: 0 stuck, 1 sliding.
    slip
        Both components of the relative velocity: states or sums of states and prescribed motions, such as v_x - v_belt.
    slide
        Force while sliding, at least 0.
    hold
        Largest force while stuck, at least `slide`; by default the sliding force at rest.
    **options
        See the table of options.
    """

    def __init__(
        self,
        unit: str,
        text: str,
        mode: Mode,
        slip: tuple[Operand, Operand],
        slide: Operand,
        hold: Operand = None,
        **options: Unpack[Options],
    ) -> None:
        if not isinstance(slip, tuple) or len(slip) != 2:
            raise ModelError(
                f"slip of a PlanarContact must be a pair of speeds, as in (v_x, v_y), got {describe(slip)}"
            )
        x, y = map(as_operand, slip)
        self.slips = (x, y)
        self.speed = Term("sqrt", Term("+", Term("*", x, x), Term("*", y, y)))
        Contact.__init__(self, unit, text, mode, self.speed, slide, hold, **options)
        mode.low = 0
        # the analysis of the contacts sets their expressions
        self.x, self.y = (Output(unit, f"{text}, component along {axis}", 0.0) for axis in ("x", "y"))
        self.own_variables = (("_x", ".x", self.x), ("_y", ".y", self.y))
        self.direction = (
            Term("slip_direction", x, y, self.x, self.y, 0.0, mode),
            Term("slip_direction", y, x, self.y, self.x, 0.0, mode),
        )

    @property
    def components(self) -> tuple[Output, Output]:
        """The components of the force."""
        return self.x, self.y


class Rule:
    """Parameters that the model refuses.

    Parameters
    ----------
    broken
        A comparison of parameters that must not be true.
    sentence
        The error message, with values as {name!r}.
    """

    def __init__(self, broken: Operand, sentence: str) -> None:
        self.broken, self.sentence = broken, sentence


class _ClassBody(dict[str, Any]):
    """Namespace of a model class: rejects a second equation for a name, and records values that nothing reads."""

    def __init__(self) -> None:
        super().__init__()
        self.unread_names: dict[str, tuple[str, int]] = {}  # name -> file and line

    def __getitem__(self, name: str) -> Any:
        value = super().__getitem__(name)
        self.unread_names.pop(name, None)
        return value

    def __setitem__(self, name: str, value: Any) -> None:
        if not isinstance(name, str):
            raise ModelError(
                f"the name {name!r} is no identifier: use letters, digits and _, and no digit at the start"
            )
        if isinstance(self.get(name), Expression) or (name in SETTINGS and name in self.unread_names):
            if element := getattr(self[name], "element", "") or getattr(value, "element", ""):
                raise ModelError(f"the name {name} is reserved for {element}: choose another name")
            raise ModelError(
                f"{name} is assigned twice: give the second equation another name, or add terms in a list by sum(terms)"
            )
        if isinstance(value, Expression):
            value.name = value.name or name
            self.unread_names.pop(name, None)
            for suffix, element, variable in value.own_variables:
                variable.element = name + element
                self[name + suffix] = variable
        else:
            self.unread_names[name] = author_location()
        super().__setitem__(name, value)

    def check_unread(self) -> None:
        """Raise ModelError for a value that neither the body reads nor the build, such as a misspelt setting."""
        for name, location in self.unread_names.items():
            value = self.get(name)
            is_function = isinstance(value, FUNCTION_TYPES) and not name.startswith("__annotate")
            is_loop_variable = getline(*location).lstrip().startswith("for ")
            is_private = name.startswith("_") and not is_function
            is_harmless = isinstance(value, (ModuleType, type)) or is_private or is_loop_variable
            if name not in self or name in SETTINGS or is_harmless:
                continue
            if is_function:
                sentence = f"nothing calls the function {name}: a model has no methods, write its equation as an Output"
            elif close := get_close_matches(name, SETTINGS, 1):
                sentence = f"nothing uses {name}: write {close[0]}, or remove it"
            elif isinstance(value, tuple) and len(value) == 1 and isinstance(value[0], (Expression, Rule)):
                sentence = f"{name} is a tuple, because its line ends with a comma: remove the comma"
            elif isinstance(value, Rule):
                sentence = f"nothing uses the rule {name}: write rules = Rule(...), or a tuple of rules"
            else:
                value_text = f" = {value!r}" if isinstance(value, (int, float)) else ""
                sentence = (
                    f"nothing uses {name}{value_text}: declare it as Parameter and use it in an equation, or remove it"
                )
            raise ModelError(sentence, location)


class _ModelMeta(type):
    location: tuple[str, int]

    @classmethod
    def __prepare__(cls, name: str, bases: tuple[type, ...], /, **_: Any) -> MutableMapping[str, object]:
        return _ClassBody()

    def __new__(cls, name: str, bases: tuple[type, ...], body: _ClassBody) -> "_ModelMeta":
        if bases:  # not Model itself
            if bases != (Model,):
                others = ", ".join(base.__name__ for base in bases if base is not Model)
                raise ModelError(
                    f"{name} derives from {others}, but a model can only derive from Model: copy the declarations "
                    "into one class"
                )
            body.check_unread()
        model = super().__new__(cls, name, bases, dict(body))
        model.location = author_location()
        return model

    def __setattr__(cls, name: str, value: object) -> None:
        """Set an attribute; raise ModelError if it is a declaration, which must be in the body of the class."""
        if any(isinstance(item, (Expression, Rule)) for item in (value, vars(cls).get(name))):
            raise ModelError(
                f"{cls.__name__}.{name} is set after the class: declare {name} in the body of the class",
                author_location(),
            )
        super().__setattr__(name, value)


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
