"""Coupled scenes: parts, and the springs and connections between them. Format of the TOML file:

    title = "..."                      one line
    stop = 4.0                         s
    steps = [0.02, 0.01, 0.005]        communication steps in s; the shortest is plotted
    [parts.left]                       one table per part
    model = "smd"                      a model, with a reference solution for smd, coulomb, stickslip; or an FMU file
    values = {m = 2.0, x0 = 0.1}       parameters in SI units
    [[springs]]                        spring and damper between two parts, without force at equal positions
    between = ["left", "right"]
    k = 40.0                           N/m
    c = 0.1                            N s/m, default 0
    [[connections]]                    an output that drives F_ext of another part, times a factor
    from = "left.x"                    x, v, or F_spring with factor 1
    to = "right"
    factor = 40.0
    [[connections]]                    an output that drives an input of another part
    from = "belt.v"
    to = "block.v_belt"

Every spring and every factor becomes a separate FMU (fmus/more/spring.py), because few tools support factors in
archives. Its inputs are the velocities of its ends, its outputs are the forces on them. A factor is a spring with one
fixed end.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from ...arguments import NONNEGATIVE, POSITIVE, TEXT, Rule, above_zero, items, some_names
from ...errors import SceneError, format_value, unknown_name_message, unknown_source_message
from ..fmu_files import find_fmu
from ..run_spec import RunSpec
from ..schema import TITLE, parse_table, read_toml

FOLDER = Path(__file__).parent
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
MAX_STEPS = 1_000_000
MODEL_FILES = (".fmu", ".py")
SOURCES = ("x", "v", "F_spring")  # outputs that can be connected


def pair(value: Any) -> tuple[str, str]:
    """Return two distinct names."""
    first, second = some_names(value)
    return first, second


def steps(value: Any) -> tuple[float, ...]:
    """Return at least one number above 0."""
    if not (numbers := tuple(map(above_zero, items(value)))):
        raise ValueError
    return numbers


PAIR = Rule("a list of two distinct names", pair)
STEPS = Rule("a list of finite numbers above 0", steps)


@dataclass(frozen=True)
class PartKeys:
    """A table in [parts]."""

    model: Annotated[str, TEXT]
    values: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SpringKeys:
    """A table in [[springs]]."""

    between: Annotated[tuple[str, str], PAIR]
    k: Annotated[float, POSITIVE]
    c: Annotated[float, NONNEGATIVE] = 0.0


@dataclass(frozen=True)
class ConnectionKeys:
    """A table in [[connections]]."""

    from_: Annotated[str, TEXT]
    to: Annotated[str, TEXT]
    factor: float = 1.0


@dataclass(frozen=True)
class CoupledKeys:
    """Keys of a coupled scene file."""

    title: Annotated[str, TITLE]
    stop: Annotated[float, POSITIVE]
    steps: Annotated[tuple[float, ...], STEPS]
    parts: dict[str, PartKeys]
    springs: tuple[SpringKeys, ...] = ()
    connections: tuple[ConnectionKeys, ...] = ()


@dataclass(frozen=True)
class CoupledSpring:
    """Spring (`k` in N/m) and damper (`c` in N s/m) from part `a` to part `b`; an end without a part is fixed.

    `force_ends` lists the ends that exert a force, and the parts on which they act.
    """

    a: str
    b: str
    k: float
    c: float
    force_ends: tuple[tuple[str, str], ...]  # (end, part on which its force acts)

    @property
    def name(self) -> str:
        return "_".join(
            ["spring", *filter(None, (self.a, self.b)), *(part for _, part in self.force_ends if not self.b)]
        )


@dataclass(frozen=True)
class Connection:
    """Connection from the `output` of the part `source` to the `input` of the part `sink`."""

    source: str
    output: str
    sink: str
    input: str


@dataclass(frozen=True)
class CoupledScene:
    """Validated coupled scene."""

    name: str
    title: str
    stop: float
    steps: tuple[float, ...]
    parts: dict[str, RunSpec]  # the run of each part by its name; all stop with the scene
    springs: tuple[CoupledSpring, ...]
    direct_connections: tuple[Connection, ...]  # from part to part without a factor

    @property
    def identifier(self) -> str:
        """Return the name of the scene as an identifier."""
        return re.sub(r"\W", "_", self.name, flags=re.ASCII)

    @property
    def connections(self) -> tuple[Connection, ...]:
        """Return all connections, including those of the springs."""
        connections = list(self.direct_connections)
        for spring in self.springs:
            for end, part in (("a", spring.a), ("b", spring.b)):
                connections += [Connection(part, "v", spring.name, f"v_{end}")] if part else []
            connections += [Connection(spring.name, f"F_{end}", part, "F_ext") for end, part in spring.force_ends]
        return tuple(connections)


def shipped_coupled_scenes() -> list[Path]:
    """Return the files of the built-in coupled scenes."""
    return sorted(FOLDER.glob("*.toml"))


def load_coupled_scene(source: str, models: Collection[str], stop: float | None = None) -> CoupledScene:
    """Load a coupled scene.

    Parameters
    ----------
    source : str
        Built-in name, or path of a .toml file.
    models : collection of str
        Models that are allowed.
    stop : float, optional
        Stop time in s that replaces that of the file.

    Raises
    ------
    SceneError
        If the scene is invalid.
    """
    path = Path(source)
    if path.suffix != ".toml":
        names = {file.stem: file for file in shipped_coupled_scenes()}
        if source not in names:
            other = ", or the path of a .toml or .ssp file"
            raise SceneError(unknown_source_message("coupled scene", source, names, other))
        path = names[source]
    table = read_toml(path)
    try:
        return build_coupled_scene(path, parse_table(table | ({"stop": stop} if stop else {}), CoupledKeys), models)
    except SceneError as error:
        raise SceneError(f"scene {path.stem}: {error}") from None


def build_coupled_scene(path: Path, keys: CoupledKeys, models: Collection[str]) -> CoupledScene:
    """Build a coupled scene from the keys of its file."""
    if not keys.parts:
        raise SceneError("parts is empty; add a table for each part, as in [parts.left]")
    for name, part in keys.parts.items():
        if not NAME.fullmatch(name):
            raise SceneError(
                f"part {format_value(name)}: a name consists of letters, digits and _, and begins with a letter"
            )
        if part.model not in models and Path(part.model).suffix not in MODEL_FILES:
            raise SceneError(f"part {name}: {unknown_name_message('model', part.model, models)}")
    springs, direct = [], []
    for spring in keys.springs:
        first, second = (check_part(name, keys.parts) for name in spring.between)
        springs.append(CoupledSpring(first, second, float(spring.k), float(spring.c), (("a", first), ("b", second))))
    for connection in keys.connections:
        source, _, output = connection.from_.partition(".")
        sink, _, sink_input = connection.to.partition(".")
        source, sink = check_part(source, keys.parts), check_part(sink, keys.parts)
        factor = float(connection.factor)
        if sink_input:
            if factor != 1.0:
                raise SceneError(
                    f"to = {format_value(connection.to)}: a connection to an input needs factor = 1, got {factor!r}"
                )
            direct.append(Connection(source, output, sink, sink_input))
            continue
        if output not in SOURCES:
            raise SceneError(
                f"from = {format_value(connection.from_)}: {unknown_name_message('output', output, SOURCES)}"
            )
        if output != "F_spring":
            size, end = abs(factor), "b" if factor > 0 else "a"
            k, c = (size, 0.0) if output == "x" else (0.0, size)
            springs.append(CoupledSpring(source, "", k, c, ((end, sink),)))
        elif factor == 1.0:
            direct.append(Connection(source, output, sink, "F_ext"))
        else:
            raise SceneError(
                f"from = {format_value(connection.from_)}: a connected force needs factor = 1, got {factor!r}"
            )
    scene = CoupledScene(
        path.stem, keys.title, float(keys.stop), check_communication_steps(keys), {}, tuple(springs), tuple(direct)
    )
    ends = [(connection.sink, connection.input) for connection in scene.connections]
    repeated = [name for name, variable in ends if name in keys.parts and ends.count((name, variable)) > 1]
    if repeated:
        raise SceneError(f"part {repeated[0]} is driven twice; an input accepts one connection")
    parts = {
        name: RunSpec(
            find_fmu(part.model), values={key: float(value) for key, value in part.values.items()}, stop=scene.stop
        )
        for name, part in keys.parts.items()
    }
    fmus = {part.fmu for part in parts.values()}
    namesakes = [fmu for fmu in sorted(fmus) if [other.name for other in fmus].count(fmu.name) > 1]
    if namesakes:
        raise SceneError(f"{namesakes[0]} and {namesakes[1]} have the same file name: rename one of them")
    return replace(scene, parts=parts)


def check_communication_steps(keys: CoupledKeys) -> tuple[float, ...]:
    """Return the communication steps in s, the longest first; raise SceneError for invalid numbers of steps."""
    steps = tuple(sorted(map(float, keys.steps), reverse=True))
    for step in steps:
        if not 1 <= keys.stop / step <= MAX_STEPS:
            raise SceneError(
                f"steps: {step!r} s gives {keys.stop / step:.6g} steps to the stop; 1 to {MAX_STEPS} are allowed"
            )
    return steps


def check_part(name: str, parts: Collection[str]) -> str:
    """Return the name of a part; raise SceneError if there is none of that name."""
    if name not in parts:
        raise SceneError(unknown_name_message("part", name, parts))
    return name
