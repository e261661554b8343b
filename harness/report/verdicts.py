"""Verdicts at the top of the page: published cases, methods, and stability in one line each."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from ..results.provenance import load_provenance
from .method_choice import NONE_REACHES, USUAL_ACCURACY, CaseChoices
from .sections import FAILED, QUANTITIES_FILE, PublishedScene

CHATTERING_LAWS = ("sign", "threshold")
STEP_QUANTITIES = ("steps (time points)", "mean step")
MAX_DEVIATION = 5.0  # percent; a published case counts as reproduced up to this difference


@dataclass(frozen=True)
class Verdict:
    """A number or word, what it means, details, the section that shows more, and whether all is as it should be."""

    value: str
    meaning: str
    details: tuple[str, ...]
    section: str
    is_good: bool


@dataclass(frozen=True)
class Deviation:
    """Difference of a measured quantity from its published value, in percent."""

    case: str
    quantity: str
    percent: float


def build_verdicts(results: Path, scenes: Sequence[PublishedScene], choices: Sequence[CaseChoices]) -> list[Verdict]:
    """Return the verdicts for which there are results."""
    verdicts = judge_published(results, scenes), judge_methods(choices), judge_stability(results)
    return [verdict for verdict in verdicts if verdict]


def judge_published(results: Path, scenes: Sequence[PublishedScene]) -> Verdict | None:
    """Return how many published cases are reproduced, with the worst deviation."""
    worst = []
    for scene in scenes:
        deviations = read_deviations(scene.name, results / scene.name / QUANTITIES_FILE)
        if deviations:
            worst.append(max(deviations, key=lambda deviation: abs(deviation.percent)))
    if not worst:
        return None
    n_reproduced = sum(abs(deviation.percent) <= MAX_DEVIATION for deviation in worst)
    details = [
        f"{deviation.case}: {deviation.quantity} differs by {deviation.percent:+.2g} %{explain(deviation, results)}"
        for deviation in worst
        if abs(deviation.percent) > MAX_DEVIATION
    ]
    within = [deviation for deviation in worst if abs(deviation.percent) <= MAX_DEVIATION]
    if within:
        largest = max(within, key=lambda deviation: abs(deviation.percent))
        begin = "worst deviation" if len(within) == len(worst) else "worst deviation of the others"
        details.append(f"{begin}: {largest.percent:+.2g} %, {largest.quantity} of {largest.case}")
    meaning = f"published cases reproduced within {MAX_DEVIATION:g} %"
    return Verdict(f"{n_reproduced} of {len(worst)}", meaning, tuple(details), "published", n_reproduced == len(worst))


def explain(deviation: Deviation, results: Path) -> str:
    """Return why the steps of a law that chatters cannot be reproduced; empty for other deviations."""
    parameters = load_provenance(results / deviation.case).get("parameters", {})
    law = parameters.get("friction", {}).get("value")
    is_explained = law in CHATTERING_LAWS and deviation.quantity in STEP_QUANTITIES
    return "; its friction chatters, so its steps depend on rounding" * is_explained


def read_deviations(case: str, file: Path) -> list[Deviation]:
    """Return the differences in a file of quantities; none if it cannot be read, which its section reports."""
    try:
        with file.open(encoding="utf-8", newline="") as text:
            rows = [(row[""], row["difference"]) for row in csv.DictReader(text)]
        return [Deviation(case, name, float(cell[:-2])) for name, cell in rows if cell.endswith(" %")]
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return []


def judge_methods(choices: Sequence[CaseChoices]) -> Verdict | None:
    """Return the fastest method of each model for the usual accuracy."""
    if not choices:
        return None
    details = []
    for model, cases in groupby(choices, key=lambda case: case.model):
        methods = dict.fromkeys(case.usual for case in cases if case.usual and not case.is_chattering)
        details.append(f"{model}: {' or '.join(methods) or f'{NONE_REACHES} reached it'}")
    return Verdict("Fastest methods", f"for an error of {USUAL_ACCURACY:.0e}", tuple(details), "use", True)


def judge_stability(results: Path) -> Verdict | None:
    """Return how many stability cases ended as expected."""
    try:
        with (results / "stability/stability.csv").open(encoding="utf-8", newline="") as text:
            failed = [row["ended"] == FAILED for row in csv.DictReader(text)]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    if not failed:
        return None
    n_failed = sum(failed)
    details = (f"{n_failed} failed",) if n_failed else ("none hangs, none ends with a wrong result",)
    value = f"{len(failed) - n_failed} of {len(failed)}"
    return Verdict(value, "stiff and extreme cases ended as expected", details, "stability", not n_failed)
