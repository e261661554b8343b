"""Identification of damping, dry friction and drag from the record of a decay.

1. Find the free decay within the record (window.py) and thin it (samples.py); locate and number its turning points
   (samples.py).
2. Estimate the losses from the energy lost per half cycle (law.py), then fit the numbered turning points.
3. Fit the law (law.py) to every sample of the free motion (signal_model.py, free_motion.py).
4. Fit and rank the seven laws (model_selection.py); the full law gives the uncertainty (intervals.py).
5. Test the residuals against time, phase, speed and direction (dependences.py).
6. Remark on what is doubtful and refuse what is not a free decay (remarks.py).

References
----------
Steps 2 and 4 follow J. W. Liang, B. F. Feeny, Nonlinear Dynamics 16 (1998), and Journal of Sound and Vibration 295
(2006).  The return map (law.py), from which the whole signal is interpolated, is not in these papers.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...errors import HarnessError, check_names, option_text
from ...records.motion import NO_UNIT, RATE_SUFFIXES, Motion
from ..estimation.estimate import Estimate
from .decay_problem import DecayProblem, FitError
from .estimates import (
    KnownParameters,
    estimate_from_extrema,
    estimate_from_two_peaks,
    force_estimates,
    make_estimates,
)
from .free_motion import select_free_motion
from .intervals import FitUncertainty, estimate_uncertainty
from .law import DRIFT, OMEGA, REST, TERMS, EnergyLoss, Terms, loss_fractions
from .model_selection import FittedLaw, fit_all_laws, select_reported_law
from .remarks import ambiguity_remark, check_fit, is_unreliable, make_remarks
from .samples import Extrema, block_size, estimate_noise, find_extrema, remove_spikes, thin
from .window import select_decay


@dataclass(frozen=True, repr=False)
class DecayIdentification:
    """The result of the identification of a decay.

    Attributes
    ----------
    record : Motion
        The record, without spikes.
    extrema : Extrema
        Its turning points.
    problem : DecayProblem
        Samples that are fitted, in the units of the fit.
    laws : tuple of FittedLaw
        Fitted laws, best first.
    uncertainty : FitUncertainty
        Uncertainty of the full law.
    estimates : tuple of Estimate
        Estimates from the whole signal.
    extrema_estimates : tuple of Estimate
        Estimates from all turning points.
    two_peak_estimates : tuple of Estimate
        Estimates from the first and the last turning point.
    unavailable : dict
        Reasons why the estimates from turning points are empty, by method; an empty text if they are not.
    remarks : tuple of str
        Sentences to read before relying on the values.
    """

    record: Motion
    extrema: Extrema
    problem: DecayProblem
    laws: tuple[FittedLaw, ...]
    uncertainty: FitUncertainty
    estimates: tuple[Estimate, ...]
    extrema_estimates: tuple[Estimate, ...]
    two_peak_estimates: tuple[Estimate, ...]
    unavailable: dict[str, str]
    remarks: tuple[str, ...]

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of a constant from the whole signal, as ``result["zeta"]``."""
        estimates = {estimate.name: estimate for estimate in self.estimates}
        check_names("estimate", [name], estimates)
        return estimates[name]

    @property
    def best(self) -> FittedLaw:
        return self.laws[0]

    @property
    def t(self) -> np.ndarray:
        """Times (n,) in s of the samples used."""
        return self.problem.t + self.problem.time_origin

    @property
    def x(self) -> np.ndarray:
        """Values (n,) of the samples used, in the record's unit."""
        return self.problem.x * self.problem.scale + self.problem.offset

    def signal(self, law: FittedLaw, t: np.ndarray) -> np.ndarray:
        """Return the signal (n,) of a law at the times t (n,) in s, in the record's unit."""
        x, _ = self.problem.model(law.p, self.problem.unknowns(law.terms), t - self.problem.time_origin)
        return x * self.problem.scale + self.problem.offset

    def rest(self, law: FittedLaw, t: np.ndarray) -> np.ndarray:
        """Return the rest position (n,) at the times t (n,) in s, in the record's unit."""
        problem = self.problem
        drift = law.p[DRIFT] * (t - problem.time_origin - problem.model.t_mid)
        return (law.p[REST] + drift) * problem.scale + problem.offset

    @cached_property
    def fit_values(self) -> np.ndarray:
        """Values (n,) of the best law for the samples used, in the record's unit."""
        return self.signal(self.best, self.t)

    @cached_property
    def energy_loss(self) -> EnergyLoss:
        """Energy lost between the turning points of the record, and by each law fitted to it."""
        problem = self.problem
        points = np.zeros((2, 0))
        if not self.record.order:
            displacement = self.extrema.x - self.rest(self.best, self.extrema.t)
            sign = np.sign(displacement[0]) * (-1.0) ** np.arange(len(displacement))
            points = np.array(loss_fractions(sign * displacement, problem.model.is_pendulum))
        curves = {}
        for law in self.laws:
            amplitudes, starts = problem.half_cycles(law.p)
            during_record = amplitudes[starts <= problem.t[-1]] * problem.scale
            curves[law.terms] = loss_fractions(during_record, problem.model.is_pendulum)
        return EnergyLoss(points[0], points[1], curves)

    @property
    def rms(self) -> float:
        """Root mean square of the residuals of the best law, in the record's unit."""
        return float(np.sqrt(self.best.sum_of_squares / len(self.problem.t))) * self.problem.scale

    @property
    def sentence(self) -> str:
        """The selected law, and by how much it is better than the others."""
        if (
            not any(estimate.low > 0 for estimate in self.estimates if estimate.name in TERMS)
            and not self.best.p[5:].any()
        ):
            return "No loss stands out of the noise; the intervals give upper limits."
        others = [f"{law.description} {law.bic - self.best.bic:+.1f}" for law in self.laws[1:]]
        rest = f"; {', '.join(others)})" if others else ")"
        return f"Best described by {self.best.description} (BIC {self.best.bic:.1f}{rest}."


