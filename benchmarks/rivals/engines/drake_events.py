"""Drake: a system with witness functions; the integrator stops where one of them falls to zero."""

from typing import Any

import numpy as np
from pydrake.systems import analysis
from pydrake.systems.framework import LeafSystem, UnrestrictedUpdateEvent, WitnessFunctionDirection

from ..scenes import Events, Scene, Setting, Solution


class Contact(LeafSystem):
    """The body and its partner, with the mode -1, 0 stuck or 1."""

    def __init__(self, scene: Scene) -> None:
        super().__init__()
        self.scene, self.modes = scene, Events()
        self.DeclareContinuousState(3)
        x, v, w = scene.start
        self.mode = int(np.sign(v - w)) or self.mode_at_rest(0.0, x)
        falls, change = WitnessFunctionDirection.kPositiveThenNonPositive, UnrestrictedUpdateEvent(self.change)
        self.witness = self.MakeWitnessFunction("change", falls, self.margin, change)

    def holding_force(self, t: float, x: float) -> float:
        return self.scene.load(t, x) / (1.0 + self.scene.inertia / self.scene.partner)

    def mode_at_rest(self, t: float, x: float) -> int:
        force = self.holding_force(t, x)
        return int(np.sign(force)) if abs(force) > self.scene.hold(t) else 0

    def margin(self, context: Any) -> float:
        t, (x, v, w) = context.get_time(), context.get_continuous_state_vector().CopyToVector()
        return self.mode * (v - w) if self.mode else self.scene.hold(t) - abs(self.holding_force(t, x))

    def DoGetWitnessFunctions(self, context: Any) -> list[Any]:
        return [self.witness]

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        t, (x, v, w), scene = context.get_time(), context.get_continuous_state_vector().CopyToVector(), self.scene
        force = self.mode * scene.slide(t, abs(v - w)) if self.mode else self.holding_force(t, x)
        derivatives.SetFromVector([v, (scene.load(t, x) - force) / scene.inertia, force / scene.partner])

    def change(self, context: Any, event: Any, state: Any) -> None:
        t, (x, v, w) = context.get_time(), context.get_continuous_state_vector().CopyToVector()
        state.get_mutable_continuous_state().SetFromVector([x, w if self.mode else v, w])
        self.mode = self.mode_at_rest(t, x) if self.mode else int(np.sign(self.holding_force(t, x)))
        self.modes.append((t, self.mode))


def simulate(scene: Scene, setting: Setting) -> Solution:
    """Simulate a scene; `setting` holds options of SimulatorConfig."""
    simulator, options = analysis.Simulator(Contact(scene)), analysis.SimulatorConfig(**setting)
    analysis.ApplySimulatorConfig(options, simulator)
    rows, context = [], simulator.get_mutable_context()
    context.SetContinuousState(scene.start)
    context.SetAccuracy(options.accuracy)  # of the located events
    for t in scene.times.tolist():
        simulator.AdvanceTo(t)
        rows.append(context.get_continuous_state_vector().CopyToVector())
    return Solution(scene.times, np.array(rows), simulator.get_system().modes, steps=simulator.get_num_steps_taken())
