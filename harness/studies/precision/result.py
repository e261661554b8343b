"""Error against run time of a model: its points, the recommendation, the tables and what the command prints."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import groupby
from math import isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...references.peer_solvers import FMI3_TOOLS, FMPY, FMU, ME
from ...results.quantity import format_power
from ...results.result import Result
from ...results.summary import METHODS_TABLE, Outcome, ResultColumn, ResultTable, Summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TARGET = 1e-6
TARGETS = (1e-3, TARGET, 1e-9)
NONE_REACHES = "no method of the FMU reaches an error of 1e-6"
QUICK_RUN_UNCLEAR = "no recommendation from a quick run; use `friction-fmus precision {}`"
NO_METHOD = "none of the measured methods"  # reaches the accuracy
NOT_MEASURED = "no method has been measured successfully"
UNITS = {  # of columns; SI means m and m/s, or rad and rad/s
    **dict.fromkeys(("rtol", "final", "rms", "largest", "beside_dry", "asymmetry", "integration"), "1"),
    **dict.fromkeys(("seconds", "events", "period"), "s"),
    "atol": "SI",
    "creep": "m/s",
}
EXCHANGE_HEADING = "model exchange by fmpy's CVode: largest error at rtol"
EXCHANGE_TABLE = "FMI 3.0 model exchange with fmpy's CVode: largest error by rtol"
LAWS_TABLE = "laws: model error against true stick and slip; within: integration error"


@dataclass(frozen=True)
class Point:
    """One solver at one tolerance.

    Attributes
    ----------
    case, tool, method
        Case and solver.
    rtol, atol
        Tolerances; NaN for a closed form or for those of the FMU.
    seconds
        Run time in s.
    evaluations
        Number of right-hand side and Jacobian evaluations.
    final, rms, largest, events
        Errors as in certified_reference.SolutionErrors.
    beside_dry
        Largest error against dry friction.
    failure
        Error message of a failed run.
    """

    case: str
    tool: str
    method: str
    rtol: float
    atol: float
    seconds: float = nan
    evaluations: int | None = None
    final: float = nan
    rms: float = nan
    largest: float = nan
    events: float | None = None
    beside_dry: float | None = None
    failure: str = ""

    def error(self, beside_dry: bool) -> float:
        """Return the largest error; if `beside_dry`, that against dry friction where it is known."""
        return self.beside_dry if beside_dry and self.beside_dry is not None else self.largest


@dataclass(frozen=True)
class PrecisionCase:
    """Name and friction law of a case, the values that its runs set, and whether the law chatters."""

    name: str
    law: str
    values: dict[str, Any]
    is_chattering: bool = False


@dataclass(frozen=True)
class LawDeviation:
    """Deviation of a friction law from dry friction.

    Attributes
    ----------
    final, rms, largest
        Errors of the solution of the law, without integration error, as in certified_reference.SolutionErrors.
    creep
        Median speed in m/s while dry friction sticks.
    period
        Slip period in s.
    asymmetry
        Largest forward over largest backward acceleration; 1 for dry friction.
    integration
        Largest integration error of the FMU with its default tolerance and method (ode45 for laws that chatter),
        relative to the solution of the law.
    """

    model: str
    case: str
    law: str
    final: float
    rms: float
    largest: float
    creep: float | None
    period: float | None
    asymmetry: float | None
    integration: float


@dataclass(frozen=True, repr=False)
class PrecisionResult(Result):
    """Error against run time of a model, as `load_result` reads it.

    Attributes
    ----------
    model : str
        Name of the model.
    cases : tuple of PrecisionCase
        Friction laws of the model, and the values that they set.
    points : tuple of Point
        Every solver at every tolerance.
    deviations : tuple of LawDeviation
        Errors of its friction laws.
    min_ratio : float
        Ratio of run times from which solvers are distinguished.
    notes : tuple of str
        What failed or is not installed.
    """

    study, _function, target = "precision", "load_result", TARGET

    model: str
    cases: tuple[PrecisionCase, ...]
    points: tuple[Point, ...]
    deviations: tuple[LawDeviation, ...] = ()
    min_ratio: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        return self.model

    @property
    def _headline(self) -> str:
        return self.clauses[0]

    @cached_property
    def advice(self) -> str:
        """The recommendation in a sentence."""
        return recommend(self)

    @property
    def clauses(self) -> tuple[str, ...]:
        """The recommendation in several sentences."""
        return split_clauses(self.advice.removeprefix(f"{self.title}: "))

    @property
    def _caption(self) -> str:
        return f"{self.title}: run time and right-hand side evaluations over the largest error, by method"

    @property
    def outcome(self) -> Outcome:
        """The methods for the usual accuracy."""
        smooth = [case for case in self.cases if not case.is_chattering]
        usual = dict.fromkeys(choose_method(self, case, TARGET, self.min_ratio)[0] for case in smooth)
        methods = " or ".join(filter(None, usual)) or f"{NO_METHOD} reached it"
        return Outcome(methods, f"for an error of {format_power(TARGET)}", True)

    def curve(self, case: PrecisionCase, tool: str, method: str) -> list[Point]:
        """Return the successful points of one solver, in the order of tolerances."""
        key = (case.name, tool, method)
        return [p for p in self.points if (p.case, p.tool, p.method) == key and not p.failure]

    def solvers(self, case: PrecisionCase) -> list[tuple[str, str]]:
        """Return tool and method of every solver of a case."""
        return list(dict.fromkeys((point.tool, point.method) for point in self.points if point.case == case.name))

    def exchange_errors(self) -> dict[float, dict[str, float]]:
        """Return the largest error of every case in model exchange by rtol; NaN for failed runs, empty without FMU."""
        errors_by_rtol: dict[float, dict[str, float]] = {}
        for point in self.points:
            if point.tool == ME and not isnan(point.rtol):
                errors_by_rtol.setdefault(point.rtol, {})[point.case] = point.largest
        return errors_by_rtol

    def rank_solvers(self, case: PrecisionCase, target: float = TARGET, beside_dry: bool = False) -> list[Point]:
        """Return the fastest point of every solver that meets the target, fastest first, without runs through fmpy."""
        curves = [self.curve(case, *solver) for solver in self.solvers(case) if solver[0] not in (FMPY, *FMI3_TOOLS)]
        points = [point for curve in curves if (point := fastest_point(curve, target, beside_dry))]
        return sorted(points, key=lambda point: point.seconds)

    def _tabulate(self) -> tuple[ResultTable, ...]:
        """Return what every solver needs for a given error, the errors in model exchange, and those of the laws."""
        solvers = [(case, *solver) for case in self.cases for solver in self.solvers(case)]
        columns = [ResultColumn("solver", "{0[1]}: {0[2]}", is_text=True)]
        for target in TARGETS:
            columns += [ResultColumn(f"{format_power(target)}: ms", partial(format_cost, self, target, "seconds"))]
            columns += [ResultColumn("calls", partial(format_cost, self, target, "evaluations"))]
        title = f"{self.model}: run time and right-hand side calls for a given largest error"
        measured_solvers = [solver for solver in solvers if self.curve(*solver)]
        work = ResultTable(measured_solvers, columns, title, group=lambda solver: (solver[0].law,))
        return work, self.exchange_table(), ResultTable(self.deviations, DEVIATIONS, LAWS_TABLE, UNITS)

    def exchange_table(self) -> ResultTable:
        """Return the largest errors in model exchange by relative tolerance."""
        rows = [{EXCHANGE_HEADING: rtol} | errors for rtol, errors in self.exchange_errors().items()]
        names = [*rows[0]][1:] if rows else []
        columns = [ResultColumn("rtol", lambda row: format_power(row[EXCHANGE_HEADING]), is_text=True)]
        columns += [ResultColumn(name.replace("-", "\n"), partial(format_error, name)) for name in names]
        return ResultTable(rows, columns, EXCHANGE_TABLE, dict.fromkeys([EXCHANGE_HEADING, *names], "1"))

    def _tabulate_details(self) -> tuple[ResultTable, ...]:
        """Return the fastest methods by case and accuracy."""
        columns = [ResultColumn("case", partial(describe_case, self), is_text=True)]
        for target in TARGETS:
            heading = f"error up to {format_power(target)}"
            columns.append(ResultColumn(heading, partial(describe_choice, self, target), is_text=True))
        return (ResultTable(self.cases, columns, METHODS_TABLE),)

    def _data_table(self) -> ResultTable:
        return ResultTable(self.points, (), units=UNITS)

    def sentences(self) -> list[str]:
        return [self.advice, *self.notes]

    def summary(self) -> Summary:
        return replace(super().summary(), sentences=self.clauses)

    def as_json(self) -> dict[str, Any]:
        return {
            "points": {self.title: self.points},
            "laws": self.deviations,
            "advice": [self.advice],
            "missing": self.notes,
        }

    def _origin(self) -> dict[str, Any]:
        return super()._origin() | {"scene": {case.name: case.values for case in self.cases}}

    def _write_tables(self, folder: Path) -> None:
        """Write points.csv, and model-exchange.csv and laws.csv if there are any."""
        self._data_table().write_csv(folder / "points.csv")
        _, exchange, deviations = self._tabulate()
        for table, name in ((exchange, "model-exchange.csv"), (deviations, "laws.csv")):
            if table.items:
                table.write_csv(folder / name)

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import draw_case

        draw_case(axes, self, self.cases[0])


def format_cost(study: PrecisionResult, target: float, cost: str, solver: tuple[PrecisionCase, str, str]) -> str:
    """Return the run time in ms or the number of evaluations of a solver for an error up to `target`."""
    point = fastest_point(study.curve(*solver), target)
    if point is None:
        return "-"
    return f"{1e3 * point.seconds:.3g}" if cost == "seconds" else str(point.evaluations)


def format_error(case: str, errors: dict[str, float]) -> str:
    """Return the error of a case in model exchange."""
    return "-" if isnan(errors[case]) else format_power(errors[case])


def format_optional(value: float | None, spec: str) -> str:
    """Return a number; empty for None."""
    return "" if value is None else f"{value:{spec}}"


DEVIATIONS = (
    ResultColumn("law", "{0.case}", is_text=True),
    ResultColumn("rms", "{0.rms:.2g}"),
    ResultColumn("largest", "{0.largest:.2g}"),
    ResultColumn("within", "{0.integration:.0e}"),
    ResultColumn("creep [m/s]", lambda law: format_optional(law.creep, ".2g")),
    ResultColumn("period [s]", lambda law: format_optional(law.period, ".4f")),
    ResultColumn("a+/a-", lambda law: format_optional(law.asymmetry, ".3f")),
)


def split_clauses(text: str) -> tuple[str, ...]:
    """Split a recommendation at its semicolons, except those in parentheses, into sentences.

    >>> split_clauses("use exact (1e-15; ode45 2 times); no more.")
    ('Use exact (1e-15; ode45 2 times).', 'No more.')
    """
    clauses = re.split(r"; (?![^()]*\))", text.rstrip("."))
    return tuple(f"{clause[:1].upper()}{clause[1:]}." for clause in clauses if clause)


def fastest_point(curve: Iterable[Point], target: float, beside_dry: bool = False) -> Point | None:
    """Return the fastest point with an error up to the target, or None."""
    points = [point for point in curve if point.error(beside_dry) <= target]
    return min(points, key=lambda point: point.seconds, default=None)


def recommend(study: PrecisionResult) -> str:
    """Return a sentence with the recommendation for a model; run times must differ by the factor `min_ratio`."""
    min_ratio = study.min_ratio
    best = [(case, study.rank_solvers(case, TARGET)) for case in study.cases if not case.is_chattering]
    no_method = QUICK_RUN_UNCLEAR.format(study.model) if min_ratio else NONE_REACHES
    parts = []
    for method, cases in groupby(best, key=lambda pair: best_method(pair[1], min_ratio)):
        parts.append(f"use {method}: " + join_words([describe_cost(*item) for item in cases]) if method else no_method)
    parts += [describe_shortcut(study, case) for case in study.cases if case.is_chattering]
    errors_by_law = {law.case: law.largest for law in study.deviations}
    smooth = [
        f"{errors_by_law[case.name]:.2g}"
        for case in study.cases
        if case.name in errors_by_law and not case.is_chattering
    ]
    if smooth:
        parts.append(
            f"without integration error, these laws differ from dry friction by {join_words(smooth)} of the motion"
        )
    return f"{study.model}: " + "; ".join(parts) + "."


def best_method(ranks: list[Point], min_ratio: float) -> str:
    """Return the best method of the FMU; empty if another solver is faster or not clearly slower."""
    best = next((point for point in ranks if point.tool == FMU), None)
    if best is None or any(point.seconds < min_ratio * best.seconds for point in ranks if point is not best):
        return ""
    return best.method


def describe_cost(case: PrecisionCase, ranks: list[Point]) -> str:
    """Describe the run time of the best method, and relative run times of the second best and of the best peer."""
    own_points = [point for point in ranks if point.tool == FMU]
    peers = [point for point in ranks if point.tool != FMU]
    first = own_points[0]
    tolerance_text = "" if isnan(first.rtol) else f" at rtol {format_power(first.rtol)}"
    text = f"error {format_power(first.largest)} in {1e3 * first.seconds:.2g} ms{tolerance_text} ({case.law}"
    others = [(point.method, point) for point in own_points[1:2]]
    others += [(f"{point.tool} {point.method}", point) for point in peers[:1]]
    ratios = [(name, point.seconds / first.seconds) for name, point in others]
    relative = [f"{name} {format_ratio(ratio)}" + ", not a method of the FMU" * (ratio < 1) for name, ratio in ratios]
    return text + (f"; relative run time at error {format_power(TARGET)}: {', '.join(relative)})" if relative else ")")


def describe_shortcut(study: PrecisionResult, case: PrecisionCase) -> str:
    """Describe the run time of a law that chatters, relative to the first law of the model."""
    solvers = [solver for solver in study.solvers(case) if solver[0] == FMU]
    points = [point for solver in solvers for point in study.curve(case, *solver)]
    best = study.rank_solvers(study.cases[0], TARGET)
    fastest = fastest_point(points, TARGET, beside_dry=True)
    if fastest and best:
        ratio = fastest.seconds / best[0].seconds
        return f"the law '{case.law}' takes {format_ratio(ratio)} times the run time at error {format_power(TARGET)}"
    nearest = min((point.beside_dry for point in points if point.beside_dry is not None), default=float("nan"))
    return f"the law '{case.law}' does not get below an error of {nearest:.1g} against stick and slip"


def format_ratio(value: float) -> str:
    """Format a ratio with two digits and without an exponent: 140."""
    return f"{float(f'{value:.2g}'):g}"


def join_words(words: list[str]) -> str:
    """Join words with commas and a final "and"."""
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def describe_case(study: PrecisionResult, case: PrecisionCase) -> str:
    """Return the name of a case, and what its errors refer to."""
    notes = ["error against true stick and slip"] * case.is_chattering + ["quick run"] * bool(study.min_ratio)
    return "\n".join((case.name, *notes))


def describe_choice(study: PrecisionResult, accuracy: float, case: PrecisionCase) -> str:
    """Return the fastest method of a case, its run time and the runner-up, in lines."""
    return "\n".join(choose_method(study, case, accuracy, study.min_ratio))


def choose_method(
    study: PrecisionResult, case: PrecisionCase, accuracy: float, min_ratio: float = 0.0
) -> tuple[str, ...]:
    """Return the fastest method of the FMU whose error is at most `accuracy`, its run time, and the runner-up.

    The method is empty if there is none. The error of a law that chatters is that against true stick and slip. Run
    times that differ by less than the factor `min_ratio` are not distinguished.
    """
    ranks = study.rank_solvers(case, accuracy, case.is_chattering)
    best = next((point for point in ranks if point.tool == FMU), None)
    if best is None:
        return "", *smallest_error(study, case)
    runner_up = next((point for point in ranks if point is not best), None)
    comparison = compare_times(best, runner_up, min_ratio) if runner_up else "no other solver reaches it"
    return best.method, format_time(best.seconds), comparison


def smallest_error(study: PrecisionResult, case: PrecisionCase) -> tuple[str, ...]:
    """Return sentences on the smallest error that the methods of the FMU reach."""
    curves = [study.curve(case, *solver) for solver in study.solvers(case) if solver[0] == FMU]
    errors = [(point.error(case.is_chattering), point.method) for curve in curves for point in curve]
    if not errors:
        return (NOT_MEASURED,)
    error, method = min(errors)
    return NO_METHOD, f"smallest error: {error:.2g}, with {method}"


def compare_times(best: Point, other: Point, min_ratio: float) -> str:
    """Return how much faster a method is than another solver."""
    ratio, name = other.seconds / best.seconds, other.method if other.tool == FMU else f"{other.tool} {other.method}"
    if min_ratio and 1 / min_ratio < ratio < min_ratio:
        return f"{name} is about as fast (quick run)"
    if ratio < 1:
        return f"{name} is {format_ratio(1 / ratio)} times faster"
    return f"{format_ratio(ratio)} times faster than {name}"


def format_time(seconds: float) -> str:
    """Format a run time with two digits; a busy machine makes more of them meaningless."""
    return f"{format_ratio(seconds)} s" if seconds >= 1 else f"{format_ratio(1e3 * seconds)} ms"
