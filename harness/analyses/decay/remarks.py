"""Remarks on the reliability of a fit, and the refusal of records that are not free decays."""

import numpy as np

from ...errors import command_text, option_text
from ...records.motion import Motion
from . import thresholds
from .decay_problem import DecayProblem, FitError
from .dependences import CAUSES
from .intervals import FitUncertainty
from .law import AMPLITUDE, OMEGA, REST
from .model_selection import FittedLaw, deviance_difference

WIDENING_NOTE = "The intervals are widened."


def check_fit(
    record: Motion, problem: DecayProblem, full: FittedLaw, uncertainty: FitUncertainty, pendulum: bool
) -> None:
    """Raise FitError if the best fit leaves large residuals, or gains energy."""
    if uncertainty.distance_from_losses > thresholds.SIGNIFICANT_GAIN:
        advice = f"fit a model with its drive by {command_text('fit')}"
        raise FitError("has swings that no loss describes, so it is driven or gains energy", advice)
    e, _ = problem.residuals(full.p, full.terms)
    share = uncertainty.rms / problem.signal_rms
    if share > thresholds.NOT_A_DECAY and uncertainty.rms > thresholds.NOT_NOISE * problem.noise:
        advice = (
            f"cut the record there with {option_text('begin')} or {option_text('end')}, or use "
            f"{command_text('fit', 'stickslip')} for a driven motion"
        )
        if record.base == "rad" and not pendulum:
            advice = f"add {option_text('pendulum', True)} if it is a pendulum, or " + advice
        raise FitError(
            f"is not a free decay of one oscillator: the residuals of the best fit are {100 * min(share, 1.0):.0f} % "
            f"of the motion and largest near t = {record.format_time(time_of_largest_residuals(problem, full.p, e))} s",
            advice,
        )


def is_unreliable(problem: DecayProblem, uncertainty: FitUncertainty) -> bool:
    """Return whether the residuals are so large that no interval of the law means anything."""
    share = uncertainty.rms / problem.signal_rms
    return uncertainty.rms > thresholds.ROUGH * problem.noise and share > thresholds.UNRELIABLE


