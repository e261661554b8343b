"""The stiff and extreme scenes of stability.toml, one case for each method that meets them."""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...references.reference_trajectory import CommunicationGrid
from ...references.segments import ParameterSpan
from ...running.fmu_session import FmuInfo, InitialValues

FILE = Path(__file__).with_name("stability.toml")
RTOL = 1e-6
POINTS = 200
LOOSE = 3e-2  # error at RTOL of any model, which may carry it on from one slip to the next
DRIVING = ("F_ext", "T_ext", "v_driver")  # what puts energy into one of ours
OWN = ("start", "stop", "rtol", "calls")  # what `each` may vary besides a value


@dataclass(frozen=True)
class StabilityCase:
    """One scene with one method: `finish` is the largest error allowed, `refuse` the words to be refused with."""

    title: str
    model: str
    method: str
    setting: InitialValues
    grid: CommunicationGrid
    spans: list[ParameterSpan]
    calls: list[tuple[float, float]] | None = None
    changes: dict[float, dict[str, float]] = field(default_factory=dict)
    max_error: float | None = None
    expected_message: str | None = None
    inject_nonfinite: bool = False
    events: str = "all"  # which methods must find every event: all, exact or none
    region: float | None = None  # where the scene stands on the axis of the region figure
    may_be_refused: bool = False  # a sentence will do, whatever it says
    is_driven: bool = False  # energy may come in
    order: int = 0  # in the table

    @property
    def name(self) -> str:
        """That of the model, which may be a file."""
        return Path(self.model).stem

    @property
    def label(self) -> str:
        return f"{self.name}: {self.title}, {self.method}"

    @property
    def rtol(self) -> float:
        return self.setting.values["solver.rtol"]


def load_scenes(file: Path = FILE) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Every scene with one model and one value, and the largest errors allowed where a scene says nothing."""
    table = tomllib.loads(file.read_text(encoding="utf-8"))
    return [one for scene in table["scene"] for one in expand_scene(scene)], table["finish"]


def usual(model: str, card: FmuInfo, settled: bool) -> list[dict[str, Any]]:
    """Scenes for a model of somebody's: every number a tenth of what it is, and ten times; tolerances; few steps; what
    is no number.  `settled`: whether its events can be told."""
    of_all = {"model": model, "either": True, "driven": True, "events": "all" if settled else "none"}
    numbers = {
        n: x for n, x in card.start_values.items() if x and n not in card.enumerations and not n.startswith("solver.")
    }
    found: list[dict[str, Any]] = [{"title": "as it comes"}, {"title": "one communication step", "points": 1}]
    found += [{"title": f"rtol = {rtol:g}", "rtol": rtol, "finish": {}} for rtol in (1e-3, 1e-9)]
    found += [
        {"title": f"{name} = {share * value:g}", "values": {name: share * value}}
        for name, value in numbers.items()
        for share in (0.1, 10.0)
    ]
    poison = {
        "title": "NaN, inf, -inf in every Real, before and in mid-run",
        "inject_nonfinite": True,
        "methods": ["default"],
    }
    within = {"exact": 1e-6, "other": LOOSE}
    return [{**of_all, "pattern": one["title"], "finish": within, **one} for one in [*found, poison]]


def expand_scene(scene: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """A scene for each of its models and for each value that it varies."""
    for model in scene.get("models", [scene.get("model")]):
        if "each" not in scene:
            yield {**scene, "model": model, "pattern": scene["title"]}
            continue
        ((name, values),) = scene["each"].items()
        for value in values:
            new = {name: value} if name in OWN else {"values": {**scene.get("values", {}), name: value}}
            shown = value if name != "calls" else ", then ".join(f"{h!r} s from {t!r} s" for t, h in value)
            told = {"title": scene["title"].format(shown), "pattern": scene["title"], "varied": value}
            yield {**scene, **new, "model": model, **told}


def cases(scene: dict[str, Any], card: FmuInfo, finish: dict[str, float]) -> list[StabilityCase]:
    """The cases of one scene: the methods that it names, of those that its FMU offers."""
    methods = scene.get("methods", card.methods)
    methods = [card.default_method if method == "default" else method for method in methods]
    return [
        case(scene, card, method, largest_error(scene, method, finish)) for method in methods if method in card.methods
    ]


def largest_error(scene: dict[str, Any], method: str, finish: dict[str, float]) -> float:
    """What a scene allows a method: its own figure, else that of its tolerance."""
    own = scene.get("finish", {})
    if not isinstance(own, dict):
        return own
    if method == "exact":
        return own.get("exact", finish["exact"])
    return own.get("other", max(finish["tolerances"] * scene.get("rtol", RTOL), finish["least"]))


def case(scene: dict[str, Any], card: FmuInfo, method: str, finish: float) -> StabilityCase:
    """A scene with a method."""
    chosen = {"solver.rtol": scene.get("rtol", RTOL), **scene.get("values", {}), "solver.method": method}
    values = card.resolve_labels({**card.start_values, **chosen})
    start, stop = scene.get("start", 0.0), scene.get("stop", card.stop)
    changes = {
        row["t"]: card.resolve_labels({k: v for k, v in row.items() if k != "t"}) for row in scene.get("changes", ())
    }
    points = round((stop - start) / scene["step"]) if "step" in scene else scene.get("points", POINTS)
    ends = not ("refuse" in scene or "inject_nonfinite" in scene)
    return StabilityCase(
        title=scene["title"],
        model=scene["model"],
        method=method,
        setting=InitialValues(scene["model"], values, start, stop),
        grid=CommunicationGrid(start, stop, points, tuple(changes), scene.get("at_events", False)),
        spans=value_spans(start, stop, values, changes),
        calls=[(t, h) for t, h in scene["calls"]] if "calls" in scene else None,
        changes=changes,
        max_error=finish if ends else None,
        expected_message=scene.get("refuse"),
        inject_nonfinite=scene.get("inject_nonfinite", False),
        events=scene.get("events", "all"),
        region=scene["varied"] if scene.get("region") else None,
        may_be_refused=scene.get("either", False),
        is_driven=scene.get("driven", False) or bool(changes) or any(values.get(name) for name in DRIVING),
    )


def value_spans(
    start: float, stop: float, values: dict[str, float], changes: dict[float, dict[str, float]]
) -> list[ParameterSpan]:
    """From one change to the next, and the values that hold there; those of the solver are none of the truth's."""
    physical = {name: value for name, value in values.items() if not name.startswith("solver.")}
    found, begin = [], start
    for t in sorted(changes):
        found.append((begin, t, physical))
        physical, begin = {**physical, **changes[t]}, t
    return [*found, (begin, stop, physical)]
