"""A coupled scene: parts, and the springs and connections between them.  Read from a TOML file:

    title = "..."                      one line for people
    stop = 4.0                         s
    steps = [0.02, 0.01, 0.005]        communication steps in s, the finest one is drawn
    [parts.left]                       one table for each part
    model = "smd"                      one whose closed form is known: smd, coulomb or stickslip
    values = {m = 2.0, x0 = 0.1}       its parameters, SI units
    [[springs]]                        a spring and damper between two parts, without force at equal positions
    between = ["left", "right"]
    k = 40.0                           N/m
    c = 0.1                            N s/m, 0 without
    [[connections]]                    an output that drives the F_ext of another part, times a factor
    from = "left.x"                    x or v; or F_spring with the factor 1
    to = "right"
    factor = 40.0

Every spring, and every factor, is an FMU of its own (fmus/more/spring.py), for few tools heed factors in an archive:
into it come the speeds of its two ends, out of it the forces on them.  A connection is a spring with one end held.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

from ...errors import SceneError, format_value, unknown_name_message
from ..fmu_files import find_fmu
from ..schema import NUMBER, POSITIVE, TEXT, TITLE, Constraint, is_names, is_number, parse_table, read_toml

FOLDER = Path(__file__).parent
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
MAX_STEPS = 1_000_000
SOURCES = ("x", "v", "F_spring")  # outputs that a connection may come from


NOT_NEGATIVE = Constraint(lambda value: is_number(value) and value >= 0, "a finite number, at least 0")
PAIR = Constraint(lambda value: is_names(value) and len(value) == 2, "a list of two different names")
STEPS = Constraint(
    lambda value: isinstance(value, list) and bool(value) and all(map(POSITIVE.accepts, value)),
    "a list of finite numbers above 0",
)


@dataclass(frozen=True)
class PartKeys:
    """A table in [parts]."""

    model: Annotated[str, TEXT]
    values: dict[str, Annotated[float, NUMBER]] = field(default_factory=dict)


@dataclass(frozen=True)
class SpringKeys:
    """A table in [[springs]]."""

    between: Annotated[tuple[str, str], PAIR]
    k: Annotated[float, POSITIVE]
    c: Annotated[float, NOT_NEGATIVE] = 0.0


@dataclass(frozen=True)
class ConnectionKeys:
    """A table in [[connections]]."""

    from_: Annotated[str, TEXT]
    to: Annotated[str, TEXT]
    factor: Annotated[float, NUMBER]


@dataclass(frozen=True)
class CoupledKeys:
    """The keys of the file."""

    title: Annotated[str, TITLE]
    stop: Annotated[float, POSITIVE]
    steps: Annotated[tuple[float, ...], STEPS]
    parts: dict[str, PartKeys]
    springs: tuple[SpringKeys, ...] = ()
    connections: tuple[ConnectionKeys, ...] = ()


@dataclass(frozen=True)
class Part:
    """One FMU of the scene, and the values that differ from its own."""

    name: str
    model: str
    fmu: Path
    values: dict[str, float]


@dataclass(frozen=True)
class CoupledSpring:
    """A spring (`k` in N/m) and damper (`c` in N s/m) from the part `a` to the part `b`; `acts` says on which of them,
    and with which sign.  Without a part at an end that is held at zero."""

    a: str
    b: str
    k: float
    c: float
    force_ends: tuple[tuple[str, str], ...]  # a flange, and the part on which its force acts

    @property
    def name(self) -> str:
        return "_".join(
            ["spring", *filter(None, (self.a, self.b)), *(part for _, part in self.force_ends if not self.b)]
        )


@dataclass(frozen=True)
class Connection:
    """The `output` of the part `source` is the `entry` of the part `sink`."""

    source: str
    output: str
    sink: str
    input: str


@dataclass(frozen=True)
class CoupledScene:
    """The scene."""

    name: str
    title: str
    stop: float
    steps: tuple[float, ...]
    parts: tuple[Part, ...]
    springs: tuple[CoupledSpring, ...]
    direct_connections: tuple[Connection, ...]  # from part to part, as they are

    @property
    def identifier(self) -> str:
        """Its name as an identifier."""
        return re.sub(r"\W", "_", self.name, flags=re.ASCII)

    @property
    def connections(self) -> tuple[Connection, ...]:
        """All of them, those with the springs included."""
        found = list(self.direct_connections)
        for each in self.springs:
            for end, part in (("a", each.a), ("b", each.b)):
                found += [Connection(part, "v", each.name, f"v_{end}")] if part else []
            found += [Connection(each.name, f"F_{end}", part, "F_ext") for end, part in each.force_ends]
        return tuple(found)


def shipped_coupled_scenes() -> list[Path]:
    """The coupled scenes that come with the harness."""
    return sorted(FOLDER.glob("*.toml"))


def load_coupled_scene(source: str, models: Collection[str], stop: float | None = None) -> CoupledScene:
    """The scene of a shipped name or a file, of such models, to another stop if one is named; SceneError in one
    sentence if it is not one."""
    path = Path(source)
    if path.suffix != ".toml":
        names = {file.stem: file for file in shipped_coupled_scenes()}
        if source not in names:
            raise SceneError(
                f"{unknown_name_message('coupled scene', source, names)}, or the path of a .toml or .ssp file"
            )
        path = names[source]
    table = read_toml(path)
    try:
        return build_coupled_scene(path, parse_table(table | ({"stop": stop} if stop else {}), CoupledKeys), models)
    except SceneError as error:
        raise SceneError(f"scene {path.stem}: {error}") from None


def build_coupled_scene(path: Path, keys: CoupledKeys, models: Collection[str]) -> CoupledScene:
    """The scene that the keys of its file say."""
    if not keys.parts:
        raise SceneError("parts is empty; name each part in a table of its own, as in [parts.left]")
    for name, part in keys.parts.items():
        if not NAME.fullmatch(name):
            raise SceneError(f"part {format_value(name)}: a name has letters, digits and _, and begins with a letter")
        if part.model not in models:
            raise SceneError(f"part {name}: {unknown_name_message('model', part.model, models)}")
    springs, passed = [], []
    for spring in keys.springs:
        one, two = (check_part(name, keys.parts) for name in spring.between)
        springs.append(CoupledSpring(one, two, float(spring.k), float(spring.c), (("a", one), ("b", two))))
    for each in keys.connections:
        source, _, output = each.from_.partition(".")
        if output not in SOURCES:
            raise SceneError(f"from = {format_value(each.from_)}: {unknown_name_message('output', output, SOURCES)}")
        source, sink, factor = check_part(source, keys.parts), check_part(each.to, keys.parts), float(each.factor)
        if output != "F_spring":
            size, end = abs(factor), "b" if factor > 0 else "a"
            k, c = (size, 0.0) if output == "x" else (0.0, size)
            springs.append(CoupledSpring(source, "", k, c, ((end, sink),)))
        elif factor == 1.0:
            passed.append(Connection(source, output, sink, "F_ext"))
        else:
            raise SceneError(f"from = {format_value(each.from_)}: a force is passed on with factor = 1, not {factor!r}")
    scene = CoupledScene(
        path.stem, keys.title, float(keys.stop), check_communication_steps(keys), (), tuple(springs), tuple(passed)
    )
    driven = [each.sink for each in scene.connections]
    twice = [name for name in keys.parts if driven.count(name) > 1]
    if twice:
        raise SceneError(f"part {twice[0]} is driven twice; an input takes one connection")
    values = {name: {key: float(value) for key, value in part.values.items()} for name, part in keys.parts.items()}
    parts = tuple(Part(name, part.model, find_fmu(part.model), values[name]) for name, part in keys.parts.items())
    return replace(scene, parts=parts)


def check_communication_steps(keys: CoupledKeys) -> tuple[float, ...]:
    """The communication steps in s, the longest first."""
    steps = tuple(sorted(map(float, keys.steps), reverse=True))
    for step in steps:
        if not 1 <= keys.stop / step <= MAX_STEPS:
            raise SceneError(
                f"steps: {step!r} s makes {keys.stop / step:.6g} steps to the stop; from 1 to {MAX_STEPS} are allowed"
            )
    return steps


def check_part(name: str, parts: Collection[str]) -> str:
    """The name of a part that there is."""
    if name not in parts:
        raise SceneError(unknown_name_message("part", name, parts))
    return name
