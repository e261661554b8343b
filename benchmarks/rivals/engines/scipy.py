"""scipy: solve_ivp, restarted at every change of mode."""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ..scenes import Events, Scene, Setting, Solution


def simulate(scene: Scene, setting: Setting) -> Solution:
    """Simulate a scene; `setting` holds options of solve_ivp."""
    inertia, partner = scene.inertia, scene.partner

    def holding_force(t: float, x: float) -> float:
        return scene.load(t, x) / (1.0 + inertia / partner)

    def mode_at_rest(t: float, x: float) -> int:
        force = holding_force(t, x)
        return int(np.sign(force)) if abs(force) > scene.hold(t) else 0

    def rates(t: float, y: np.ndarray) -> tuple[float, float, float]:
        x, v, w = y
        force = mode * scene.slide(t, abs(v - w)) if mode else holding_force(t, x)
        return v, (scene.load(t, x) - force) / inertia, force / partner

    def stops(t: float, y: np.ndarray) -> float:
        return mode * (y[1] - y[2])

    def breaks(t: float, y: np.ndarray) -> float:
        return scene.hold(t) - abs(holding_force(t, y[0]))

    for event in (stops, breaks):
        attributes: Any = event
        attributes.terminal, attributes.direction = True, -1
    t, y, steps = 0.0, np.array(scene.start), 0
    mode, modes, rows = int(np.sign(y[1] - y[2])) or mode_at_rest(t, y[0]), Events(), [y[None].copy()]
    while t < scene.stop:
        options: Any = {"events": stops if mode else breaks, "dense_output": True} | setting
        run = solve_ivp(rates, (t, scene.stop), y, **options)
        times = scene.times[(scene.times > t) & (scene.times <= run.t[-1])]
        rows.append(np.reshape(run.sol(times), (3, -1)).T)
        t, y, steps = float(run.t[-1]), run.y[:, -1].copy(), steps + len(run.t) - 1
        if run.status == 1:
            if mode:
                y[1] = y[2]
            mode = mode_at_rest(t, y[0]) if mode else int(np.sign(holding_force(t, y[0])))
            modes.append((t, mode))
    return Solution(scene.times, np.concatenate(rows), modes, steps=steps)
