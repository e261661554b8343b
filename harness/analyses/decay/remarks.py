"""What a reader of the values should know before believing them; and what is no answer at all."""

from dataclasses import replace

import numpy as np

from ...records.record import Record
from .estimates import Estimate, sizes
from .fit_problem import FitProblem
from .intervals import FitUncertainty, spread
from .law import AMPLITUDE, DRIFT, OMEGA, REST, UNKNOWNS, ZETA
from .least_squares import FitError
from .model_selection import FittedLaw, more

ROUGH = 1.5  # times the noise: residuals beyond are no noise of single samples
UNFIT = 0.1  # share of the motion: residuals beyond are no free decay of one oscillator
PART = 0.008  # the same: something else acts
CLEAR = 6.0  # of BIC: odds of 20 to 1
APART = 3.0  # errors by which the halves of a record disagree
HINTED = 4.0  # of n ln(squares): what one more term takes away by chance once in twenty times
DRIFTS = 5.0  # errors of a drift that is told
GAINS = 5.0  # errors by which the losses are negative
LEAST_TURNS = 6  # for their places to be more than chance
KEEPS_TIME = 12.0  # of n R^2, R the mean of n places on a circle: once in a hundred thousand records by chance
FEWEST = 100  # samples of a half that is fitted apart


def reject_unusable_fit(
    record: Record, problem: FitProblem, full: FittedLaw, spread: FitUncertainty, pendulum: bool
) -> None:
    """Unfit where the best fit is no answer."""
    e, _ = problem.off(full.p, full.terms)
    share = spread.rms / problem.motion
    if share > UNFIT and spread.rms > 2 * problem.noise:
        advice = "cut the record there with --from or --until"
        if record.base == "rad" and not pendulum:
            advice = "say --pendulum if it is one, or " + advice
        raise FitError(
            f"is not a free decay of one oscillator: the best fit leaves {100 * min(share, 1.0):.0f} % of the "
            f"motion, most of it about t = {record.format_time(time_of_largest_residuals(problem, full.p, e))} s",
            advice,
        )
    if gains(problem, full) < -GAINS:
        raise FitError("gains energy, so it is driven: the damping ratio that fits it best is negative")


