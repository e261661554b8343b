"""Reference of a coupled scene: a single model of the same bodies, without communication steps.

    m_i a_i = F_i + k_i (v_driver_i t - x_i) - c_i v_i - F_friction_i,    F_i = sum of factor * output of a body

Each body sticks, or slides forward or backward; the integration restarts at every change of mode.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from ..errors import HarnessError
from ..scenes.coupled.scene import CoupledScene
from .models import MODEL_MODULES

RTOL, ATOL = 1e-11, 1e-14
MAX_EVENTS = 10_000


@dataclass(frozen=True)
class CoupledBodies:
    """n coupled bodies.

    Attributes
    ----------
    m, k, c, hold, slide, driver : numpy.ndarray
        Mass, stiffness, damping, static and sliding friction, and driver velocity (n,) of each body.
    couplings : tuple of (int, int, str, float)
        Sink, source, output and factor of each coupling.
    """

    m: np.ndarray
    k: np.ndarray
    c: np.ndarray
    hold: np.ndarray
    slide: np.ndarray
    driver: np.ndarray
    couplings: tuple[tuple[int, int, str, float], ...]

    def load(self, t: float, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the force on each body (n,) without friction."""
        springs = self.k * (self.driver * t - x)
        forces = springs - self.c * v
        for sink, source, output, factor in self.couplings:
            forces[sink] += factor * {"x": x, "v": v, "F_spring": springs}[output][source]
        return forces


BODY_MODELS = {name: module.friction for name, module in MODEL_MODULES.items() if hasattr(module, "friction")}


def build_bodies(scene: CoupledScene, defaults: dict[str, dict[str, float]]) -> tuple[CoupledBodies, np.ndarray]:
    """Return the bodies of a scene and their initial state (x, v) (2 n,).

    Parameters
    ----------
    defaults : dict
        Parameter values of each model, which the scene overrides.
    """
    values = [defaults[part.model] | part.values for part in scene.parts.values()]
    indices = {name: i for i, name in enumerate(scene.parts)}

    def column(name: str) -> np.ndarray:
        return np.array([value.get(name, 0.0) for value in values])

    laws = [BODY_MODELS[part.model] for part in scene.parts.values()]
    limits = [law(value) if law else (0.0, 0.0) for law, value in zip(laws, values, strict=True)]
    slide, hold = np.array(limits).T
    constants = column("m"), column("k"), column("c"), hold, slide, column("v_driver")
    bodies = CoupledBodies(*constants, tuple(couplings(scene, indices)))
    return bodies, np.concatenate([column("x0"), column("v0")])


def couplings(scene: CoupledScene, indices: dict[str, int]) -> Iterator[tuple[int, int, str, float]]:
    """Yield the couplings of the bodies; a spring acts on its flange a with k (x_b - x_a) + c (v_b - v_a)."""
    for signal in scene.direct_connections:
        yield indices[signal.sink], indices[signal.source], signal.output, 1.0
    for spring in scene.springs:
        for flange, part in spring.force_ends:
            for end, source in (("a", spring.a), ("b", spring.b)):
                sign = -1.0 if end == flange else 1.0
                for output, factor in (("x", spring.k), ("v", spring.c)) if source else ():
                    yield indices[part], indices[source], output, sign * factor


def solve_bodies(system: CoupledBodies, start: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return positions (len(times), n) at rising times in s.

    Parameters
    ----------
    start : numpy.ndarray
        State (x, v), (2 n,), at the first time.

    Raises
    ------
    HarnessError
        If there are more than MAX_EVENTS events.
    """
    n, state, t, stop = len(system.m), start.copy(), float(times[0]), float(times[-1])
    positions = np.empty((len(times), n))
    mode = np.array([resolve_mode(system, i, t, state) for i in range(n)])
    for _ in range(MAX_EVENTS):
        options = {"events": event_functions(system, mode), "dense_output": True, "rtol": RTOL, "atol": ATOL}
        run = solve_ivp(rates(system, mode), (t, stop), state, "DOP853", **options)
        in_run = (times >= t) & (times <= run.t[-1])
        if in_run.any():
            positions[in_run] = run.sol(times[in_run])[:n].T
        t, state = float(run.t[-1]), run.y[:, -1].copy()
        if run.status != 1 or t >= stop:
            return positions
        i = next(i for i, events in enumerate(run.t_events) if len(events))
        if mode[i] == 0:
            mode[i] = int(np.sign(system.load(t, state[:n], state[n:])[i]))
        else:
            state[n + i] = 0.0
            mode[i] = resolve_mode(system, i, t, state)
    raise HarnessError(f"the single-model reference has more than {MAX_EVENTS} events before t = {t!r} s")


def resolve_mode(system: CoupledBodies, i: int, t: float, state: np.ndarray) -> int:
    """Return the mode of body i: -1 sliding backward, 0 stuck, 1 sliding forward."""
    n = len(system.m)
    if state[n + i] != 0.0:
        return int(np.sign(state[n + i]))
    load = system.load(t, state[:n], state[n:])[i]
    return 0 if system.hold[i] > 0 and abs(load) <= system.hold[i] else int(np.sign(load))


def rates(system: CoupledBodies, mode: np.ndarray) -> Callable[[float, np.ndarray], np.ndarray]:
    """Return the right-hand side for fixed modes (n,)."""
    n, moves = len(mode), (mode != 0) | (system.hold == 0)

    def rate(t: float, state: np.ndarray) -> np.ndarray:
        x, v = state[:n], state[n:]
        return np.concatenate([moves * v, moves * (system.load(t, x, v) - mode * system.slide) / system.m])

    return rate


def event_functions(system: CoupledBodies, mode: np.ndarray) -> list[Callable[[float, np.ndarray], float]]:
    """Return an event function for each body: its velocity becomes zero, or its load exceeds static friction."""
    n = len(mode)

    def event_function(i: int) -> Callable[[float, np.ndarray], float]:
        def crossing(t: float, state: np.ndarray) -> float:
            if system.hold[i] == 0:
                return 1.0  # without friction there is no event
            if mode[i] != 0:
                return float(mode[i] * state[n + i])
            return float(system.hold[i] - abs(system.load(t, state[:n], state[n:])[i]))

        crossing.terminal, crossing.direction = True, -1.0  # type: ignore[attr-defined]
        return crossing

    return [event_function(i) for i in range(n)]
