"""Functions reachable from the entry points, specialised to the types of their arguments; callees come first."""

from itertools import count
from types import FunctionType

from ...runtime import step_control
from .c_statements import FunctionTranslator
from .c_types import CFunction, CType, ScalarTuple
from .struct_layout import StructLayout

# Inlined into `compute_next`, it would make every step of ode23 save registers: 20 instructions, 3 % of a step.
RARELY_CALLED = {step_control.repeat_steps.__qualname__}


class CallGraph:
    """The functions of a model object and of the other objects of an instance, as C."""

    def __init__(self, model: object, *others: object) -> None:
        self.layout = StructLayout(model, *others)
        self._functions: dict[tuple[object, ...], CFunction | None] = {}  # None: translation has started
        self._texts: list[str] = []
        self._tuples: dict[str, ScalarTuple] = {}
        self._names: set[str] = set()

    def add_model_entry_point(self, name: str, function: FunctionType, *arg_types: CType) -> CFunction:
        """Add an entry point whose first argument is the model, under the given C name."""
        return self.add_entry_point(function, [self.layout.model, *arg_types], name)

    def add_entry_point(self, function: FunctionType, arg_types: list[CType], name: str = "") -> CFunction:
        """Add an entry point. Entry points always have a fault flag."""
        body = FunctionTranslator(self.layout, self.specialise, function, arg_types)
        body.can_fault = True
        c_function = self._functions[(function, *arg_types)] = self._add(body, name or self._unique_name(function))
        return c_function

    def specialise(self, function: FunctionType, arg_types: list[CType]) -> CFunction | None:
        """Translate a function for given argument types; None means that it is recursive."""
        key = (function, *arg_types)
        if key not in self._functions:
            self._functions[key] = None
            self._functions[key] = self._add(
                FunctionTranslator(self.layout, self.specialise, function, arg_types), self._unique_name(function)
            )
        return self._functions[key]

    def _add(self, body: FunctionTranslator, name: str) -> CFunction:
        if isinstance(body.result, ScalarTuple):
            self._tuples[body.result.c] = body.result
        self._texts.append(body.text(name, body.function.__qualname__ in RARELY_CALLED))
        return CFunction(name, body.result, body.is_pure, body.can_fault)

    def _unique_name(self, function: FunctionType) -> str:
        """InternalStep_compute_next; stick_slip_sign for a function of a module."""
        base = function.__qualname__.replace(".", "_")
        if base == function.__name__:
            base = f"{function.__module__.rsplit('.', 1)[-1]}_{base}"
        names = (base if i == 1 else f"{base}_{i}" for i in count(1))
        name = next(name for name in names if name not in self._names)
        self._names.add(name)
        return name

    def text(self) -> str:
        """Return the C text: structs, constant arrays, then functions."""
        tuples = [
            f"{c} {{ {' '.join(f'{part.c} _{i};' for i, part in enumerate(ctype.parts))} }};\n"
            for c, ctype in self._tuples.items()
        ]
        arrays = [self.layout.array_definitions()] if self.layout.constant_arrays else []
        return "\n".join([self.layout.struct_definitions(), *arrays, *tuples, *self._texts])
