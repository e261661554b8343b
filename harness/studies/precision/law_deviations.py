"""Model error: what a shortcut law costs even when it is integrated without error, beside true stick and slip.

Published remarks become numbers here: with the magic formula the sled creeps while it should stick, and its
acceleration is no longer symmetric.  The law sign has no error of its own: integrated ever more finely it tends to
dry friction itself (A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, 1988).
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from ...analyses.slip import upward_crossings
from ...references.certified_reference import CertifiedReference, ReferenceCase, compute_errors, load_reference
from ...running.embedded_model import EmbeddedModel
from ...running.solution import Solution

FINE = 16001  # points among which peaks and slips are looked for
TOLERANCE = 1e-8


@dataclass(frozen=True)
class LawDeviation:
    """One law beside dry friction: the errors of its true solution, as in reference.Errors; where dry friction holds
    the sled, the median speed `creep` in m/s; the slip `period` in s; and `asymmetry`, the largest forward over the
    largest backward acceleration, which is 1 for dry friction.  None for what does not occur or is not in question."""

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
    """The law of a case beside dry friction; `model` is the class inside the FMU."""
    assert case.dry_friction_reference is not None
    truth, dry = load_reference(case.reference_source), load_reference(case.dry_friction_reference)
    off = compute_errors(Solution(truth.motion, None, 0), dry)
    law = partial(LawDeviation, case.model, case.name, case.law, off.final, off.rms, off.largest)
    held = stuck_points(dry)
    if not held.any():
        return law(None, None, None)
    creep = float(np.median(np.abs(truth.motion[held, 1])))
    if case.problem.has_dry_friction:
        return law(creep, float(np.mean(np.diff([t for t, mode in truth.modes if mode]))), None)
    times = np.linspace(0.0, case.problem.stop, FINE)
    run = EmbeddedModel.create(model, case.values, None, TOLERANCE)
    motion = run.compute_states(times.tolist())
    rates = case.problem.rates(1)
    a = [rates(t, y)[1] for t, y in zip(times.tolist(), motion, strict=True)]
    slips = upward_crossings(times, np.array(motion)[:, 1] - run.model.v_driver)
    return law(creep, float(np.mean(np.diff(slips))), max(a) / -min(a))


def stuck_points(truth: CertifiedReference) -> np.ndarray:
    """Which of the common points (n,) find the body stuck."""
    starts, modes = zip(*truth.modes, strict=True)
    return np.array(modes)[np.searchsorted(starts, truth.times, side="right") - 1] == 0