def time_of_largest_residuals(problem: DecayProblem, p: np.ndarray, e: np.ndarray) -> float:
    """Return the time in s of the half cycle with the largest residuals e (n,)."""
    width = max(int(np.pi / p[OMEGA] / float(np.median(np.diff(problem.t)))), 1)
    sums = np.add.reduceat(e**2, np.arange(0, len(e), width))
    at = min(int(np.argmax(sums)) * width + width // 2, len(e) - 1)
    return float(problem.t[at] + problem.time_origin)


def make_remarks(
    record: Motion, problem: DecayProblem, full: FittedLaw, uncertainty: FitUncertainty
) -> tuple[str, ...]:
    """Return remarks on residuals, departures and rounding, those with the largest effect first."""
    noise, rms, unit = problem.noise * problem.scale, uncertainty.rms * problem.scale, record.unit
    if uncertainty.rms < thresholds.EXACT * full.p[AMPLITUDE]:
        return ()
    is_rough = uncertainty.rms > thresholds.ROUGH * problem.noise
    remarks = []
    cause = "the noise is not independent from sample to sample"
    if is_rough:
        share = uncertainty.rms / problem.signal_rms
        e, _ = problem.residuals(full.p, full.terms)
        if is_unreliable(problem, uncertainty):
            advice = "Do not rely on these values."
        else:
            advice = WIDENING_NOTE if uncertainty.is_correlated else "Check the time stamps."
        remarks.append(
            f"The residuals of the fit are {rms:.3g} {unit} (rms), {100 * share:.2g} % of the "
            f"motion, and largest near t = {record.format_time(time_of_largest_residuals(problem, full.p, e))} s, "
            f"while the noise of the samples is {noise:.3g} {unit}: something else acts on the oscillator too, or "
            f"{cause}. {advice}"
        )
        if problem.noise < thresholds.NOISELESS * full.p[AMPLITUDE]:
            remarks[0] += (
                " If a solver wrote the record, its errors change the losses like this: simulate with a smaller "
                "tolerance."
            )
    elif uncertainty.is_correlated:
        remarks.append(
            f"Neighbouring residuals are correlated ({uncertainty.neighbour_correlation:.2f}): {cause}. {WIDENING_NOTE}"
        )
    effect_remarks = dependences_remark(problem, uncertainty.dependences.sizes, unit)
    if not effect_remarks and (distance := uncertainty.distance_from_losses) > thresholds.NEGATIVE:
        effect_remarks = [
            f"A loss below zero would fit better, by {distance:.1f} standard errors, as with an amplitude that "
            f"wanders. {WIDENING_NOTE}"
        ]
    return (*remarks, *effect_remarks, *rounding_remark(problem, full, unit))


def dependences_remark(problem: DecayProblem, sizes: dict[str, float], unit: str) -> list[str]:
    """Return a remark on what the residuals depend."""
    if not sizes:
        return []
    parts = " or ".join(f"in {name} by {size * problem.scale:.1g} {unit}" for name, size in sizes.items())
    remedy = f" {option_text('drift', True)} fits a constant drift." if "rest" in sizes and not problem.drift else ""
    if "speed" in sizes:
        remedy += (
            f" No law of decay has friction that rises: fit a model with Stribeck friction by {command_text('fit')}."
        )
    return [
        f"The record departs from the law, {parts} (rms), as with {' or '.join(CAUSES[name] for name in sizes)}. "
        f"{WIDENING_NOTE}{remedy}"
    ]


def rounding_remark(problem: DecayProblem, full: FittedLaw, unit: str) -> tuple[str, ...]:
    """Return a remark if the sensor rounds all turning points alike, so that its rounding errors are not noise.

    This happens if the loss of amplitude per cycle is close to a multiple of the quantiser step.  Rayleigh's test
    is applied to the positions of the turning points between two steps.
    """
    amplitudes, starts = problem.half_cycles(full.p)
    positions = full.p[REST] + problem.model.initial_sign * amplitudes * (-1.0) ** np.arange(len(amplitudes))
    is_recorded = (starts >= 0) & (starts <= problem.t[-1])
    amplitudes, positions, step = amplitudes[is_recorded], positions[is_recorded], problem.quantiser_step
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


def ambiguity_remark(problem: DecayProblem, laws: tuple[FittedLaw, ...]) -> tuple[str, ...]:
    """Return remarks on the laws that noise, or a small part of the motion, does not distinguish from the best one."""
    best, n = laws[0], len(problem.t)
    rivals, similar = [], []
    for law in laws[1:]:
        difference, is_larger = deviance_difference(problem, law, best), set(best.terms) < set(law.terms)
        excess = law.sum_of_squares - best.sum_of_squares
        size = np.sqrt(max(excess, 0.0) / n) / problem.signal_rms
        if is_larger:
            is_rival = difference < -thresholds.SIGNIFICANT_DEVIANCE
        else:
            is_rival = difference > 0 and law.bic - best.bic < thresholds.CLEAR_BIC
        if is_rival:
            rivals.append((f"{law.description} ({law.bic - best.bic:+.1f})", difference))
        elif not is_larger and 0 < excess < best.sum_of_squares and size < thresholds.SIMILAR:
            similar.append(f"{law.description} ({100 * size:.1g} %)")
    remarks = []
    if rivals:
        factor = float(np.sqrt((thresholds.CLEAR_BIC + np.log(n)) / max(abs(rivals[0][1]), 1.0)))
        names = " and ".join(name for name, _ in rivals)
        remarks.append(
            f"{names[0].upper()}{names[1:]} cannot be distinguished from {best.description} at this noise: that takes "
            f"{factor:.1f} times less noise, {np.ceil(factor**2):.0f} times as many samples, or more and larger cycles."
        )
    if similar:
        remarks.append(
            f"The best law differs from {' and from '.join(similar)} by less than {100 * thresholds.SIMILAR:g} % of "
            "the motion: a sensor or a loss that departs from its law by as much makes one look like the other."
        )
    return tuple(remarks)
