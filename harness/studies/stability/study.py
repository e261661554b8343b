"""Study of stiff and extreme cases: each must finish within its error bound or be rejected with a message, never hang.

Scenes and expected outcomes are in stability.toml, references are independent of the FMUs, and every run has a time
limit in a separate process.
"""

import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from ...errors import HarnessError
from ...process.interruptible_wait import map_in_threads
from ...process.worker import Worker, call_once
from ...references.certification import find_modes, solve_reference
from ...references.reference_trajectory import CommunicationGrid, max_or_nan, motion_error
from ...references.segments import ParameterSpan
from ...scenes.fmu_files import check_built, find_fmu
from ...scenes.run_spec import RunSpec
from ...simulation.fmu_info import FmuInfo, read_info
from ...simulation.solution import Solution
from ...simulation.step_sequence import CommunicationSteps, RefusalSummary, RefusedRun, inject_nonfinite, run_steps
from ...simulation.trajectory import Trajectory
from .result import FINISHED, REFUSED, WRONG, CaseOutcome, StabilityCase, StabilityRegion, StabilityResult

WORKERS = 2
LIMIT = 120.0  # s; time limit of a run and of a reference
FILE = Path(__file__).with_name("stability.toml")
RTOL = 1e-6
POINTS = 200
LOOSE = 3e-2  # allowed error at RTOL for user models, where errors may accumulate from slip to slip
DRIVING = ("F_ext", "T_ext", "v_driver")  # variables that supply energy to the shipped models
RUN_KEYS = ("start", "stop", "rtol", "calls")  # keys other than values that `each` may vary
REFUSED_STEP = "a communication step of"  # a refused step changes nothing


def measure_stability(
    groups: Sequence[Sequence[StabilityCase]], report: Callable[[str, float], None]
) -> StabilityResult:
    """Run groups of cases; `report` receives the label of each finished case."""
    outcomes = run_cases(report, groups)
    return StabilityResult(tuple(map(without_arrays, outcomes)), tuple(stability_regions(outcomes)))


def without_arrays(outcome: CaseOutcome) -> CaseOutcome:
    """Return an outcome without the signals of its run, which are judged already."""
    if outcome.motion is None:
        return outcome
    return replace(outcome, motion=replace(outcome.motion, time=np.zeros(0), columns={}))


def run_cases(report: Callable[[str, float], None], groups: Sequence[Sequence[StabilityCase]]) -> list[CaseOutcome]:
    """Run groups of cases in parallel; `report` receives the label of each finished case."""
    idle: SimpleQueue[Worker] = SimpleQueue()  # starting a process takes longer than most runs

    def rows(group: Sequence[StabilityCase]) -> list[CaseOutcome]:
        outcomes, worker = [], idle.get()
        try:
            for row in run_group(group, worker):
                outcomes.append(row)
                report(row.case.label, 1.0)
        finally:
            idle.put(worker)
        return outcomes

    with ExitStack() as workers:
        for _ in range(WORKERS):
            idle.put(workers.enter_context(Worker()))
        outcomes = [row for outcomes in map_in_threads(WORKERS, rows, groups) for row in outcomes]
    return sorted(outcomes, key=lambda row: row.case.order)


