"""Remarks on the reliability of a fit, and the refusal of records that are not free decays."""

from dataclasses import replace

import numpy as np

from ...errors import command_text, option_text
from ...records.motion import Motion
from ..estimation.estimate import Estimate
from . import thresholds
from .decay_problem import DecayProblem, FitError
from .estimates import unit_scales
from .intervals import FitUncertainty, estimate_uncertainty
from .law import AMPLITUDE, DRIFT, OMEGA, REST, UNKNOWNS
from .low_speed_friction import LowSpeedRise
from .model_selection import FittedLaw, deviance_difference


def check_fit(
    record: Motion, problem: DecayProblem, full: FittedLaw, uncertainty: FitUncertainty, pendulum: bool
) -> None:
    """Raise FitError if the best fit leaves large residuals, or gains energy."""
    e, _ = problem.residuals(full.p, full.terms)
    share = uncertainty.rms / problem.signal_rms
    if share > thresholds.NOT_A_DECAY and uncertainty.rms > thresholds.NOT_NOISE * problem.noise:
        advice = f"cut the record there with {option_text('begin')} or {option_text('end')}"
        if record.base == "rad" and not pendulum:
            advice = f"add {option_text('pendulum', True)} if it is a pendulum, or " + advice
        raise FitError(
            f"is not a free decay of one oscillator: the residuals of the best fit are {100 * min(share, 1.0):.0f} % "
            f"of the motion and largest near t = {record.format_time(time_of_largest_residuals(problem, full.p, e))} s",
            advice,
        )
    if uncertainty.distance_from_losses > thresholds.SIGNIFICANT_GAIN:
        advice = f"fit a model with its drive by {command_text('fit')}"
        raise FitError("has swings that no loss describes, so it is driven or gains energy", advice)


