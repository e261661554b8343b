"""What a decay says about damping, dry friction and drag, from its record to values, intervals and remarks.

1. turning points are found and numbered (turning.py);
2. what each half swing loses gives a start (energy.py), and the turning points, matched by number, a better one;
3. the law itself (law.py) is fitted to every sample of the free motion (model.py, window.py);
4. the seven laws compete (choice.py), and the full one tells how sure it all is (intervals.py);
5. what is in doubt is said, and what is no answer is refused (remarks.py).

Steps 2 and 4 follow J. W. Liang, B. F. Feeny, Nonlinear Dynamics 16 (1998), and Journal of Sound and Vibration 295
(2006); that a half swing depends on its amplitude alone, so that a table of it gives the whole signal, is ours.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ...errors import HarnessError
from ...records.record import Record
from .estimates import Estimate, KnownParameters, estimates
from .extrema import Extrema, find_extrema
from .extrema_fit import estimate_from_extrema, estimate_from_two_peaks
from .fit_problem import FitProblem
from .free_motion import select_free_motion
from .intervals import FitUncertainty, spread
from .law import DRIFT, REST, TERMS, Terms
from .least_squares import FitError
from .model_selection import FittedLaw, fit_all_laws, select_reported_law
from .noise import remove_spikes
from .remarks import ROUGH, compare_halves, reject_unusable_fit, remarks


@dataclass(frozen=True)
class DecayIdentification:
    """A record, its turning points and what they say, and the laws tried, best first, fitted to the samples of
    `problem`.  `published`: what the first and last turning point say; `why` some have nothing to say."""

    record: Record
    extrema: Extrema
    problem: FitProblem
    laws: tuple[FittedLaw, ...]
    spread: FitUncertainty
    estimates: tuple[Estimate, ...]
    extrema_estimates: tuple[Estimate, ...]
    two_peak_estimates: tuple[Estimate, ...]
    unavailable: dict[str, str]
    remarks: tuple[str, ...]

    @property
    def best(self) -> FittedLaw:
        return self.laws[0]

    @property
    def t(self) -> np.ndarray:
        """The times (n,) in s of the samples used."""
        return self.problem.t + self.problem.time_origin

    @property
    def x(self) -> np.ndarray:
        """The samples used (n,), in the record's unit."""
        return self.problem.x * self.problem.scale + self.problem.offset

    def signal(self, law: FittedLaw, t: np.ndarray) -> np.ndarray:
        """What a law says at the times t (n,) in s, in the record's unit."""
        x, _ = self.problem.model(law.p, self.problem.unknowns(law.terms), t - self.problem.time_origin)
        return x * self.problem.scale + self.problem.offset

    def rest(self, law: FittedLaw, t: np.ndarray) -> np.ndarray:
        """The rest position (n,) at the times t (n,) in s, in the record's unit."""
        problem = self.problem
        moved = law.p[DRIFT] * (t - problem.time_origin - problem.model.middle)
        return (law.p[REST] + moved) * problem.scale + problem.offset

    @property
    def rms(self) -> float:
        """Of the residuals of the best law, in the record's unit."""
        return float(np.sqrt(self.best.sum_of_squares / len(self.problem.t))) * self.problem.scale

    @property
    def sentence(self) -> str:
        """The choice of the law, and how clear it is."""
        if not any(each.low > 0 for each in self.estimates if each.name in TERMS) and not self.best.p[5:].any():
            return "No loss stands out of the noise; the intervals say how large it may be."
        others = [f"{law.description} {law.bic - self.best.bic:+.1f}" for law in self.laws[1:]]
        rest = f"; {', '.join(others)})" if others else ")"
        return f"Best described by {self.best.description} (BIC {self.best.bic:.1f}{rest}."


def fit_decay(
    record: Record,
    known: KnownParameters,
    drag: bool = True,
    drift: bool = False,
    report: Callable[[float], None] = lambda share: None,
) -> DecayIdentification:
    """Identify a decay; without `drag` its laws are left out, with `drift` the rest position moves at a steady rate.
    HarnessError where there is no decay, or no fit, with what would mend it where that is known."""
    try:
        return identify_record(record, known, drag, drift, report)
    except HarnessError as error:
        calm = remove_spikes(record)
        if calm is not record:
            with suppress(HarnessError):
                return identify_record(calm, known, drag, drift, report)
        if not isinstance(error, FitError):
            raise
        raise HarnessError(
            f"{record.name} {error}; {suggest_remedy(record, known, drag, drift) or error.advice}"
        ) from None


def suggest_remedy(record: Record, known: KnownParameters, drag: bool, drift: bool) -> str:
    """What would let a record be fitted, where that is known."""
    if known.pendulum and record.order == 2:
        return (
            "beyond 90 degrees the angular acceleration of a pendulum has two peaks a swing: record the angle or its "
            "rate, or leave out the large swings with --from"
        )
    if not drift:
        with suppress(HarnessError):
            found = identify_record(record, known, drag, True, lambda share: None)
            over = next(each.value for each in found.estimates if each.name == "drift") * np.ptp(record.t)
            if not found.problem.rough(found.best.sum_of_squares):
                return (
                    f"the rest position drifts, by {over:.3g} {record.unit} over the record: --drift fits that as well"
                )
    return ""


def identify_record(
    record: Record, known: KnownParameters, drag: bool, drift: bool, report: Callable[[float], None]
) -> DecayIdentification:
    """The same; Unfit where no law fits."""
    if known.pendulum and record.base != "rad":
        raise HarnessError(
            f"a pendulum is measured by its angle or its rate, and {record.name} is in {record.unit} (an accelerometer "
            "on it feels its weight as well): give --unit rad, deg, rad/s or deg/s, or leave out --pendulum"
        )
    terms: Terms = TERMS if drag else ("zeta", "r")
    turns = find_extrema(record, known.pendulum)
    unknowns = 5 + len(terms) + drift
    if len(record.t) <= unknowns:
        raise HarnessError(f"{record.name} has {len(record.t)} samples for {unknowns} values to find; sample finer")
    report(0.1)
    window = select_free_motion(record, turns, terms, known.pendulum, drift)
    problem = window.problem
    report(0.5)
    amplitudes = amplitudes_of(turns) / problem.scale
    laws = fit_all_laws(
        problem, (window.p, window.sum_of_squares), terms, amplitudes, lambda share: report(0.5 + 0.4 * share)
    )
    full = next(law for law in laws if law.terms == terms)
    found = spread(problem, full.p, terms)
    reject_unusable_fit(record, problem, full, found, known.pendulum)
    values = select_reported_law(laws, full, problem)
    told = estimates(record, problem, values, full, found, known)
    said = [*record.notes, *window.notes, *remarks(record, problem, laws, full, found)]
    if found.alike and found.rms > ROUGH * problem.noise:
        told, more = compare_halves(problem, full, told)
        said += more
    omega = told[0]
    turning, no_turning = estimate_from_extrema(record, problem, turns, laws[0], known, omega)
    peaks, no_peaks = estimate_from_two_peaks(record, problem, turns, laws[0], known, omega)
    why = {"turning points": no_turning, "two peaks": no_peaks}
    return DecayIdentification(record, turns, problem, laws, found, told, turning, peaks, why, tuple(said))


def amplitudes_of(turns: Extrema) -> np.ndarray:
    """Amplitudes at the turning points (n,), each about the middle of its neighbours."""
    x = turns.x
    between = (x[:-2] + 2 * x[1:-1] + x[2:]) / 4 if len(x) > 3 else x
    return np.abs(x - np.median(between))
