"""All the functions that an entry reaches, each specialised to the kinds of its arguments, callees first."""

from dataclasses import dataclass
from itertools import count
from types import FunctionType

from .kinds import Group, Kind
from .layout import Layout
from .statements import Body


@dataclass(frozen=True)
class Compiled:
    """A C function: its name, its result, whether it leaves all objects as they are, whether it may fault."""

    name: str
    result: Kind | None
    pure: bool
    faults: bool


class Program:
    """The numerics of one live model object, and of what else makes a run."""

    def __init__(self, model: object, *others: object) -> None:
        self.layout = Layout(model, *others)
        self._done: dict[tuple[object, ...], Compiled | None] = {}  # None: begun
        self._texts: list[str] = []
        self._groups: dict[str, Group] = {}
        self._names: set[str] = set()

    def entry(self, name: str, function: FunctionType, *kinds: Kind) -> Compiled:
        """A function of the model and of more, to be called from outside by `name`."""
        return self.exported(function, [self.layout.model, *kinds], name)

    def exported(self, function: FunctionType, kinds: list[Kind], name: str = "") -> Compiled:
        """A function to be called from outside: each of them has a fault flag, whatever the model."""
        body = Body(self, function, kinds)
        body.faults = True
        done = self._done[(function, *kinds)] = self._keep(body, name or self._name(function))
        return done

    def specialised(self, function: FunctionType, kinds: list[Kind]) -> Compiled | None:
        """The C function for a function of the numerics and the kinds of its arguments; None while it is begun."""
        key = (function, *kinds)
        if key not in self._done:
            self._done[key] = None
            self._done[key] = self._keep(Body(self, function, kinds), self._name(function))
        return self._done[key]

    def _keep(self, body: Body, name: str) -> Compiled:
        if isinstance(body.result, Group):
            self._groups[body.result.c] = body.result
        self._texts.append(body.text(name))
        return Compiled(name, body.result, body.pure, body.faults)

    def _name(self, function: FunctionType) -> str:
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
            f"{c} {{ {' '.join(f'{part.c} _{i};' for i, part in enumerate(kind.parts))} }};\n"
            for c, kind in self._groups.items()
        ]
        return "\n".join([self.layout.definitions(), *groups, *self._texts])