def time_of_largest_residuals(problem: DecayProblem, p: np.ndarray, e: np.ndarray) -> float:
    """Return the time in s of the half cycle with the largest residuals e (n,)."""
    width = max(int(np.pi / p[OMEGA] / float(np.median(np.diff(problem.t)))), 1)
    sums = np.add.reduceat(e**2, np.arange(0, len(e), width))
    at = min(int(np.argmax(sums)) * width + width // 2, len(e) - 1)
    return float(problem.t[at] + problem.time_origin)


def make_remarks(
    record: Motion, problem: DecayProblem, laws: tuple[FittedLaw, ...], full: FittedLaw, uncertainty: FitUncertainty
) -> tuple[str, ...]:
    """Return remarks on residuals, drift, rounding and undecided laws."""
    noise, rms, unit = problem.noise * problem.scale, uncertainty.rms * problem.scale, record.unit
    if uncertainty.rms < thresholds.EXACT * full.p[AMPLITUDE]:
        return ()
    is_rough = uncertainty.rms > thresholds.ROUGH * problem.noise
    remarks, residuals = [], f"The residuals of the fit are {rms:.3g} {unit} (rms)"
    noise_level = f"the noise of the samples is {noise:.3g} {unit}"
    correlated = "the noise is not independent from sample to sample"
    disturbed = f"something else acts on the oscillator too, or {correlated}"
    share = uncertainty.rms / problem.signal_rms
    if is_rough and share > thresholds.WARNED:
        e, _ = problem.residuals(full.p, full.terms)
        remarks.append(
            f"{residuals}, {100 * share:.1f} % of the motion, and largest near "
            f"t = {record.format_time(time_of_largest_residuals(problem, full.p, e))} s, while {noise_level}: "
            f"{disturbed}. The intervals are widened. If the model does not fit this record, do not rely on these "
            "values."
        )
    elif is_rough and uncertainty.is_correlated:
        remarks.append(f"{residuals}, while {noise_level}: {disturbed}. The intervals are widened.")
    elif is_rough:
        remarks.append(f"{residuals}, while {noise_level}: check the time stamps.")
    elif uncertainty.is_correlated:
        remarks.append(
            f"Neighbouring residuals are correlated ({uncertainty.neighbour_correlation:.2f}): {correlated}. "
            "The intervals are widened."
        )
    remarks += wander_remark(uncertainty)
    drift = drift_remark(record, problem, full) if uncertainty.is_correlated and not problem.drift else ""
    rounding = rounding_remark(problem, full, unit)
    return (*remarks, *([drift] if drift else []), *rounding, *ambiguity_remark(problem, laws))


def wander_remark(uncertainty: FitUncertainty) -> list[str]:
    """Return a remark on slow departures of phase and amplitude from the law."""
    phase, amplitude = uncertainty.wander.phase, uncertainty.wander.amplitude
    sizes = [f"the phase by {phase:.1g} rad"] * (phase > 0) + [f"the amplitude by {100 * amplitude:.1g} %"] * (
        amplitude > 0
    )
    causes = ["a clock whose rate varies"] * (phase > 0) + ["a loss that follows another law"] * (amplitude > 0)
    if not sizes:
        return []
    return [
        f"The record departs slowly from the law, {' or '.join(sizes)} (rms), as with {' or '.join(causes)}. The "
        "intervals are widened."
    ]


def rounding_remark(problem: DecayProblem, full: FittedLaw, unit: str) -> tuple[str, ...]:
    """Return a remark if the sensor rounds all turning points alike, so that its rounding errors are not noise.

    This happens if the loss of amplitude per cycle is close to a multiple of the quantiser step.  Rayleigh's test
    is applied to the positions of the turning points between two steps.
    """
    amplitudes, starts = problem.half_cycles(full.p)
    positions = full.p[REST] + problem.model.initial_sign * amplitudes * (-1.0) ** np.arange(len(amplitudes))
    recorded = (starts >= 0) & (starts <= problem.t[-1])
    amplitudes, positions, step = amplitudes[recorded], positions[recorded], problem.quantiser_step
    if not step or problem.model.order or len(amplitudes) < thresholds.MIN_ROUNDED:
        return ()
    resultant = abs(np.mean(np.exp(2j * np.pi * positions * problem.scale / step)))
    if len(amplitudes) * resultant**2 < thresholds.RAYLEIGH_LIMIT:
        return ()
    # fraction of the time within a step of a turning point
    near = 2 / np.pi * np.arccos(1 - min(step / (problem.scale * amplitudes.mean()), 1.0))
    return (
        f"The sensor rounds all turning points alike, because the amplitude falls by nearly a multiple of its steps of "
        f"{step:.3g} {unit} per cycle: rest position and amplitudes may be off by about "
        f"{step / 2 * near:.1g} {unit}.",
    )


def drift_remark(record: Motion, problem: DecayProblem, full: FittedLaw) -> str:
    """Return a remark if a fit with a drift of the rest position is significantly better; empty if not."""
    with_drift = replace(problem, drift=True)
    uncertainty = estimate_uncertainty(with_drift, full.p, full.terms)
    names = [UNKNOWNS[unknown] for unknown in uncertainty.unknowns]
    at = names.index("drift")
    p, squares = with_drift.fit(full.p, full.terms)
    is_significant = abs(uncertainty.unconstrained[at]) > thresholds.SIGNIFICANT_DRIFT * uncertainty.standard_errors[at]
    if not (is_significant or squares < thresholds.BETTER_WITH_DRIFT * full.sum_of_squares):
        return ""
    total = float(p[DRIFT] * (problem.t[-1] - problem.t[0]) * problem.scale)
    remedy = f"{option_text('drift', True)} fits the drift as well."
    return f"The rest position drifts by {total:.3g} {record.unit} over the record: {remedy}"


def ambiguity_remark(problem: DecayProblem, laws: tuple[FittedLaw, ...]) -> tuple[str, ...]:
    """Return a remark on the laws that this record cannot distinguish from the best one, and on a record that would."""
    best, n = laws[0], len(problem.t)
    differences = [deviance_difference(problem, law, best) for law in laws]
    rivals = [
        (law, difference)
        for law, difference in zip(laws[1:], differences[1:], strict=True)
        if (
            difference < -thresholds.SIGNIFICANT_DEVIANCE
            if set(best.terms) < set(law.terms)
            else difference > 0 and law.bic - best.bic < thresholds.CLEAR_BIC
        )
    ]
    if not rivals:
        return ()
    factor = float(np.sqrt((thresholds.CLEAR_BIC + np.log(n)) / max(abs(rivals[0][1]), 1.0)))
    names = " and ".join(f"{law.description} ({law.bic - best.bic:+.1f})" for law, _ in rivals)
    return (
        f"{names[0].upper()}{names[1:]} cannot be distinguished from {best.description} at this noise: that takes "
        f"{factor:.1f} times less noise, {np.ceil(factor**2):.0f} times as many samples, or more and larger cycles.",
    )


def rise_remark(record: Motion, rise: LowSpeedRise) -> str:
    """Return the remark on friction that rises at low speed."""
    return (
        f"Friction that rises at low speed fits better: it is {rise.size:.2g} {record.base} (over stiffness) larger at "
        f"standstill than the {rise.losses['r']:.2g} {record.base} above about {rise.speed:g} of the first peak speed. "
        "No law of decay has such a rise. The intervals of the losses are widened, and may still miss the true values: "
        f"fit a model with Stribeck friction by {command_text('fit')}."
    )


def compare_halves(
    problem: DecayProblem, full: FittedLaw, estimates: tuple[Estimate, ...]
) -> tuple[tuple[Estimate, ...], tuple[str, ...]]:
    """Compare fits of the law to the two halves of the record.

    Returns
    -------
    estimates : tuple of Estimate
        The estimates; where the halves disagree significantly, the interval holds the values of both.
    remarks : tuple of str
        A remark on each quantity in which the halves disagree.
    """
    _, starts = problem.half_cycles(full.p)
    cut = int(np.searchsorted(starts, problem.t[len(problem.t) // 2]))
    if cut >= len(starts) - 3:
        return estimates, ()
    early = problem.t <= starts[cut]
    fits = []
    for count, keep in ((0, early), (cut, ~early)):
        if keep.sum() < thresholds.MIN_HALF_SAMPLES:
            return estimates, ()
        half, p = problem.skip_half_cycles(full.p, count)
        half = half.subset(keep)
        p, _ = half.fit(p, full.terms, 15)
        fits.append((p, estimate_uncertainty(half, p, full.terms)))
    widened, remarks = list(estimates), []
    for i, estimate in enumerate(estimates):
        if estimate.name not in ("omega", *full.terms):
            continue
        unknown = UNKNOWNS.index(estimate.name)
        scale = unit_scales(problem)[unknown]
        at = int(np.flatnonzero(fits[0][1].unknowns == unknown)[0])
        first, second = (float(p[unknown]) * scale for p, _ in fits)
        error = float(np.hypot(*(uncertainty.standard_errors[at] * scale for _, uncertainty in fits)))
        if abs(first - second) > thresholds.DISAGREEMENT * error:
            widened[i] = estimate.widen(abs(first - second) / 2, first, second)
            remarks.append(
                f"{estimate.text}, {estimate.name}: {first:.4g} in the first half of the record, "
                f"{second:.4g} in the second."
            )
    return tuple(widened), tuple(remarks)


def compare_swings(
    estimates: tuple[Estimate, ...], from_swings: tuple[Estimate, ...], departure: float
) -> tuple[tuple[Estimate, ...], tuple[str, ...]]:
    """Compare the estimates from the whole signal with those from the swings.

    Parameters
    ----------
    estimates, from_swings : tuple of Estimate
        Estimates from the whole signal, and of the losses from the swings.
    departure : float
        Fraction by which the loss of the half cycles departs from the law, or 0.

    Returns
    -------
    estimates : tuple of Estimate
        The estimates; where both disagree, or the loss departs from the law, the interval covers both.
    remarks : tuple of str
        A remark on the departure, or on each quantity in which both disagree.
    """
    remarks = []
    by_name = {estimate.name: estimate for estimate in from_swings}
    widened = list(estimates)
    if departure:
        remarks.append(
            f"The loss per half cycle departs from every law by {100 * departure:.0f} %, which is no noise: the "
            "intervals of the losses cover this departure, and the estimates from the swings."
        )
    for i, estimate in enumerate(widened):
        other = by_name.get(estimate.name)
        if other is None:
            continue
        differs = abs(estimate.value - other.value) > thresholds.SWING_DISAGREEMENT * np.hypot(
            estimate.error, other.error
        )
        if not (departure or differs):
            continue
        widened[i] = estimate.widen(other.error, other.low, other.high)
        if differs:
            remarks.append(
                f"{estimate.text}, {estimate.name}: {estimate.value:.4g} from the whole signal, {other.value:.4g} "
                "from the swings alone; the interval covers both."
            )
    return tuple(widened), tuple(remarks)
