"""Verdicts at the top of the page: what was checked, and how much of it is as expected."""

from collections.abc import Sequence
from dataclasses import dataclass

from ..results.summary import MAX_DEVIATION, Outcome, Summary

PUBLISHED, REFERENCE = "published", "reference"  # sections of compared cases
KINDS = {"reference": "a closed form or certified result", "parameter": "the parameter that was set"}


@dataclass(frozen=True)
class Verdict:
    """Verdict on the results of a study.

    Attributes
    ----------
    value, meaning : str
        Number or word, and its meaning.
    details : tuple of str
        Further lines.
    section : str
        Section of the report that shows the results.
    is_good : bool
        Whether all results are as expected.
    """

    value: str
    meaning: str
    details: tuple[str, ...]
    section: str
    is_good: bool


Outcomes = Sequence[tuple[str, Outcome]]  # of the cases by title


def build_verdicts(summaries: Sequence[Summary]) -> list[Verdict]:
    """Return the verdicts for which there are results."""
    outcomes: dict[str, list[tuple[str, Outcome]]] = {}
    for summary in summaries:
        if summary.outcome:
            outcomes.setdefault(summary.study, []).append((summary.title, summary.outcome))
    verdicts = judge_cases(outcomes.get("run", ()))
    if "precision" in outcomes:
        details = (
            *(f"{title}: {outcome.value}" for title, outcome in outcomes["precision"]),
            "Checked: the run time of every method of each FMU and its error against a reference.",
        )
        _, outcome = outcomes["precision"][0]
        verdicts.append(Verdict("Fastest methods", outcome.text, details, "use", True))
    for _, outcome in outcomes.get("stability", ()):
        meaning = "stiff and extreme cases ended within their error bound, or were refused with a message"
        verdicts.append(Verdict(outcome.value, meaning, (outcome.text,), "stability", outcome.is_good))
    return verdicts


def judge_cases(outcomes: Outcomes) -> list[Verdict]:
    """Return the verdicts on the cases with published values, and on those with other known values."""
    published = [(title, outcome) for title, outcome in outcomes if outcome.kind == PUBLISHED]
    others = [(title, outcome) for title, outcome in outcomes if outcome.kind in KINDS]
    verdicts = []
    if published:
        checked = "Checked: peaks, losses, periods, speeds, numbers and sizes of steps. Run times are not compared."
        meaning = f"published cases agree: every value that a publication prints, within {MAX_DEVIATION:g} %"
        verdicts.append(judge(published, meaning, (checked,), PUBLISHED))
    if others:
        lists = {kind: ", ".join(title for title, outcome in others if outcome.kind == kind) for kind in KINDS}
        what = tuple(f"compared with {KINDS[kind]}: {titles}" for kind, titles in lists.items() if titles)
        meaning = f"other cases agree within {MAX_DEVIATION:g} %; no publication has their values"
        verdicts.append(judge(others, meaning, what, REFERENCE))
    return verdicts


def judge(outcomes: Outcomes, meaning: str, notes: Sequence[str], section: str) -> Verdict:
    """Return the number of cases that agree with their values, with those that differ and the largest deviation."""
    details = [f"{title}: {outcome.text}" for title, outcome in outcomes if not outcome.is_good]
    good = [
        (abs(outcome.deviation or 0.0), f"{title}: {outcome.text}") for title, outcome in outcomes if outcome.is_good
    ]
    if good:
        begin = "largest deviation of the others" if details else "largest deviation"
        details.append(f"{begin}: {max(good)[1]}")
    value = f"{len(good)} of {len(outcomes)}"
    return Verdict(value, meaning, (*details, *notes), section, len(good) == len(outcomes))
