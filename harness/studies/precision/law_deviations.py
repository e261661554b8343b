"""Model error of approximate friction laws against true stick and slip, beside the integration error within each law.

It quantifies published observations: with the magic formula the sled creeps instead of sticking, and its acceleration
is not symmetric; bristles creep, too.  The law sign has no model error: in the limit of small steps it is dry friction
(A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, 1988).

Bristles and a block that sticks are compared in one scene, as by D. A. Haessig and B. Friedland, On the modeling and
simulation of friction, J. Dyn. Syst. Meas. Control 113 (1991) 354-362.
"""

from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from ...analyses.slip import upward_crossings
from ...references import peer_solvers
from ...references.certified_reference import POINTS, ReferenceCase, compute_errors, load_reference
from ...references.ode_problem import OdeProblem, RhsFunction
from ...simulation.embedded_model import EmbeddedModel
from ...simulation.solution import Solution

FINE = 16001  # points used to find peaks and slips
TOLERANCE = 1e-8
CHATTERING_METHOD = "ode45"  # the closed form covers the hybrid law only
BRISTLES = {"lugre": "LuGre", "elastoplastic": "elasto-plastic"}  # models of fmus/more and their laws


class DryBlock(OdeProblem):
    """The mass of the models with bristles, pulled through a spring, with Coulomb and viscous friction that sticks."""

    start, stop, has_dry_friction = (0.0, 0.0), 20.0, True
    k, v_driver, F_c, F_s, sigma_2 = 2.0, 0.1, 1.0, 1.5, 0.4

    def rates(self, mode: int) -> RhsFunction:
        k, speed, sliding, damping = self.k, self.v_driver, mode * self.F_c, self.sigma_2
        return lambda t, y: (y[1], k * (speed * t - y[0]) - sliding - damping * y[1])

    def static_load(self, t: float, x: float) -> tuple[float, float, float]:
        return self.k * (self.v_driver * t - x), self.k * self.v_driver, self.F_s


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


def compare_with_dry_friction(case: ReferenceCase, model: type) -> LawDeviation:
    """Compare the law of a case with dry friction; `model` is the class in the FMU."""
    assert case.dry_friction_reference is not None
    law_reference, dry_reference = load_reference(case.reference_source), load_reference(case.dry_friction_reference)
    deviation = compute_errors(replace(law_reference, events=None), dry_reference)
    method = CHATTERING_METHOD if case.is_chattering else None
    own_run = EmbeddedModel.create(model, case.run.values, method, 0.0).solve(law_reference.times.tolist())
    make_result = partial(
        LawDeviation,
        case.model,
        case.name,
        case.law,
        deviation.final,
        deviation.rms,
        deviation.largest,
        integration=compute_errors(own_run, law_reference).largest,
    )
    sticking = stuck_points(dry_reference)
    if not sticking.any():
        return make_result(None, None, None)
    creep = float(np.median(np.abs(law_reference.states[sticking, 1])))
    if case.problem.has_dry_friction:
        return make_result(creep, float(np.mean(np.diff([t for t, mode in law_reference.modes if mode]))), None)
    times = np.linspace(0.0, case.problem.stop, FINE)
    run = EmbeddedModel.create(model, case.run.values, None, TOLERANCE)
    motion = run.compute_states(times.tolist())
    rates = case.problem.rates(1)
    a = [rates(t, y)[1] for t, y in zip(times.tolist(), motion, strict=True)]
    slips = upward_crossings(times, np.array(motion)[:, 1] - run.model.v_driver)
    return make_result(creep, float(np.mean(np.diff(slips))), max(a) / -min(a))


def compare_bristles(name: str, law: str, model: type) -> LawDeviation:
    """Compare a model of fmus/more with bristles, in its default run, with a block that sticks."""
    reference, dry = load_reference(f"more/{name}"), solve_dry_block()
    bristles = replace(reference, states=reference.states[:, :2], events=None)
    deviation = compute_errors(bristles, dry)
    own_run = EmbeddedModel.create(model, {}, None, 0.0).solve(reference.times.tolist())
    times = np.linspace(0.0, float(reference.times[-1]), FINE)
    fine_run = EmbeddedModel.create(model, {}, None, TOLERANCE)
    motion = np.array(fine_run.compute_states(times.tolist()))
    slips = upward_crossings(times, motion[:, 1] - fine_run.model.v_driver)
    return LawDeviation(
        name,
        name,
        law,
        deviation.final,
        deviation.rms,
        deviation.largest,
        creep=float(np.median(np.abs(bristles.states[stuck_points(dry), 1]))),
        period=float(np.mean(np.diff(slips))),
        asymmetry=None,
        integration=compute_errors(own_run, reference).largest,
    )


@cache
def solve_dry_block() -> Solution:
    """Return the motion of the block that sticks, in the default run of the models with bristles."""
    solution = peer_solvers.solve("scipy", "DOP853", DryBlock(), np.linspace(0.0, DryBlock.stop, POINTS), 3e-14, 1e-17)
    return replace(solution, start_mode=0)


def stuck_points(truth: Solution) -> np.ndarray:
    """Return for each time (n,) of a reference whether the body is stuck."""
    starts, modes = zip(*truth.modes, strict=True)
    return np.array(modes)[np.searchsorted(starts, truth.times, side="right") - 1] == 0
