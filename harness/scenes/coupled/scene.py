"""A coupled scene: parts, and the springs and connections between them.  Read from a TOML file:

    title = "..."                      one line for people
    stop = 4.0                         s
    steps = [0.02, 0.01, 0.005]        communication steps in s, the finest one is drawn
    [parts.left]                       one table for each part
    model = "smd"                      smd, coulomb or stickslip
    values = {m = 2.0, x0 = 0.1}       its parameters, SI units
    [[springs]]                        a linear spring between two parts, without force at equal positions
    between = ["left", "right"]
    k = 40.0                           N/m
    [[connections]]                    an output that drives the F_ext of another part, times a factor
    from = "left.x"
    to = "right"
    factor = 40.0

The force k (x_other - x) of a spring is one connection each way with the factor k, and k more stiffness in each part.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from ...errors import SceneError, shown, unknown
from ..fmus import fmu_of
from ..schema import NUMBER, POSITIVE, TEXT, TITLE, Kind, is_names, read, structured

FOLDER = Path(__file__).parent
MODELS = ("smd", "coulomb", "stickslip")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
MOST_STEPS = 1_000_000
SOURCES = ("x", "v", "F_spring")  # outputs that a connection may come from


PAIR = Kind(lambda value: is_names(value) and len(value) == 2, "a list of two different names")
STEPS = Kind(
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
    """One FMU of the scene, and the values that differ from its own, `k` with the springs already in it."""

    name: str
    model: str
    fmu: Path
    values: dict[str, float]


@dataclass(frozen=True)
class Connection:
    """`factor` times the `output` of the part `source` is a share of the outer force on the part `sink`."""

    source: str
    output: str
    sink: str
    factor: float


@dataclass(frozen=True)
class Coupled:
    """The scene."""

    name: str
    title: str
    stop: float
    steps: tuple[float, ...]
    parts: tuple[Part, ...]
    connections: tuple[Connection, ...]


def shipped() -> list[Path]:
    """The coupled scenes that come with the harness."""
    return sorted(FOLDER.glob("*.toml"))


def load(source: str, stiffness: dict[str, float]) -> Coupled:
    """The scene of a shipped name or a file; `stiffness` of each model where a scene does not set it.

    SceneError in one sentence if it is not one.
    """
    path = Path(source)
    if path.suffix != ".toml":
        names = {file.stem: file for file in shipped()}
        if source not in names:
            raise SceneError(f"{unknown('coupled scene', source, names)}, or the path of a .toml file")
        path = names[source]
    table = read(path)
    try:
        return build(path, structured(table, CoupledKeys), stiffness)
    except SceneError as error:
        raise SceneError(f"scene {path.stem}: {error}") from None


def build(path: Path, keys: CoupledKeys, stiffness: dict[str, float]) -> Coupled:
    """The scene that the keys of its file say."""
    if not keys.parts:
        raise SceneError("parts is empty; name each part in a table of its own, as in [parts.left]")
    for name, part in keys.parts.items():
        if not NAME.fullmatch(name):
            raise SceneError(f"part {shown(name)}: a name has letters, digits and _, and begins with a letter")
        if part.model not in MODELS:
            raise SceneError(f"part {name}: {unknown('model', part.model, MODELS)}")
    values = {name: {key: float(value) for key, value in part.values.items()} for name, part in keys.parts.items()}
    connections = []
    for spring in keys.springs:
        one, two = (known(name, keys.parts) for name in spring.between)
        connections += [Connection(one, "x", two, float(spring.k)), Connection(two, "x", one, float(spring.k))]
        for name in (one, two):
            model = keys.parts[name].model
            if model == "stickslip":
                raise SceneError(
                    f"part {name}: more stiffness of a stickslip sled would pull at its driver; take coulomb"
                )
            values[name]["k"] = values[name].get("k", stiffness[model]) + float(spring.k)
    for each in keys.connections:
        source, _, output = each.from_.partition(".")
        if output not in SOURCES:
            raise SceneError(f"from = {shown(each.from_)}: {unknown('output', output, SOURCES)}")
        connections.append(
            Connection(known(source, keys.parts), output, known(each.to, keys.parts), float(each.factor))
        )
    driven = [each.sink for each in connections]
    twice = [name for name in keys.parts if driven.count(name) > 1]
    if twice:
        raise SceneError(f"part {twice[0]} is driven twice; an input takes one connection")
    steps = tuple(sorted(map(float, keys.steps), reverse=True))
    for step in steps:
        if not 1 <= keys.stop / step <= MOST_STEPS:
            raise SceneError(
                f"steps: {step!r} s makes {keys.stop / step:.6g} steps to the stop; from 1 to {MOST_STEPS} are allowed"
            )
    parts = tuple(Part(name, part.model, fmu_of(part.model), values[name]) for name, part in keys.parts.items())
    return Coupled(path.stem, keys.title, float(keys.stop), steps, parts, tuple(connections))


def known(name: str, parts: Collection[str]) -> str:
    """The name of a part that there is."""
    if name not in parts:
        raise SceneError(unknown("part", name, parts))
    return name