def grouped_cases(
    is_selected: Callable[[dict[str, Any]], bool] = lambda scene: True, models: Sequence[str] = ()
) -> list[list[StabilityCase]]:
    """Return the cases of selected scenes and models, grouped by common reference.

    Models without their own scenes get the generic ones.
    """
    for model in models:
        check_built(find_fmu(model))
    selected_scenes, bounds = load_scenes()
    selected_scenes = [
        scene for scene in selected_scenes if is_selected(scene) and (not models or scene["model"] in models)
    ]
    infos: dict[str, FmuInfo] = {}
    for model in dict.fromkeys((*models, *(scene["model"] for scene in selected_scenes))):
        infos[model] = read_info(model)
        if model not in [scene["model"] for scene in selected_scenes]:
            has_comparable_events = len(call_once(find_modes, model, timeout=LIMIT)) < 2
            selected_scenes += generic_scenes(model, infos[model], has_comparable_events)
    groups: dict[str, list[StabilityCase]] = {}
    for order, scene in enumerate(selected_scenes):
        for case in scene_cases(scene, infos[scene["model"]], bounds):
            key = repr((case.model, case.spans, case.grid))
            groups.setdefault(key, []).append(replace(case, order=order))
    return list(groups.values())


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
    scenes: list[dict[str, Any]] = [{"title": "as it comes"}, {"title": "one communication step", "points": 1}]
    scenes += [{"title": f"rtol = {rtol:g}", "rtol": rtol, "finish": {}} for rtol in (1e-3, 1e-9)]
    scenes += [
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
    return [{**common, "pattern": scene["title"], "finish": bounds, **scene} for scene in [*scenes, injections]]


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


def run_group(group: Iterable[StabilityCase], worker: Worker) -> Iterator[CaseOutcome]:
    """Run cases with a common reference in a worker process."""
    reference: Solution | None = None
    reference_error = ""
    for case in group:
        try:
            if case.inject_nonfinite:
                summary = worker.call(inject_nonfinite, case.run, timeout=LIMIT)
                yield judge_injections(case, summary)
                continue
            if case.expected_message is None and reference is None and not reference_error:
                try:
                    reference = worker.call(solve_reference, case.model, case.spans, case.grid, timeout=LIMIT)
                except HarnessError as error:
                    if not case.may_be_refused:
                        raise
                    reference_error = str(error)  # the run may reject such values
            times = reference.times.tolist() if reference else case.grid.times(())
            calls = case.calls or [(t, next_t - t) for t, next_t in pairwise(times)]
            outcome = run_case(case, calls, worker)
            if isinstance(outcome, RefusedRun):
                yield judge_refusal(case, outcome)
            elif reference is None or case.expected_message is not None:
                yield CaseOutcome(case, WRONG, reference_error or "it was accepted", motion=outcome)
            else:
                yield judge_solution(case, outcome, reference)
        except HarnessError as error:
            yield CaseOutcome(case, WRONG, str(error))


def run_case(case: StabilityCase, calls: CommunicationSteps, worker: Worker) -> Trajectory | RefusedRun:
    """Run a case in a worker process."""
    outcome: Trajectory | RefusedRun = worker.call(run_steps, case.run, calls, case.changes, timeout=LIMIT)
    return outcome


def judge_injections(case: StabilityCase, ending: RefusalSummary) -> CaseOutcome:
    if ending.failures:
        return CaseOutcome(case, WRONG, f"{len(ending.failures)} of {ending.n_tried}: {'; '.join(ending.failures)}")
    return CaseOutcome(case, REFUSED, f"{ending.n_tried} of {ending.n_tried}, each variable named")


def judge_refusal(case: StabilityCase, ending: RefusedRun) -> CaseOutcome:
    """Check that a rejection has the expected message, and that values read as NaN after a failure."""
    if not ending.message:
        return CaseOutcome(case, WRONG, "refused without a message")
    if not ending.all_nan and REFUSED_STEP not in ending.message:
        return CaseOutcome(case, WRONG, f"refused, but values can still be read: {ending.message}")
    if not case.may_be_refused and (case.expected_message is None or case.expected_message not in ending.message):
        return CaseOutcome(case, WRONG, f"refused: {ending.message}")
    return CaseOutcome(case, REFUSED, ending.message)


def judge_solution(case: StabilityCase, motion: Trajectory, reference: Solution) -> CaseOutcome:
    """Check events, error and energy of a finished run."""
    assert case.max_error is not None
    x, v, *energies = motion.columns.values()
    statistics = motion.statistics
    assert statistics is not None  # FMUs of this project provide them
    error, energy_rise = motion_error(reference, x, v), math.nan
    conserves = not case.is_driven and bool(energies)
    for energy in energies if conserves else ():
        energy_rise = float((energy - np.minimum.accumulate(energy)).max() / (energy.max() or 1.0))
    reasons = []
    if reference.events is not None and case.events in ("all", case.method):
        events = reference.events
        if statistics.events != len(events):
            reasons.append(f"{statistics.events} events, not {len(events)}")
        elif events:
            delay = abs(statistics.last_event - events[-1][0])
            error = max_or_nan(error, delay / (case.grid.stop - case.grid.start))
    if not error <= case.max_error:
        reasons.append(f"error {error:.2g}, more than {case.max_error:g}")
    if conserves and not energy_rise <= case.max_error:
        reasons.append(f"energy rises by {energy_rise:.2g}")
    return CaseOutcome(case, WRONG if reasons else FINISHED, "; ".join(reasons), error, energy_rise, motion)


def stability_regions(rows: Iterable[CaseOutcome]) -> list[StabilityRegion]:
    """Return steps over stiffness for each method, from the scenes that vary it."""
    points_by_method: dict[str, list[tuple[float, int]]] = {}
    for row in rows:
        if row.case.region is not None and row.motion is not None:
            points_by_method.setdefault(row.case.method, []).append((row.case.region, row.steps))
    regions = []
    for method, points in points_by_method.items():
        stiff, steps = np.array(sorted(points, reverse=True), float).T
        slope = np.diff(np.log(steps[-2:])) / np.diff(np.log(stiff[-2:])) if len(steps) > 1 else [math.nan]
        regions.append(StabilityRegion(method, stiff, steps, float(slope[0])))
    return regions
