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
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import SceneError, shown, unknown
from ..scene import fmu_of, is_number, is_positive, is_text, is_title, read

FOLDER = Path(__file__).parent
MODELS = ("smd", "coulomb", "stickslip")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
MOST_STEPS = 1_000_000
SOURCES = ("x", "v", "F_spring")  # outputs that a connection may come from


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
        return build(path, table, stiffness)
    except SceneError as error:
        raise SceneError(f"scene {path.stem}: {error}") from None


def build(path: Path, table: dict[str, Any], stiffness: dict[str, float]) -> Coupled:
    """The scene in a table."""
    check(
        table, {"title": is_title, "stop": is_positive, "steps": is_steps, "parts": is_table}, "springs", "connections"
    )
    for key in ("springs", "connections"):
        if not is_tables(table.get(key, [])):
            raise SceneError(f"{key} = {shown(table[key])} cannot be used; write each of them as [[{key}]]")
    parts: dict[str, dict[str, Any]] = {}
    for name, part in table["parts"].items():
        if not NAME.fullmatch(name):
            raise SceneError(f"part {shown(name)}: a name has letters, digits and _, and begins with a letter")
        check(part, {"model": is_text}, "values")
        if part["model"] not in MODELS:
            raise SceneError(f"part {name}: {unknown('model', part['model'], MODELS)}")
        values = part.get("values", {})
        if not isinstance(values, dict):
            raise SceneError(f"part {name}: values = {shown(values)} is not a table, as in {{m = 2.0}}")
        for key, value in values.items():
            if not is_number(value):
                raise SceneError(f"part {name}: {key} = {shown(value)} is not a finite number")
        parts[name] = {"model": part["model"], "values": {key: float(value) for key, value in values.items()}}
    connections = []
    for spring in table.get("springs", []):
        check(spring, {"between": is_pair, "k": is_positive})
        one, two = (known(name, parts) for name in spring["between"])
        connections += [Connection(one, "x", two, float(spring["k"])), Connection(two, "x", one, float(spring["k"]))]
        for name in (one, two):
            if parts[name]["model"] == "stickslip":
                raise SceneError(
                    f"part {name}: more stiffness of a stickslip sled would pull at its driver; take coulomb"
                )
            values = parts[name]["values"]
            values["k"] = values.get("k", stiffness[parts[name]["model"]]) + float(spring["k"])
    for each in table.get("connections", []):
        check(each, {"from": is_text, "to": is_text, "factor": is_number})
        source, _, output = each["from"].partition(".")
        if output not in SOURCES:
            raise SceneError(f"from = {shown(each['from'])}: {unknown('output', output, SOURCES)}")
        connections.append(Connection(known(source, parts), output, known(each["to"], parts), float(each["factor"])))
    driven = [each.sink for each in connections]
    twice = [name for name in parts if driven.count(name) > 1]
    if twice:
        raise SceneError(f"part {twice[0]} is driven twice; an input takes one connection")
    steps = tuple(sorted((float(h) for h in table["steps"]), reverse=True))
    for step in steps:
        if not 1 <= float(table["stop"]) / step <= MOST_STEPS:
            count = f"{float(table['stop']) / step:.6g}"
            raise SceneError(
                f"steps: {step!r} s makes {count} steps up to the stop; from 1 to {MOST_STEPS} are allowed"
            )
    whole = tuple(Part(name, part["model"], fmu_of(part["model"]), part["values"]) for name, part in parts.items())
    return Coupled(path.stem, table["title"], float(table["stop"]), steps, whole, tuple(connections))


def check(table: dict[str, Any], needed: dict[str, Any], *more: str) -> None:
    """The keys needed are there and of their kind, and there are no others."""
    for key in table:
        if key not in needed and key not in more:
            raise SceneError(unknown("key", key, (*needed, *more)))
    for key, accepts in needed.items():
        if key not in table:
            raise SceneError(f"the key '{key}' is missing")
        if not accepts(table[key]):
            raise SceneError(f"{key} = {shown(table[key])} cannot be used; see the examples in harness/scenes/coupled")


def is_table(value: object) -> bool:
    return isinstance(value, dict) and len(value) > 0 and all(isinstance(part, dict) for part in value.values())


def is_tables(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(each, dict) for each in value)


def is_steps(value: object) -> bool:
    return isinstance(value, list) and len(value) > 0 and all(map(is_positive, value))


def is_pair(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(is_text, value)) and value[0] != value[1]


def known(name: str, parts: dict[str, Any]) -> str:
    """The name of a part that there is."""
    if name not in parts:
        raise SceneError(unknown("part", name, parts))
    return name
