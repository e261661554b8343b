"""Model error of approximate friction laws, without integration error, against true stick and slip.

It quantifies published observations: with the magic formula the sled creeps instead of sticking, and its acceleration
is not symmetric.  The law sign has no model error: in the limit of small steps it is dry friction
(A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, 1988).
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from ...analyses.slip import upward_crossings
from ...references.certified_reference import CertifiedReference, ReferenceCase, compute_errors, load_reference
from ...running.embedded_model import EmbeddedModel
from ...running.solution import Solution

FINE = 16001  # points used to find peaks and slips
TOLERANCE = 1e-8


@dataclass(frozen=True)
class LawDeviation:
    """Deviation of a friction law from dry friction.

    Attributes
    ----------
    final, rms, largest
        Errors of the solution as in reference.Errors.
    creep
        Median speed in m/s while dry friction sticks.
    period
        Slip period in s.
    asymmetry
        Largest forward over largest backward acceleration; 1 for dry friction.
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


def compare_with_dry_friction(case: ReferenceCase, model: type) -> LawDeviation:
    """Compare the law of a case with dry friction; `model` is the class in the FMU."""
    assert case.dry_friction_reference is not None
    law_reference, dry_reference = load_reference(case.reference_source), load_reference(case.dry_friction_reference)
    deviation = compute_errors(Solution(law_reference.motion, None, 0), dry_reference)
    make_result = partial(
        LawDeviation, case.model, case.name, case.law, deviation.final, deviation.rms, deviation.largest
    )
    sticking = stuck_points(dry_reference)
    if not sticking.any():
        return make_result(None, None, None)
    creep = float(np.median(np.abs(law_reference.motion[sticking, 1])))
    if case.problem.has_dry_friction:
        return make_result(creep, float(np.mean(np.diff([t for t, mode in law_reference.modes if mode]))), None)
    times = np.linspace(0.0, case.problem.stop, FINE)
    run = EmbeddedModel.create(model, case.values, None, TOLERANCE)
    motion = run.compute_states(times.tolist())
    rates = case.problem.rates(1)
    a = [rates(t, y)[1] for t, y in zip(times.tolist(), motion, strict=True)]
    slips = upward_crossings(times, np.array(motion)[:, 1] - run.model.v_driver)
    return make_result(creep, float(np.mean(np.diff(slips))), max(a) / -min(a))


def stuck_points(truth: CertifiedReference) -> np.ndarray:
    """Return for each time (n,) of a reference whether the body is stuck."""
    starts, modes = zip(*truth.modes, strict=True)
    return np.array(modes)[np.searchsorted(starts, truth.times, side="right") - 1] == 0
