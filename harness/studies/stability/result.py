"""Outcomes of stiff and extreme cases, with their tables, their figure and what the command prints."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import check_names
from ...references.reference_trajectory import CommunicationGrid
from ...references.segments import ParameterSpan
from ...results.result import Result
from ...results.summary import Outcome, ResultColumn, ResultTable, Summary
from ...scenes.run_spec import RunSpec
from ...simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNITS = {"error": "1", "energy rise": "1", "run time": "s"}  # of columns of stability.csv
FINISHED, REFUSED, WRONG = "finished", "refused", "wrong"


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


@dataclass(frozen=True)
class CaseOutcome:
    """Outcome of a case.

    Attributes
    ----------
    case : StabilityCase
        The case.
    ended : str
        FINISHED, REFUSED or WRONG.
    text : str
        Message of the FMU, or reason why the outcome is wrong.
    error : float
        Largest error relative to the largest value; NaN if undefined.
    energy_rise : float
        Rise of the energy without external work, relative to its largest value; NaN if undefined.
    motion : Trajectory or None
        Run of the case, if it finished.
    """

    case: StabilityCase
    ended: str
    text: str
    error: float = math.nan
    energy_rise: float = math.nan
    motion: Trajectory | None = None

    @property
    def steps(self) -> int:
        """Return the number of accepted steps of the run."""
        return self.motion.statistics.steps if self.motion and self.motion.statistics else 0

    @property
    def expected(self) -> str:
        case = self.case
        if case.inject_nonfinite:
            return "refused, naming each variable"
        if case.expected_message:
            return f"refused: {case.expected_message}"
        return f"finished within {case.max_error:g}{', or refused' * case.may_be_refused}"

    @property
    def has_passed(self) -> bool:
        """Return whether the case ended as expected."""
        if self.case.may_be_refused and self.ended != WRONG:
            return True
        return self.ended == (REFUSED if self.case.inject_nonfinite or self.case.expected_message else FINISHED)


@dataclass(frozen=True)
class StabilityRegion:
    """Number of `steps` (n,) of a method over x_m in m/s (`stiffness`, (n,)), with the slope in log-log scale.

    The slope is that of the two stiffest scenes: -1 for an explicit method at its stability limit, 0 without limit.
    """

    method: str
    stiffness: np.ndarray
    steps: np.ndarray
    slope: float


@dataclass(frozen=True, repr=False)
class StabilityResult(Result):
    """Outcomes of stiff and extreme cases, as `load_result` reads them.

    Attributes
    ----------
    outcomes : tuple of CaseOutcome
        Outcome of each case.
    regions : tuple of StabilityRegion
        Number of steps of each method over the stiffness.
    """

    study, _function = "stability", "load_result"

    outcomes: tuple[CaseOutcome, ...]
    regions: tuple[StabilityRegion, ...]

    @property
    def title(self) -> str:
        return "Outcomes"

    @property
    def _headline(self) -> str:
        return f"{self.n_passed} of {len(self.outcomes)} ended as expected"

    @property
    def n_passed(self) -> int:
        """The number of cases that ended as expected."""
        return sum(row.has_passed for row in self.outcomes)

    @property
    def _caption(self) -> str:
        return "Internal steps of each method over x_m, the speed of maximum friction"

    @property
    def outcome(self) -> Outcome:
        n_failed = len(self.outcomes) - self.n_passed
        text = f"{n_failed} failed" if n_failed else "none hangs, none ends with a wrong result"
        return Outcome(f"{self.n_passed} of {len(self.outcomes)}", text, not n_failed)

    def _tabulate(self) -> tuple[ResultTable, ...]:
        """Return the errors and steps of runs that should finish, and the messages of those that should be refused."""
        finishing_cases: dict[tuple[str, str], dict[str, CaseOutcome]] = {}
        numbers, refusals = dict[str, float](), dict[str, list[CaseOutcome]]()
        for row in sorted(self.outcomes, key=lambda row: row.case.name):
            if row.case.max_error is not None:
                finishing_cases.setdefault((row.case.name, row.case.title), {})[row.case.method] = row
                numbers[row.case.method] = row.case.run.values["solver.method"]
        for row in self.outcomes:
            if row.case.max_error is None:
                refusals.setdefault(row.case.title, []).append(row)
        columns = [ResultColumn("scene", lambda item: item[0][1], is_text=True)]
        columns += [
            ResultColumn(name, partial(format_outcome, name))
            for name in sorted(numbers, key=lambda name: numbers[name])
        ]
        title = "largest relative error, and internal steps below"
        errors = ResultTable([*finishing_cases.items()], columns, title, group=lambda item: (item[0][0],))
        return errors, ResultTable([*refusals.values()], REFUSALS, "refused with a message")

    def _tabulate_details(self) -> tuple[ResultTable, ...]:
        """Return the cases that failed, and the number of outcomes by model and method."""
        failed_outcomes = [row for row in self.outcomes if row.ended == WRONG]
        pairs: dict[tuple[str, str], Counter[str]] = {}
        for row in self.outcomes:
            pairs.setdefault((row.case.name, row.case.method), Counter())[row.ended] += 1
        endings = sorted({ending for counts in pairs.values() for ending in counts})
        columns = [ResultColumn("model", "{0[0][0]}", is_text=True), ResultColumn("method", "{0[0][1]}", is_text=True)]
        columns += [ResultColumn("failed" if name == WRONG else name, f"{{0[1][{name}]}}") for name in endings]
        count_table = ResultTable(
            sorted(pairs.items(), key=lambda item: item[0]), columns, "Number of outcomes by model and method"
        )
        return ResultTable(failed_outcomes, FAILURES, "Cases that failed"), count_table

    def summary(self) -> Summary:
        """Return the findings, with the cases that failed first."""
        tables = [part for table in self._tabulate_details() for part in table.summarize()]
        return replace(super().summary(), tables=(replace(tables[0], title=""), *tables[1:]))

    def sentences(self) -> list[str]:
        """Return a summary of outcomes, energy, and steps bounded by stability."""
        lines = [f"{self._headline}."]
        rising_outcomes = [row for row in self.outcomes if row.energy_rise >= 0.0]
        exact = [row.energy_rise for row in rising_outcomes if row.case.method == "exact"]
        others = [row.energy_rise / row.case.rtol for row in rising_outcomes if row.case.method != "exact"]
        if exact and others:
            of_others = f"{max(others):.2g} rtol with other methods"
            text = f"at most {max(exact):.1g} of its largest value with exact, {of_others}"
            lines.append(f"Spurious increase of energy: {text}.")
        for region in self.regions:
            bound = "bounded by stability" if region.slope < -0.5 else "not bounded by stability"
            growth = f"steps grow as x_m^{region.slope:+.2f} at x_m = {region.stiffness[-1]:g} m/s"
            lines.append(f"{region.method}: {growth}, {bound}.")
        return lines

    def _data_table(self) -> ResultTable:
        return ResultTable([*map(list_numbers, self.outcomes)], (), units=UNITS)

    def as_json(self) -> Any:
        return [{"scene": row.case.label, "passed": row.has_passed, "ended": row.ended} for row in self.outcomes]

    def __getitem__(self, name: str) -> Any:
        """Return how a case ended by its label, as in the JSON."""
        cases = {case["scene"]: case for case in self.as_json()}
        check_names("case", [name], cases)
        return cases[name]

    def describe_failures(self) -> Iterator[str]:
        """Yield a sentence on each case that did not end as expected."""
        return (f"{row.case.label}: {row.text}" for row in self.outcomes if not row.has_passed)

    def _write_tables(self, folder: Path) -> None:
        """Write stability.csv with one line per case."""
        self._data_table().write_csv(folder / "stability.csv")

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw

        if self.regions:
            draw(self.regions, figure)

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_steps

        plot_steps(axes, self.regions)


def list_numbers(row: CaseOutcome) -> dict[str, Any]:
    """Return the line of a case in stability.csv."""
    case, statistics = row.case, row.motion.statistics if row.motion else None
    return {
        "model": case.name,
        "scene": case.title,
        "method": case.method,
        "expected": row.expected,
        "ended": row.ended,
        "error": row.error,
        "energy rise": row.energy_rise,
        **{name: getattr(statistics, name, None) for name in ("events", "steps", "rejected", "evaluations")},
        "run time": getattr(statistics, "seconds", None),
        "sentence": row.text,
    }


def format_outcome(method: str, item: tuple[tuple[str, str], dict[str, CaseOutcome]]) -> str:
    """Return the error and the steps of a case by a method."""
    row = item[1].get(method)
    if row is None:
        return ""
    if row.has_passed and row.ended == REFUSED:
        return "refused"
    if not row.has_passed or row.motion is None:
        return "wrong"
    return f"{f'{row.error:.0e}' if row.error else '0'}\n{row.steps}"


def first_failure(rows: list[CaseOutcome]) -> str:
    """Return the message of the first case that failed, or of the first one."""
    return ([row for row in rows if not row.has_passed] or rows)[0].text


REFUSALS = (  # of the cases with one title
    ResultColumn("scene", "{0[0].case.title}", is_text=True),
    ResultColumn("models", lambda rows: ", ".join(dict.fromkeys(row.case.name for row in rows)), is_text=True),
    ResultColumn("message", first_failure, is_text=True),
)
FAILURES = (
    ResultColumn("model", "{0.case.name}", is_text=True),
    ResultColumn("case", "{0.case.title}", is_text=True),
    ResultColumn("method", "{0.case.method}", is_text=True),
    ResultColumn("reason", "{0.text}", is_text=True),
)
