"""Stiff and extreme cases: one for each scene of stability.toml and each method."""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...references.reference_trajectory import CommunicationGrid
from ...references.segments import ParameterSpan
from ...scenes.fmu_files import find_fmu
from ...scenes.run_spec import RunSpec
from ...simulation.fmu_info import FmuInfo

FILE = Path(__file__).with_name("stability.toml")
RTOL = 1e-6
POINTS = 200
LOOSE = 3e-2  # allowed error at RTOL for user models, where errors may accumulate from slip to slip
DRIVING = ("F_ext", "T_ext", "v_driver")  # variables that supply energy to the shipped models
RUN_KEYS = ("start", "stop", "rtol", "calls")  # keys other than values that `each` may vary


@dataclass(frozen=True)
class StabilityCase:
    """One scene with one method.

    `max_error` is the allowed error, and `expected_message` is part of the expected error message.
    """

    title: str
    model: str
    method: str
    run: RunSpec
    grid: CommunicationGrid
    spans: list[ParameterSpan]
    calls: list[tuple[float, float]] | None = None
    changes: dict[float, dict[str, float]] = field(default_factory=dict)
    max_error: float | None = None
    expected_message: str | None = None
    inject_nonfinite: bool = False
    events: str = "all"  # which methods must find every event: all, exact or none
    region: float | None = None  # position on the axis of the stability figure
    may_be_refused: bool = False  # any error message is accepted
    is_driven: bool = False  # energy may increase
    order: int = 0  # position in the table

    @property
    def name(self) -> str:
        """Return the name of the model, also if the model is a file."""
        return Path(self.model).stem

    @property
    def label(self) -> str:
        return f"{self.name}: {self.title}, {self.method}"

    @property
    def rtol(self) -> float:
        return self.run.values["solver.rtol"]


def load_scenes(file: Path = FILE) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Load the scenes, expanded to one model and one value each, and the default error bounds."""
    table = tomllib.loads(file.read_text(encoding="utf-8"))
    return [case for scene in table["scene"] for case in expand_scene(scene)], table["finish"]


def generic_scenes(model: str, info: FmuInfo, has_comparable_events: bool) -> list[dict[str, Any]]:
    """Return scenes for a user model.

    They scale its parameters by 0.1 and 10, vary tolerances, use a single communication step, and set values that are
    not finite. If `has_comparable_events` is false, events are not compared.
    """
    common = {"model": model, "either": True, "driven": True, "events": "all" if has_comparable_events else "none"}
    parameters = {
        n: x for n, x in info.start_values.items() if x and n not in info.enumerations and not n.startswith("solver.")
    }
    generated: list[dict[str, Any]] = [{"title": "as it comes"}, {"title": "one communication step", "points": 1}]
    generated += [{"title": f"rtol = {rtol:g}", "rtol": rtol, "finish": {}} for rtol in (1e-3, 1e-9)]
    generated += [
        {"title": f"{name} = {share * value:g}", "values": {name: share * value}}
        for name, value in parameters.items()
        for share in (0.1, 10.0)
    ]
    injections = {
        "title": "NaN, inf, -inf in every Real, before and in mid-run",
        "inject_nonfinite": True,
        "methods": ["default"],
    }
    bounds = {"exact": 1e-6, "other": LOOSE}
    return [{**common, "pattern": scene["title"], "finish": bounds, **scene} for scene in [*generated, injections]]


def expand_scene(scene: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield a scene for each of its models and varied values."""
    for model in scene.get("models", [scene.get("model")]):
        if "each" not in scene:
            yield {**scene, "model": model, "pattern": scene["title"]}
            continue
        ((name, values),) = scene["each"].items()
        for value in values:
            varied_keys = {name: value} if name in RUN_KEYS else {"values": {**scene.get("values", {}), name: value}}
            label = value if name != "calls" else ", then ".join(f"{h!r} s from {t!r} s" for t, h in value)
            labels = {"title": scene["title"].format(label), "pattern": scene["title"], "varied": value}
            yield {**scene, **varied_keys, "model": model, **labels}


def scene_cases(scene: dict[str, Any], info: FmuInfo, finish: dict[str, float]) -> list[StabilityCase]:
    """Return the cases of one scene, for its methods among those of the FMU."""
    methods = scene.get("methods", info.methods)
    methods = [info.default_method if method == "default" else method for method in methods]
    return [
        make_case(scene, info, method, allowed_error(scene, method, finish))
        for method in methods
        if method in info.methods
    ]


def allowed_error(scene: dict[str, Any], method: str, finish: dict[str, float]) -> float:
    """Return the allowed error of a method: that of the scene, or the default for its tolerance."""
    max_error = scene.get("finish", {})
    if not isinstance(max_error, dict):
        return max_error
    if method == "exact":
        return max_error.get("exact", finish["exact"])
    return max_error.get("other", max(finish["tolerances"] * scene.get("rtol", RTOL), finish["least"]))


def make_case(scene: dict[str, Any], info: FmuInfo, method: str, finish: float) -> StabilityCase:
    """Return the case of a scene and a method."""
    settings = {"solver.rtol": scene.get("rtol", RTOL), **scene.get("values", {}), "solver.method": method}
    values = info.resolve_labels({**info.start_values, **settings})
    start, stop = scene.get("start", 0.0), scene.get("stop", info.stop)
    changes = {
        row["t"]: info.resolve_labels({k: v for k, v in row.items() if k != "t"}) for row in scene.get("changes", ())
    }
    points = round((stop - start) / scene["step"]) if "step" in scene else scene.get("points", POINTS)
    ends = not ("refuse" in scene or "inject_nonfinite" in scene)
    return StabilityCase(
        title=scene["title"],
        model=scene["model"],
        method=method,
        run=RunSpec(find_fmu(scene["model"]), values=values, start=start, stop=stop),
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
    """Return the time spans between changes with their values; solver settings are removed for the reference."""
    physical = {name: value for name, value in values.items() if not name.startswith("solver.")}
    result, begin = [], start
    for t in sorted(changes):
        result.append((begin, t, physical))
        physical, begin = {**physical, **changes[t]}, t
    return [*result, (begin, stop, physical)]