def time_of_largest_residuals(problem: FitProblem, p: np.ndarray, e: np.ndarray) -> float:
    """The time in s of the half swing whose residuals are largest."""
    width = max(int(np.pi / p[OMEGA] / float(np.median(np.diff(problem.t)))), 1)
    sums = np.add.reduceat(e**2, np.arange(0, len(e), width))
    at = min(int(np.argmax(sums)) * width + width // 2, len(e) - 1)
    return float(problem.t[at] + problem.time_origin)


def gains(problem: FitProblem, full: FittedLaw) -> float:
    """Of the viscous law alone: how many errors its damping ratio, if it could be negative, is above zero."""
    if full.p[ZETA:].any():
        return 0.0
    found = spread(problem, full.p, ("zeta",))
    return float(found.free[-1] / found.errors[-1]) if found.errors[-1] > 0 else 0.0


def remarks(
    record: Record, problem: FitProblem, laws: tuple[FittedLaw, ...], full: FittedLaw, spread: FitUncertainty
) -> tuple[str, ...]:
    """The sentences."""
    noise, rms, unit = problem.noise * problem.scale, spread.rms * problem.scale, record.unit
    rough, exact = spread.rms > ROUGH * problem.noise, spread.rms < 1e-9 * full.p[AMPLITUDE]
    if exact:
        return ()
    said, off, scatter = [], f"The fit is off by {rms:.3g} {unit} (rms)", f"samples scatter by {noise:.3g}"
    alone = "the noise is not independent from sample to sample"
    also = f"something else acts as well, or {alone}"
    share = spread.rms / problem.motion
    if rough and share > PART:
        e, _ = problem.off(full.p, full.terms)
        most = f"most of it about t = {record.format_time(time_of_largest_residuals(problem, full.p, e))} s"
        said.append(
            f"{off}, {100 * share:.1f} % of the motion, where the {scatter}: {also}, {most}; the intervals are "
            "widened, but where the law does not hold its values mean little."
        )
    elif rough and spread.alike:
        said.append(f"{off} where the {scatter}: {also}; the intervals are widened.")
    elif rough:
        said.append(f"{off} where neighbouring {scatter}: look at the time stamps.")
    elif spread.alike:
        said.append(
            f"Neighbouring residuals are alike (correlation {spread.rho:.2f}): {alone}; the intervals are widened."
        )
    drift = drift_remark(record, problem, full) if spread.alike and not problem.drift else ""
    alike = rounding_remark(problem, full, unit)
    return (*said, *([drift] if drift else []), *alike, *ambiguity_remark(problem, laws))


def rounding_remark(problem: FitProblem, full: FittedLaw, unit: str) -> tuple[str, ...]:
    """A sentence where the steps of a sensor and the loss of a half swing keep time, so that its rounding is no noise:
    Rayleigh's test of where the turning points lie between two steps."""
    amplitudes, begins = problem.half_cycles(full.p)
    places = full.p[REST] + problem.model.side * amplitudes * (-1.0) ** np.arange(len(amplitudes))
    seen = (begins >= 0) & (begins <= problem.t[-1])
    amplitudes, places, step = amplitudes[seen], places[seen], problem.step
    if not step or problem.model.order or len(amplitudes) < LEAST_TURNS:
        return ()
    alike = abs(np.mean(np.exp(2j * np.pi * places * problem.scale / step)))
    if len(amplitudes) * alike**2 < KEEPS_TIME:
        return ()
    near = 2 / np.pi * np.arccos(1 - min(step / (problem.scale * amplitudes.mean()), 1.0))  # share of the time there
    return (
        f"The sensor rounds all turning points alike, for what a half swing loses keeps time with its steps of "
        f"{step:.3g} {unit}: the rest position may be off by some {step / 2 * near:.1g} {unit}, amplitudes as much.",
    )


def drift_remark(record: Record, problem: FitProblem, full: FittedLaw) -> str:
    """A sentence where the rest position would drift if it could."""
    free = replace(problem, drift=True)
    found = spread(free, full.p, full.terms)
    names = [UNKNOWNS[place] for place in found.unknowns]
    at = names.index("drift")
    p, squares = free.fit(full.p, full.terms)
    if not (abs(found.free[at]) > DRIFTS * found.errors[at] or squares < full.sum_of_squares / 2):
        return ""
    over = float(p[DRIFT] * (problem.t[-1] - problem.t[0]) * problem.scale)
    return f"The rest position drifts, by {over:.3g} {record.unit} over the record: --drift fits that as well."


def ambiguity_remark(problem: FitProblem, laws: tuple[FittedLaw, ...]) -> tuple[str, ...]:
    """Laws that this record cannot tell from the best one, and what would."""
    best, n = laws[0], len(problem.t)
    gains = [more(problem, law, best) for law in laws]
    rivals = [
        law
        for law, gain in zip(laws[1:], gains[1:], strict=True)
        if (gain < -HINTED if set(best.terms) < set(law.terms) else gain > 0 and law.bic - best.bic < CLEAR)
    ]
    if not rivals:
        return ()
    apart = max(abs(next(gain for law, gain in zip(laws, gains, strict=True) if law is rivals[0])), 1.0)
    factor = float(np.sqrt((CLEAR + np.log(n)) / apart))
    description = " and ".join(f"{law.description} ({law.bic - best.bic:+.1f})" for law in rivals)
    return (
        f"{description[0].upper()}{description[1:]} cannot be told from {best.description} at this noise: "
        f"a record with {factor:.1f} "
        f"times less noise, or {np.ceil(factor**2):.0f} times as many samples, or more and larger swings, would tell.",
    )


def compare_halves(
    problem: FitProblem, full: FittedLaw, estimates: tuple[Estimate, ...]
) -> tuple[tuple[Estimate, ...], tuple[str, ...]]:
    """Where the fit is rough: the law in the first and in the second half of the record; where they disagree by more
    than their errors that is told, and the intervals hold both."""
    _, begins = problem.half_cycles(full.p)
    cut = int(np.searchsorted(begins, problem.t[len(problem.t) // 2]))
    if cut >= len(begins) - 3:
        return estimates, ()
    early = problem.t <= begins[cut]
    found = []
    for count, keep in ((0, early), (cut, ~early)):
        if keep.sum() < FEWEST:
            return estimates, ()
        part, p = problem.turned(full.p, count)
        part = part.only(keep)
        p, _ = part.fit(p, full.terms, 15)
        found.append((p, spread(part, p, full.terms)))
    told, said = list(estimates), []
    for i, each in enumerate(estimates):
        if each.name not in ("omega", *full.terms):
            continue
        place = UNKNOWNS.index(each.name)
        size = sizes(problem)[place]
        at = int(np.flatnonzero(found[0][1].unknowns == place)[0])
        first, second = (float(p[place]) * size for p, _ in found)
        both = float(np.hypot(*(s.errors[at] * size for _, s in found)))
        if abs(first - second) > APART * both:
            low, high = min(each.low, first, second), max(each.high, first, second)
            told[i] = replace(each, error=max(each.error, abs(first - second) / 2), low=low, high=high)
            said.append(
                f"{each.text}, {each.name}: {first:.4g} in the first half of the record, {second:.4g} in the second."
            )
    return tuple(told), tuple(said)
