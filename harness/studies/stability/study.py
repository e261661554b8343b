"""Study of stiff and extreme cases: each must finish within its error bound or be rejected with a message, never hang.

Scenes and expected outcomes are in stability.toml, references are independent of the FMUs, and every run has a time
limit in a separate process.
"""

import math
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
from ...references.reference_trajectory import max_or_nan, motion_error
from ...results.folder import replace_folder
from ...results.provenance import prefix_parameters, write_provenance
from ...results.registry import find_study
from ...results.summary import write_summary
from ...scenes.fmu_files import check_built, find_fmu
from ...simulation.fmu_archive import declared_parameters
from ...simulation.fmu_info import FmuInfo, read_info
from ...simulation.solution import Solution
from ...simulation.step_sequence import CommunicationSteps, RefusalSummary, RefusedRun, inject_nonfinite, run_steps
from ...simulation.trajectory import Trajectory
from .cases import StabilityCase, generic_scenes, load_scenes, scene_cases
from .outcomes import FINISHED, REFUSED, WRONG, CaseOutcome, StabilityRegion
from .references import find_modes, solve_reference
from .result import StabilityResult

WORKERS = 2
LIMIT = 120.0  # s; time limit of a run and of a reference
STUDY = find_study("stability")
REFUSED_STEP = "a communication step of"  # a refused step changes nothing


def run_stability(
    out: Path, report: Callable[[str, float], None], groups: list[list[StabilityCase]], source: str = ""
) -> StabilityResult:
    """Run groups of cases and write the results to out/stability; `source` names the models if not all are run."""
    with replace_folder(out / STUDY.name, STUDY.files, source) as folder:
        outcomes = run_cases(report, groups)
        result = StabilityResult(tuple(map(without_arrays, outcomes)), tuple(stability_regions(outcomes)))
        result.write(folder)
        fmus = {row.case.name: find_fmu(row.case.model) for row in outcomes}
        values = prefix_parameters({name: declared_parameters(fmu) for name, fmu in fmus.items()})
        write_provenance(folder, fmus.values(), values, source=source)
        write_summary(folder, result.summary())
    return result


def without_arrays(outcome: CaseOutcome) -> CaseOutcome:
    """Return an outcome without the signals of its run, which are judged already."""
    if outcome.motion is None:
        return outcome
    return replace(outcome, motion=replace(outcome.motion, time=np.zeros(0), columns={}))


def run_cases(report: Callable[[str, float], None], groups: list[list[StabilityCase]]) -> list[CaseOutcome]:
    """Run groups of cases in parallel; `report` receives the label of each finished case."""
    idle: SimpleQueue[Worker] = SimpleQueue()  # starting a process takes longer than most runs

    def rows(group: list[StabilityCase]) -> list[CaseOutcome]:
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
