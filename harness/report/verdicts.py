"""Verdicts at the top of the page: published cases, methods, and stability in one line each."""

from collections.abc import Sequence
from dataclasses import dataclass

from ..results.summary import MAX_DEVIATION, Outcome, Summary


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


def build_verdicts(summaries: Sequence[Summary]) -> list[Verdict]:
    """Return the verdicts for which there are results."""
    outcomes: dict[str, list[tuple[str, Outcome]]] = {}
    for summary in summaries:
        if summary.outcome:
            outcomes.setdefault(summary.study, []).append((summary.title, summary.outcome))
    verdicts = []
    if "run" in outcomes:
        verdicts.append(judge_published(outcomes["run"]))
    if "precision" in outcomes:
        details = tuple(f"{title}: {outcome.value}" for title, outcome in outcomes["precision"])
        _, outcome = outcomes["precision"][0]
        verdicts.append(Verdict("Fastest methods", outcome.text, details, "use", True))
    for _, outcome in outcomes.get("stability", ()):
        meaning = "stiff and extreme cases ended as expected"
        verdicts.append(Verdict(outcome.value, meaning, (outcome.text,), "stability", outcome.is_good))
    return verdicts


def judge_published(outcomes: Sequence[tuple[str, Outcome]]) -> Verdict:
    """Return the number of reproduced published cases, with the largest deviation."""
    details = [f"{title}: {outcome.text}" for title, outcome in outcomes if not outcome.is_good]
    good = [
        (abs(outcome.deviation or 0.0), f"{title}: {outcome.text}") for title, outcome in outcomes if outcome.is_good
    ]
    if good:
        begin = "largest deviation of the others" if details else "largest deviation"
        details.append(f"{begin}: {max(good)[1]}")
    meaning = f"published cases reproduced within {MAX_DEVIATION:g} %"
    return Verdict(f"{len(good)} of {len(outcomes)}", meaning, tuple(details), "published", len(good) == len(outcomes))
