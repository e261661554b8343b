"""The same bodies in one model, without communication steps: what a coupled run is compared with.

    m_i a_i = F_i + k_i (v_driver_i t - x_i) - c_i v_i - F_friction_i,    F_i = sum of factor * output of a body

Each body sticks, or slides forward or backward; every change is an event at which the integration begins anew.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from ..errors import HarnessError
from ..scenes.coupled.scene import CoupledScene
from .models import MODEL_MODULES

RTOL, ATOL = 1e-11, 1e-14
MOST = 10_000  # events


@dataclass(frozen=True)
class CoupledBodies:
    """The constants of n bodies, each (n,), and the couplings as (sink, source, output, factor)."""

    m: np.ndarray
    k: np.ndarray
    c: np.ndarray
    hold: np.ndarray
    slide: np.ndarray
    driver: np.ndarray
    couplings: tuple[tuple[int, int, str, float], ...]

    def load(self, t: float, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The force on each body but for friction (n,)."""
        springs = self.k * (self.driver * t - x)
        forces = springs - self.c * v
        for sink, source, output, factor in self.couplings:
            forces[sink] += factor * {"x": x, "v": v, "F_spring": springs}[output][source]
        return forces


BODY_MODELS = {
    name: each.friction for name, each in MODEL_MODULES.items() if hasattr(each, "friction")
}  # the models of bodies


def build_bodies(scene: CoupledScene, defaults: dict[str, dict[str, float]]) -> tuple[CoupledBodies, np.ndarray]:
    """The bodies of a scene and their start (x, v) (2 n,), from the values of the models and of the scene."""
    values = [defaults[part.model] | part.values for part in scene.parts]
    places = {part.name: i for i, part in enumerate(scene.parts)}

    def each(name: str) -> np.ndarray:
        return np.array([value.get(name, 0.0) for value in values])

    frictions = [BODY_MODELS[part.model] for part in scene.parts]
    limits = [friction(its) if friction else (0.0, 0.0) for friction, its in zip(frictions, values, strict=True)]
    slide, hold = np.array(limits).T
    constants = each("m"), each("k"), each("c"), hold, slide, each("v_driver")
    return CoupledBodies(*constants, tuple(couplings(scene, places))), np.concatenate([each("x0"), each("v0")])


def couplings(scene: CoupledScene, places: dict[str, int]) -> Iterator[tuple[int, int, str, float]]:
    """What acts on each body from the others: of a spring on its flange a k (x_b - x_a) + c (v_b - v_a)."""
    for each in scene.direct_connections:
        yield places[each.sink], places[each.source], each.output, 1.0
    for spring in scene.springs:
        for flange, part in spring.force_ends:
            for end, source in (("a", spring.a), ("b", spring.b)):
                sign = -1.0 if end == flange else 1.0
                for output, factor in (("x", spring.k), ("v", spring.c)) if source else ():
                    yield places[part], places[source], output, sign * factor


def solve_bodies(system: CoupledBodies, start: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Positions (len(times), n) at the rising times from the first on."""
    n, state, t, stop = len(system.m), start.copy(), float(times[0]), float(times[-1])
    positions = np.empty((len(times), n))
    mode = np.array([resolve_mode(system, i, t, state) for i in range(n)])
    for _ in range(MOST):
        options = {"events": event_functions(system, mode), "dense_output": True, "rtol": RTOL, "atol": ATOL}
        piece = solve_ivp(rates(system, mode), (t, stop), state, "DOP853", **options)
        inside = (times >= t) & (times <= piece.t[-1])
        if inside.any():
            positions[inside] = piece.sol(times[inside])[:n].T
        t, state = float(piece.t[-1]), piece.y[:, -1].copy()
        if piece.status != 1 or t >= stop:
            return positions
        i = next(i for i, found in enumerate(piece.t_events) if len(found))
        if mode[i] == 0:
            mode[i] = int(np.sign(system.load(t, state[:n], state[n:])[i]))
        else:
            state[n + i] = 0.0
            mode[i] = resolve_mode(system, i, t, state)
    raise HarnessError(f"the monolithic reference has more than {MOST} events before t = {t!r} s")


def resolve_mode(system: CoupledBodies, i: int, t: float, state: np.ndarray) -> int:
    """The mode that body i takes on: -1, 0 or 1."""
    n = len(system.m)
    if state[n + i] != 0.0:
        return int(np.sign(state[n + i]))
    pull = system.load(t, state[:n], state[n:])[i]
    return 0 if system.hold[i] > 0 and abs(pull) <= system.hold[i] else int(np.sign(pull))


def rates(system: CoupledBodies, mode: np.ndarray) -> Callable[[float, np.ndarray], np.ndarray]:
    """The right-hand side while the modes (n,) last."""
    n, moves = len(mode), (mode != 0) | (system.hold == 0)

    def rate(t: float, state: np.ndarray) -> np.ndarray:
        x, v = state[:n], state[n:]
        return np.concatenate([moves * v, moves * (system.load(t, x, v) - mode * system.slide) / system.m])

    return rate


def event_functions(system: CoupledBodies, mode: np.ndarray) -> list[Callable[[float, np.ndarray], float]]:
    """An event for each body: its speed comes to zero, or its load reaches what holds it."""
    n = len(mode)

    def guard(i: int) -> Callable[[float, np.ndarray], float]:
        def crossing(t: float, state: np.ndarray) -> float:
            if system.hold[i] == 0:
                return 1.0  # nothing ever holds it
            if mode[i] != 0:
                return float(mode[i] * state[n + i])
            return float(system.hold[i] - abs(system.load(t, state[:n], state[n:])[i]))

        crossing.terminal, crossing.direction = True, -1.0  # type: ignore[attr-defined]
        return crossing

    return [guard(i) for i in range(n)]
