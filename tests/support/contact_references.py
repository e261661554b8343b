"""Second formulations of the models with more states or contacts, and their events, computed once."""

import json
from math import cos, sin

import build_cache

from benchmarks.references import event_located
from benchmarks.references.event_located import HybridProblem


class Lift(HybridProblem):
    """A sled that the driver lifts while pulling it."""

    start, stop, first = (0.0, 0.0), 16.0, (0,)

    def contacts(self, t, y, modes):
        stretch = 0.034 * t - y[0]
        normal = 12.5 * 9.81 - 300.0 * stretch
        return [(y[1], modes[0] * 0.6 * normal if modes[0] else 742.5 * stretch, 0.9 * normal)]

    def rates(self, t, y, modes):
        ((_, force, _),) = self.contacts(t, y, modes)
        return [y[1], (742.5 * (0.034 * t - y[0]) - force) / 12.5 if modes[0] else 0.0]

    stop_slip = event_located.Forced.stop_slip


class Crank(HybridProblem):
    """A slider on a crank: at a dead point its slip reverses, while the crank turns on."""

    start, stop, first = (0.0, 0.0), 8.0, (0,)

    def contacts(self, t, y, modes):
        torque, lever = 2.0 * (3.0 * t - y[0]), 0.1 * cos(y[0])
        return [(lever * y[1], modes[0] * 20.0 if modes[0] else torque / lever, 30.0)]

    def rates(self, t, y, modes):
        torque, lever = 2.0 * (3.0 * t - y[0]), 0.1 * cos(y[0])
        return [y[1], (torque - modes[0] * 20.0 * lever) / 0.05 if modes[0] else 0.0]

    def stop_slip(self, y, modes):
        if modes[0] == 0 and abs(cos(y[0])) < 1e-9:
            modes[0] = -1 if sin(y[0]) > 0.0 else 1
        elif modes[0] == 0:
            y[1] = 0.0


EVENT_LOCATED_NAMES = ("belt", "sleds", "stacked", "clutch")
PROBLEMS = {name: event_located.PROBLEMS[name] for name in EVENT_LOCATED_NAMES} | {"lift": Lift, "crank": Crank}
PROBLEMS_WITH_LAWS = PROBLEMS | {"stribeck": event_located.StribeckBelt}


def reference_events(name):
    """Return time and modes of every event and the final state of a problem."""

    def make(folder):
        problem = PROBLEMS_WITH_LAWS[name]()
        rows, events = event_located.solve(problem, [0.0, problem.stop], "DOP853", 3e-14, 1e-16)
        text = json.dumps([[(t, *modes) for t, modes in events], rows[-1].tolist()])
        (folder / "reference.json").write_text(text)

    return json.loads((build_cache.keep_build(f"{name}-reference", make) / "reference.json").read_text())
