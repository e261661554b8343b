"""PathSim: an ODE block, and zero crossings whose functions change the mode."""

from typing import Any

import numpy as np
from pathsim import Connection, Simulation, solvers
from pathsim.blocks import ODE, Scope
from pathsim.events import ZeroCrossing

from ..scenes import Events, Scene, Setting, Solution


def simulate(scene: Scene, setting: Setting) -> Solution:
    """Simulate a scene; `setting` holds options of Simulation, and event_tolerance."""
    inertia, partner, options = scene.inertia, scene.partner, dict[str, Any](setting)
    mode, modes = 0, Events()

    def holding_force(t: float, x: float) -> float:
        return scene.load(t, x) / (1.0 + inertia / partner)

    def mode_at_rest(t: float, x: float) -> int:
        force = holding_force(t, x)
        return int(np.sign(force)) if abs(force) > scene.hold(t) else 0

    def rates(y: np.ndarray, u: np.ndarray, t: float) -> np.ndarray:
        x, v, w = y
        force = mode * scene.slide(t, abs(v - w)) if mode else holding_force(t, x)
        return np.array([v, (scene.load(t, x) - force) / inertia, force / partner])

    def change(t: float) -> None:
        nonlocal mode
        x, v, w = body.engine.state
        body.engine.state = np.array([x, w if mode else v, w])
        mode = mode_at_rest(t, x) if mode else int(np.sign(holding_force(t, x)))
        modes.append((t, mode))
        for event, is_active in ((stops, mode != 0), (breaks, mode == 0)):
            event.on() if is_active else event.off()

    mode = int(np.sign(scene.start[1] - scene.start[2])) or mode_at_rest(0.0, scene.start[0])
    # with a fixed step, a sampling period would record states of the end of the step
    body, scope = ODE(rates, np.array(scene.start)), Scope(scene.interval if "Solver" in options else None)
    tolerance = options.pop("event_tolerance", 1e-4)  # the default of ZeroCrossing
    stops = ZeroCrossing(lambda t: body.engine.state[1] - body.engine.state[2], change, tolerance)
    breaks = ZeroCrossing(lambda t: scene.hold(t) - abs(holding_force(t, body.engine.state[0])), change, tolerance)
    (breaks if mode else stops).off()
    if "Solver" in options:
        options["Solver"] = getattr(solvers, options["Solver"])
    wires = [Connection(body[i], scope[i]) for i in range(3)]
    simulation = Simulation([body, scope], wires, [stops, breaks], log=False, **options)
    steps = simulation.run(scene.stop)["total_steps"]
    times, states = scope.read()
    return Solution(times, states.T, modes, steps=steps)
