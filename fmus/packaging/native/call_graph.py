"""All the functions that an entry reaches, each specialised to the kinds of its arguments, callees first."""

from dataclasses import dataclass
from itertools import count
from types import FunctionType

from .c_types import CType, ScalarTuple
from .statements import FunctionTranslator
from .struct_layout import StructLayout


@dataclass(frozen=True)
class CFunction:
    """A C function: its name, its result, whether it leaves all objects as they are, whether it may fault."""

    name: str
    result: CType | None
    is_pure: bool
    can_fault: bool


class CallGraph:
    """The numerics of one live model object, and of what else makes a run."""

    def __init__(self, model: object, *others: object) -> None:
        self.layout = StructLayout(model, *others)
        self._functions: dict[tuple[object, ...], CFunction | None] = {}  # None: begun
        self._texts: list[str] = []
        self._groups: dict[str, ScalarTuple] = {}
        self._names: set[str] = set()

    def add_model_entry_point(self, name: str, function: FunctionType, *arg_types: CType) -> CFunction:
        """A function of the model and of more, to be called from outside by `name`."""
        return self.add_entry_point(function, [self.layout.model, *arg_types], name)

    def add_entry_point(self, function: FunctionType, arg_types: list[CType], name: str = "") -> CFunction:
        """A function to be called from outside: each of them has a fault flag, whatever the model."""
        body = FunctionTranslator(self, function, arg_types)
        body.can_fault = True
        done = self._functions[(function, *arg_types)] = self._add(body, name or self._unique_name(function))
        return done

    def specialise(self, function: FunctionType, arg_types: list[CType]) -> CFunction | None:
        """The C function for a function of the numerics and the kinds of its arguments; None while it is begun."""
        key = (function, *arg_types)
        if key not in self._functions:
            self._functions[key] = None
            self._functions[key] = self._add(FunctionTranslator(self, function, arg_types), self._unique_name(function))
        return self._functions[key]

    def _add(self, body: FunctionTranslator, name: str) -> CFunction:
        if isinstance(body.result, ScalarTuple):
            self._groups[body.result.c] = body.result
        self._texts.append(body.text(name))
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
        """Structs, then functions."""
        groups = [
            f"{c} {{ {' '.join(f'{part.c} _{i};' for i, part in enumerate(ctype.parts))} }};\n"
            for c, ctype in self._groups.items()
        ]
        return "\n".join([self.layout.struct_definitions(), *groups, *self._texts])
