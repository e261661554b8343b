"""Stiff and extreme scenes: each ends within its error, or is refused with its sentence; never a hang.

The scenes and what is expected of them stand in stability.toml, the answers come by a second route (truth.py), and
every run has a time limit, in a process that may crash (bounded.py).
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import astuple, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import HarnessError
from ...process.interruptible_wait import map_in_threads
from ...references.certification import compute_by_two_methods
from ...references.models import MODELS
from ...references.reference_trajectory import (
    ReferenceTrajectory,
    compute_reference,
    max_or_nan,
    require_reference_packages,
)
from ...results.files import write_csv_rows
from ...results.folder import replace_folder
from ...results.provenance import prefix_parameters, write_provenance
from ...running.description import declared_parameters
from ...running.embedded_model import load_model_class
from ...running.fmu_session import (
    CompletedRun,
    FmuInfo,
    RefusalSummary,
    RefusedRun,
    inject_nonfinite,
    read_info,
    run_steps,
)
from ...scenes.fmu_files import check_built, find_fmu
from .cases import StabilityCase, cases, load_scenes, usual
from .outcomes import FINISHED, REFUSED, WRONG, CaseOutcome, StabilityRegion
from .run_with_timeout import run_with_timeout

WORKERS = 2
LIMIT = 120.0  # s, for one run and for one answer to compare with
FOLDER, FILES = "stability", ("stability.csv", "region.svg")


def run_stability(
    out: Path, report: Callable[[str, float], None], chosen: list[list[StabilityCase]], source: str = ""
) -> tuple[list[CaseOutcome], list[StabilityRegion]]:
    """Run the chosen groups of cases and write results to out/stability; `source`: of whom, if not of all."""
    from .figure import draw

    with replace_folder(out / FOLDER, FILES, source) as folder:
        rows = table(report, chosen)
        found = stability_regions(rows)
        save(rows, folder / "stability.csv")
        if found:
            draw(found, folder / "region.svg")
        fmus = {row.case.name: find_fmu(row.case.model) for row in rows}
        values = prefix_parameters({name: declared_parameters(fmu) for name, fmu in fmus.items()})
        write_provenance(folder, fmus.values(), values, source=source)
    return rows, found


def table(report: Callable[[str, float], None], chosen: list[list[StabilityCase]]) -> list[CaseOutcome]:
    """The rows of the chosen cases; `report` hears of each as it comes."""

    def rows(group: list[StabilityCase]) -> list[CaseOutcome]:
        found = []
        for row in run_group(group):
            found.append(row)
            report(row.case.label, 1.0)
        return found

    found = [row for found in map_in_threads(WORKERS, rows, chosen) for row in found]
    return sorted(found, key=lambda row: row.case.order)


def grouped_cases(
    wanted: Callable[[dict[str, Any]], bool] = lambda scene: True, models: Sequence[str] = ()
) -> list[list[StabilityCase]]:
    """The cases of all wanted scenes, of some models only if they are named; those that share one true answer stand
    together.  A model without scenes of its own meets the usual ones."""
    require_reference_packages()
    for model in models:
        check_built(find_fmu(model))
    found, finish = load_scenes()
    found = [scene for scene in found if wanted(scene) and (not models or scene["model"] in models)]
    cards: dict[str, FmuInfo] = {}
    for model in dict.fromkeys((*models, *(scene["model"] for scene in found))):
        cards[model] = run_with_timeout(LIMIT, read_info, model)
        if model not in [scene["model"] for scene in found]:
            settled = len(run_with_timeout(LIMIT, modes, model)) < 2
            found += usual(model, cards[model], settled)
    groups: dict[str, list[StabilityCase]] = {}
    for place, scene in enumerate(found):
        for case in cases(scene, cards[scene["model"]], finish):
            shared = repr((case.model, case.spans, case.grid))
            groups.setdefault(shared, []).append(replace(case, order=place))
    return list(groups.values())


def modes(model: str) -> list[str]:
    """The names of the modes of a model; HarnessError where nothing moves as a body does."""
    carried: Any = load_model_class(find_fmu(model))
    if not {*carried.states} & {*carried.states.values()}:
        raise HarnessError(f"{model}: no state is the rate of another, and the scenes are about positions and speeds")
    return list(carried.contacts)


def run_group(group: Iterable[StabilityCase]) -> Iterator[CaseOutcome]:
    """The rows of cases that share one true answer."""
    answer: ReferenceTrajectory | None = None
    doubt = ""
    for case in group:
        try:
            if case.inject_nonfinite:
                yield judge_injections(case, run_with_timeout(LIMIT, inject_nonfinite, case.setting))
                continue
            if case.expected_message is None and answer is None and not doubt:
                answering = compute_reference if case.model in MODELS else compute_by_two_methods
                try:
                    answer = run_with_timeout(LIMIT, answering, case.model, case.spans, case.grid)
                except HarnessError as error:
                    if not case.may_be_refused:
                        raise
                    doubt = str(error)  # of values that the run may refuse
            times = answer.times.tolist() if answer else case.grid.times(())
            calls = case.calls or [(t, ahead - t) for t, ahead in pairwise(times)]
            ending = run_with_timeout(LIMIT, run_steps, case.setting, calls, case.changes)
            if isinstance(ending, RefusedRun):
                yield judge_refusal(case, ending)
            elif answer is None or case.expected_message is not None:
                yield CaseOutcome(case, WRONG, doubt or "it was taken", motion=ending)
            else:
                yield judge_solution(case, ending, answer)
        except HarnessError as error:
            yield CaseOutcome(case, WRONG, str(error))


def judge_injections(case: StabilityCase, ending: RefusalSummary) -> CaseOutcome:
    if ending.failures:
        return CaseOutcome(case, WRONG, f"{len(ending.failures)} of {ending.n_tried}: {'; '.join(ending.failures)}")
    return CaseOutcome(case, REFUSED, f"{ending.n_tried} of {ending.n_tried}, each by name")


def judge_refusal(case: StabilityCase, ending: RefusedRun) -> CaseOutcome:
    """A refusal says the words that the scene expects, and leaves no number to be taken for a result."""
    if not ending.message:
        return CaseOutcome(case, WRONG, "it was refused without a sentence")
    if not ending.all_nan:
        return CaseOutcome(case, WRONG, f"refused, but numbers can still be read: {ending.message}")
    if not case.may_be_refused and (case.expected_message is None or case.expected_message not in ending.message):
        return CaseOutcome(case, WRONG, f"refused: {ending.message}")
    return CaseOutcome(case, REFUSED, ending.message)


def judge_solution(case: StabilityCase, motion: CompletedRun, answer: ReferenceTrajectory) -> CaseOutcome:
    """A motion has the right events, is as near to the answer as the scene expects, and makes no energy."""
    assert case.max_error is not None
    error = answer.error(motion.x, motion.v)
    rise = math.nan
    free, energy = not case.is_driven and motion.energy is not None, motion.energy
    if free and energy is not None:
        rise = float((energy - np.minimum.accumulate(energy)).max() / (energy.max() or 1.0))
    wrong = []
    if case.events == "all" or case.events == case.method:
        if motion.counts.events != len(answer.events):
            wrong.append(f"{motion.counts.events} events, not {len(answer.events)}")
        elif answer.events:
            late = abs(motion.t_last - answer.events[-1][0])
            error = max_or_nan(error, late / (case.grid.stop - case.grid.start))
    if not error <= case.max_error:
        wrong.append(f"error {error:.2g}, more than {case.max_error:g}")
    if free and not rise <= case.max_error:
        wrong.append(f"energy rises by {rise:.2g}")
    return CaseOutcome(case, WRONG if wrong else FINISHED, "; ".join(wrong), error, rise, motion)


def stability_regions(rows: Iterable[CaseOutcome]) -> list[StabilityRegion]:
    """Steps against stiffness, for each method of the scenes that vary it."""
    found: dict[str, list[tuple[float, int]]] = {}
    for row in rows:
        if row.case.region is not None and row.motion is not None:
            found.setdefault(row.case.method, []).append((row.case.region, row.motion.counts.steps))
    regions = []
    for method, points in found.items():
        stiff, steps = np.array(sorted(points, reverse=True), float).T
        slope = np.diff(np.log(steps[-2:])) / np.diff(np.log(stiff[-2:])) if len(steps) > 1 else [math.nan]
        regions.append(StabilityRegion(method, stiff, steps, float(slope[0])))
    return regions


def save(rows: list[CaseOutcome], path: Path) -> None:
    """Write stability.csv: one line for each row."""
    told = ["model", "scene", "method", "expected", "ended", "error [1]", "energy rise [1]"]
    heads = [*told, "events", "steps", "rejected", "evaluations", "run time [s]", "sentence"]
    write_csv_rows(path, heads, map(line, rows))


def line(row: CaseOutcome) -> list[Any]:
    """What that file says of a row."""
    case, motion = row.case, row.motion
    counts = (*astuple(motion.counts), motion.seconds) if motion else ("", "", "", "", math.nan)
    return [case.name, case.title, case.method, row.expected, row.ended, row.error, row.energy_rise, *counts, row.text]
