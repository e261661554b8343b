"""The larger models, formulated independently and integrated by scipy; contacts from event to event."""

import json
from math import exp, fabs

import build_cache
import numpy as np
from scipy.integrate import solve_ivp


class Belt:
    """Block on a belt. A call returns rates, slip speeds, friction forces and static limits in the given modes."""

    stop, states, modes, first, start = 10.0, ("x", "v"), ("mode",), [-1], [0.0, 0.0]
    changes = ((6.0, "v_belt", 0.13), (7.1, "v_belt", -0.05))
    v_belt = 0.1

    def __call__(self, t, y, modes):
        x, v = y
        slip, pull = v - self.v_belt, -100.0 * x - 0.2 * v
        force = modes[0] * (5.0 + 3.0 * exp(-((slip / 0.1) ** 2))) if modes[0] else pull
        return [v, pull - force], [slip], [force], [8.0]

    def rest(self, y, modes):
        if modes[0] == 0:
            y[1] = self.v_belt


class Clutch:
    """Two inertias that turn as one while the clutch is engaged."""

    stop, states, modes, first, start = 4.0, ("omega1", "omega2"), ("mode",), [1], [50.0, 0.0]
    changes = ((1.7, "T_in", 90.0), (2.2, "T_in", 20.0), (3.3, "F_n", 200.0))
    T_in, F_n = 20.0, 1000.0

    def __call__(self, t, y, modes):
        a, b = y
        first, second = self.T_in - 0.05 * a, 5.0 + 0.2 * b
        force = modes[0] * 0.03 * self.F_n if modes[0] else (1.5 * first + 0.5 * second) / 2.0
        common = [(first - second) / 2.0] * 2
        rates = [(first - force) / 0.5, (force - second) / 1.5] if modes[0] else common
        return rates, [a - b], [force], [0.04 * self.F_n]

    def rest(self, y, modes):
        if modes[0] == 0:
            y[:] = (0.5 * y[0] + 1.5 * y[1]) / 2.0


class Sleds:
    """Two sleds in a row."""

    stop, states, modes, first, start = 16.0, ("x1", "v1", "x2", "v2"), ("mode1", "mode2"), [0, 0], [0.0] * 4
    changes = ()

    def __call__(self, t, y, modes):
        x1, v1, x2, v2 = y
        link = 1100.0 * (x1 - x2)
        load = 742.5 * (0.034 * t - x1) - link
        force = [modes[0] * 73.575 if modes[0] else load, modes[1] * 40.0 if modes[1] else link]
        return [v1, (load - force[0]) / 12.5, v2, (link - force[1]) / 8.0], [v1, v2], force, [110.3625, 66.0]

    def rest(self, y, modes):
        for i in range(2):
            if modes[i] == 0:
                y[2 * i + 1] = 0.0


class Blocks:
    """A block on a block, with four cases; in two of them both blocks move as one body."""

    stop, states, modes, first, start = 8.0, ("x1", "v1", "x2", "v2"), ("mode1", "mode2"), [0, 0], [0.0] * 4
    changes = ()

    def __call__(self, t, y, modes):
        x1, v1, x2, v2 = y
        pull, back = 400.0 * (0.2 * t - x2), -150.0 * x1
        n1, n2 = 0.15 * 6.0 * 9.81, 0.5 * 2.0 * 9.81
        if modes[1]:
            upper = modes[1] * n2
            lower = modes[0] * n1 if modes[0] else back + upper
            a1, a2 = (back + upper - lower) / 4.0, (pull - upper) / 2.0
        else:
            lower = modes[0] * n1 if modes[0] else back + pull
            a1 = a2 = (pull + back - lower) / 6.0
            upper = pull - 2.0 * a2
        return [v1, a1, v2, a2], [v1, v2 - v1], [lower, upper], [1.4 * n1, 1.4 * n2]

    def rest(self, y, modes):
        if modes[0] == 0:
            y[1] = 0.0
        if modes[1] == 0:
            y[3] = y[1] = 0.0 if modes[0] == 0 else (4.0 * y[1] + 2.0 * y[3]) / 6.0


class Lift:
    """A sled that the driver lifts while pulling it."""

    stop, states, modes, first, start = 16.0, ("x", "v"), ("mode",), [0], [0.0, 0.0]
    changes = ()

    def __call__(self, t, y, modes):
        x, v = y
        stretch = 0.034 * t - x
        normal, pull = 12.5 * 9.81 - 300.0 * stretch, 742.5 * stretch
        force = modes[0] * 0.6 * normal if modes[0] else pull
        return [v, (pull - force) / 12.5 if modes[0] else 0.0], [v], [force], [0.9 * normal]

    def rest(self, y, modes):
        if modes[0] == 0:
            y[1] = 0.0


