"""Fastest method of an FMU for each model and accuracy, from the points of stored work-precision studies."""

import csv
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path

ACCURACIES = (1e-3, 1e-6, 1e-9)
USUAL_ACCURACY = 1e-6  # of the overview
OWN_TOOL = "FMU"
SOLVERS = (OWN_TOOL, "scipy", "cvode")  # compared as solvers, without an importer
LAW_PARAMETER = "friction"  # set in the cases whose law chatters
QUICK_RUN = "a quick run"
NONE_REACHES = "none of the measured methods"  # reaches the accuracy
NOT_MEASURED = "no method has been measured successfully"
CLEAR_FACTOR = 1.5  # run times of a quick run that differ by less are not distinguished

Row = Mapping[str, str]


@dataclass(frozen=True)
class SolverPoint:
    """One solver at one tolerance: tool, method, run time in s, and error relative to the largest value."""

    tool: str
    method: str
    seconds: float
    error: float

    @property
    def name(self) -> str:
        return self.method if self.tool == OWN_TOOL else f"{self.tool} {self.method}"


@dataclass(frozen=True)
class MethodChoice:
    """Cell of the table: the method, and sentences on its time and on the runner-up; no method if none is adequate."""

    method: str
    notes: tuple[str, ...]


@dataclass(frozen=True)
class CaseChoices:
    """Row of the table: model, case, and a choice for each of ACCURACIES.

    The error of a law that chatters is that against true stick and slip. `is_quick` marks a quick study.
    """

    model: str
    case: str
    choices: tuple[MethodChoice, ...]
    is_chattering: bool
    is_quick: bool

    @property
    def usual(self) -> str:
        """Return the method for USUAL_ACCURACY; empty if there is none."""
        return self.choices[ACCURACIES.index(USUAL_ACCURACY)].method


def read_method_choices(results: Path) -> tuple[CaseChoices, ...]:
    """Return the choices of all studies in a results folder; studies that cannot be read are skipped.

    The section of the study reports why it cannot be read.
    """
    choices: list[CaseChoices] = []
    for file in sorted((results / "precision").glob("*.json")):
        try:
            study = json.loads(file.read_text(encoding="utf-8"))
            with file.with_suffix(".csv").open(encoding="utf-8", newline="") as text:
                rows = list(csv.DictReader(text))
            is_quick = study["source"] == QUICK_RUN
            for case, values in study["scene"].items():
                is_chattering = LAW_PARAMETER in values
                points = read_points((row for row in rows if row["case"] == case), is_chattering)
                cells = tuple(choose_method(points, accuracy, is_quick) for accuracy in ACCURACIES)
                choices.append(CaseChoices(file.stem, case, cells, is_chattering, is_quick))
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            continue
    return tuple(choices)


def read_points(rows: Iterable[Row], is_chattering: bool) -> list[SolverPoint]:
    """Return the successful points of one case, with the error against true stick and slip if its law chatters."""
    points = []
    for row in rows:
        error = (row["beside_dry [1]"] if is_chattering else "") or row["largest [1]"]
        if row["tool"] in SOLVERS and not row["failure"] and row["seconds [s]"] and error:
            points.append(SolverPoint(row["tool"], row["method"], float(row["seconds [s]"]), float(error)))
    return [point for point in points if isfinite(point.seconds)]


def choose_method(points: Iterable[SolverPoint], accuracy: float, is_quick: bool = False) -> MethodChoice:
    """Return the fastest method of the FMU whose error is at most `accuracy`, compared with the runner-up."""
    points = list(points)
    fastest: dict[str, SolverPoint] = {}
    for point in sorted(points, key=lambda point: point.seconds):
        if point.error <= accuracy:
            fastest.setdefault(point.name, point)
    best = next((point for point in fastest.values() if point.tool == OWN_TOOL), None)
    if best is None:
        own = min((point for point in points if point.tool == OWN_TOOL), key=lambda point: point.error, default=None)
        if own is None:
            return MethodChoice("", (NOT_MEASURED,))
        return MethodChoice("", (NONE_REACHES, f"smallest error: {own.error:.2g}, with {own.name}"))
    runner_up = next((point for point in fastest.values() if point is not best), None)
    if runner_up is None:
        return MethodChoice(best.method, (format_time(best.seconds), "no other solver reaches it"))
    factor = runner_up.seconds / best.seconds
    comparison = compare_times(factor, runner_up.name)
    if is_quick and 1 / CLEAR_FACTOR < factor < CLEAR_FACTOR:
        comparison = f"{runner_up.name} is about as fast (quick run)"
    return MethodChoice(best.method, (format_time(best.seconds), comparison))


def compare_times(factor: float, other: str) -> str:
    """Return how much faster a method is than another solver, which takes `factor` times as long."""
    if factor < 1:
        return f"{other} is {format_factor(1 / factor)} times faster"
    return f"{format_factor(factor)} times faster than {other}"


def format_factor(factor: float) -> str:
    """Format a factor with two digits."""
    return "many" if factor == inf else f"{float(f'{factor:.2g}'):g}"


def format_time(seconds: float) -> str:
    """Format a run time with two digits; a busy machine makes more of them meaningless."""
    return f"{format_factor(seconds)} s" if seconds >= 1 else f"{format_factor(1e3 * seconds)} ms"