def fit_decay(
    record: Motion,
    parameters: KnownParameters,
    drag: bool = True,
    drift: bool = False,
    report: Callable[[float], None] = lambda share: None,
) -> DecayIdentification:
    """Identify damping and friction from the record of a decay.

    Parameters
    ----------
    parameters : KnownParameters
        Stiffness or mass, and whether the oscillator is a pendulum.
    drag : bool
        Whether to try laws with quadratic drag.
    drift : bool
        Whether to fit a constant drift of the rest position.
    report : callable
        Receives the progress from 0 to 1.

    Raises
    ------
    HarnessError
        If there is no decay, or no law fits; the message says what to do if that is known.
    """
    try:
        return identify_record(record, parameters, drag, drift, report)
    except HarnessError as error:
        without_spikes = remove_spikes(record)
        if without_spikes is not record:
            with suppress(HarnessError):
                return identify_record(without_spikes, parameters, drag, drift, report)
        message = str(error)
        if isinstance(error, FitError):
            advice = error.advice
            if parameters.pendulum and record.order == 2:
                advice = (
                    "beyond 90 degrees the angular acceleration of a pendulum has two peaks per half cycle: record the "
                    f"angle or the angular velocity, or leave out the large amplitudes with {option_text('begin')}"
                )
            elif not drift:
                advice += f", or add {option_text('drift', True)} if the rest position drifts"
            message = f"{record.name} {error}; {advice}"
        if record.notes:  # what was assumed in reading may be wrong
            message += f". {record.notes[0].removesuffix('.')}"
        raise HarnessError(message) from None


def identify_record(
    record: Motion, parameters: KnownParameters, drag: bool, drift: bool, report: Callable[[float], None]
) -> DecayIdentification:
    """Identify a decay as `fit_decay` does, without its attempts to recover; FitError if no law fits."""
    if parameters.pendulum and record.base != "rad":
        raise HarnessError(
            f"{option_text('pendulum', True)} needs an angle or an angular velocity, and {record.name} is in "
            f"{record.unit} (an accelerometer on a pendulum also measures gravity): set {option_text('unit')} to rad, "
            f"deg, rad/s or deg/s, or leave out {option_text('pendulum')}"
        )
    terms: Terms = TERMS if drag else ("zeta", "r")
    full_decay, half_period, choices = select_decay(record, parameters.pendulum)
    _, quantiser_step = estimate_noise(full_decay.t, full_decay.x)
    decay, block = full_decay, block_size(full_decay, half_period)
    if block > 1:
        note = f"The {len(decay.t)} samples of the decay are averaged over {block} each."
        record = thin(record, block)
        decay = replace(record.select(decay.t[0], decay.t[-1]), notes=(*decay.notes, note))
    extrema = find_extrema(decay, half_period, quantiser_step, parameters.pendulum)
    report(0.1)
    free_motion = select_free_motion(decay, extrema, terms, parameters.pendulum, drift)
    problem, extrema = free_motion.problem, free_motion.extrema
    report(0.5)
    amplitudes = np.abs(extrema.x - extrema.rest_positions(drift)) / problem.scale
    fit = free_motion.p, free_motion.sum_of_squares
    laws = fit_all_laws(problem, fit, terms, amplitudes, lambda share: report(0.5 + 0.4 * share))
    full = next(law for law in laws if law.terms == terms)
    uncertainty = estimate_uncertainty(problem, full.p, terms, choices)
    check_fit(record, problem, full, uncertainty, parameters.pendulum)
    reported_law = select_reported_law(laws, full, problem)
    by_unknown = make_estimates(record, problem, reported_law, full, uncertainty)
    remarks = [*make_remarks(record, problem, full, uncertainty)]
    estimates = tuple(by_unknown.values())
    if is_unreliable(problem, uncertainty):
        estimates = tuple(replace(estimate, error=np.nan, low=np.nan, high=np.nan) for estimate in estimates)
    by_unknown = dict(zip(by_unknown, estimates, strict=True))
    omega = by_unknown[OMEGA]
    estimates += force_estimates(record, omega, by_unknown, parameters)
    if record.base not in ("m", "rad", NO_UNIT) and (parameters.k or parameters.m):
        size = option_text("unit", f"0.5mm{RATE_SUFFIXES[record.order]}")
        remarks.append(
            f"The forces f, c and q need a motion in a unit of length or angle, and that of {record.name} is in "
            f"{record.unit}: they are left out; convert it, as by {size}."
        )
    remarks += [*free_motion.notes, *decay.notes, *ambiguity_remark(problem, laws)]
    by_extrema, no_extrema = estimate_from_extrema(record, problem, extrema, laws[0], parameters, omega)
    by_two_peaks, no_peaks = estimate_from_two_peaks(record, problem, extrema, laws[0], parameters, omega)
    unavailable = {"turning points": no_extrema, "two peaks": no_peaks}
    return DecayIdentification(
        record,
        extrema,
        problem,
        laws,
        uncertainty,
        estimates,
        by_extrema,
        by_two_peaks,
        unavailable,
        tuple(remarks),
    )