class Crank:
    """A slider on a crank: at a dead point its slip reverses, while the crank turns on."""

    stop, states, modes, first, start = 8.0, ("q", "w"), ("mode",), [0], [0.0, 0.0]
    changes = ((2.9, "k", 3.0),)
    Omega, k = 3.0, 2.0

    def __call__(self, t, y, modes):
        q, w = y
        torque, lever = self.k * (self.Omega * t - q), 0.1 * np.cos(q)
        force = modes[0] * 20.0 if modes[0] else torque / lever
        return [w, (torque - force * lever) / 0.05 if modes[0] else 0.0], [lever * w], [force], [30.0]

    def rest(self, y, modes):
        if modes[0] == 0 and fabs(np.cos(y[0])) < 1e-9:
            modes[0] = -int(np.sign(np.sin(y[0])))
        elif modes[0] == 0:
            y[1] = 0.0


CONTACT_REFERENCES = {
    "belt": Belt, "clutch": Clutch, "sleds": Sleds, "blocks": Blocks, "lift": Lift, "crank": Crank,
}  # fmt: skip


def solve_lugre(stop):
    """Return position, speed and bristle deflection of the LuGre sled at a time, by a method that the project does not
    use."""

    def rates(t, y):
        x, v, z = y
        u = v - 1e4 * fabs(v) * z / (73.56 + (110.34 - 73.56) * exp(-((v / 0.01) ** 2)))
        return [v, (742.5 * (0.034 * t - x) - (1e4 * z + 300.0 * u + 0.4 * v)) / 12.5, u]

    return solve_ivp(rates, (0.0, stop), (0.0, 0.0, 0.0), "LSODA", rtol=1e-12, atol=1e-14).y[:, -1]


def reference_events(name, changes=()):
    """Return time and modes of every event and the final state of a model; computed once per test run."""

    def make(folder):
        events, end = integrate_events(CONTACT_REFERENCES[name](), changes)
        (folder / "reference.json").write_text(json.dumps([events, list(end)]))

    return json.loads((build_cache.keep_build(f"{name}-reference{len(changes)}", make) / "reference.json").read_text())


def integrate_events(physics, changes=()):
    """Return time and modes of every event and the final state. `changes` lists (t, name, value)."""
    t, y, modes, events = 0.0, np.array(physics.start), list(physics.first), []
    for end, name, value in (*changes, (physics.stop, "", 0.0)):
        while True:
            guards = [
                event_function(physics, modes, i, side)
                for i in range(len(modes))
                for side in ((0,) if modes[i] else (1, -1))
            ]
            run = solve_ivp(
                lambda t, y, modes=tuple(modes): physics(t, y, modes)[0], (t, end), y, "DOP853",
                events=guards, rtol=3e-14, atol=1e-16, max_step=0.02,
            )  # fmt: skip
            t, y = run.t[-1], run.y[:, -1].copy()
            if run.status != 1:
                break
            for one, times in zip(guards, run.t_events, strict=True):
                if len(times):
                    modes[one.contact] = one.after
                    physics.rest(y, modes)
            apply_breakaways(physics, t, y, modes)
            events.append((t, *modes))
        if name:
            setattr(physics, name, value)
            before, slips = list(modes), physics(t, y, modes)[1]
            modes = [int(np.sign(s)) if fabs(s) > 1e-12 else 0 for s in slips]
            apply_breakaways(physics, t, y, modes)
            if modes != before:
                events.append((t, *modes))
    return events, y


def event_function(physics, modes, i, side):
    """Return an event function that falls to zero where contact i stops slipping (side 0) or breaks away to a side."""

    def margin(t, y, modes=tuple(modes)):
        _, slips, forces, most = physics(t, y, modes)
        return most[i] - side * forces[i] if side else modes[i] * slips[i]

    margin.terminal, margin.direction, margin.contact, margin.after = True, -1, i, side
    return margin


def apply_breakaways(physics, t, y, modes):
    """Let contacts whose load exceeds the static limit slip, one after the other."""
    while True:
        _, _, forces, most = physics(t, y, modes)
        over = [i for i, m in enumerate(modes) if m == 0 and fabs(forces[i]) > most[i] * (1.0 + 1e-9)]
        if not over:
            return
        modes[over[0]] = 1 if forces[over[0]] > 0.0 else -1
