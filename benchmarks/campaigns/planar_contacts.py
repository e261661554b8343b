"""Random motions of a body with friction in a plane: against the closed form, and driven ones against scipy.

    python -m benchmarks.campaigns.planar_contacts --scenes 1000 --driven 200 --exchange 1000

Closed form: the rest under constant loads of up to 0.9999 of the friction, half of them nearly head-on; time, position
and hold must agree within 1e-9.  Driven: springs, pulls along lines and circles, and loads that jump by 90 or 180
degrees at rest and in motion; events must be equal, and times and positions agree within 1e-8.  A motion in which a tie
decides whether the body moves is not compared.  Model exchange: the first motions of both kinds by fmpy's CVode, within
its tolerance.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, hypot, pi, sin
from pathlib import Path
from typing import Any

import build_cache
import fmpy
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import harness
from benchmarks.references.plane import rest
from harness.process.temporary_directory import temporary_directory

NATIVE = ("--native", "--platform", "linux64")
MAX_ERROR, MAX_DRIVEN_ERROR, RTOL = 1e-9, 1e-8, 1e-10
# Of an importer's solver: its tolerance, and errors in terms of it
EXCHANGE_RTOL, MAX_EXCHANGE_ERROR, MAX_DRIVEN_EXCHANGE_ERROR = 1e-8, 100.0, 1000.0
STOP = 4.0  # s, of a driven motion
SLOW, KICK, NEAR_TIE = (
    1e-8,
    1e-9,
    1e-6,
)  # m/s where the closed form takes over; s after a break-away; share of the limit
MODEL = '''"""A body on a plane that springs pull along a line and a circle."""

from fmus import Fixed, Input, Mode, Model, Output, Parameter, PlanarContact, State, cos, sin


class Driven(Model):
    """Body on a plane, pulled by springs."""

    m = Parameter(1.0, "kg", "mass", above=0.0)
    f = Parameter(2.0, "N", "sliding friction", low=0.0)
    hold = Parameter(2.0, "N", "holding friction", low=0.0)
    k_x = Parameter(100.0, "N/m", "stiffness along x", low=0.0)
    k_y = Parameter(100.0, "N/m", "stiffness along y", low=0.0)
    pull = Parameter(0.0, "m/s", "speed of the driver along x")
    r = Parameter(0.0, "m", "radius of its circle")
    Omega = Parameter(1.0, "rad/s", "angular speed on the circle")
    v_x0 = Fixed(0.0, "m/s", "initial speed along x")
    v_y0 = Fixed(0.0, "m/s", "initial speed along y")
    F_x = Input(0.0, "N", "force along x")
    F_y = Input(0.0, "N", "force along y")
    x = State("m", "position along x")
    y = State("m", "position along y")
    v_x = State("m/s", "speed along x", start=v_x0, rate_of=x)
    v_y = State("m/s", "speed along y", start=v_y0, rate_of=y)
    s = State("m", "position of the driver", rate=pull)
    angle = State("rad", "angle of the driver", rate=Omega)
    mode = Mode("0 stuck, 1 sliding")
    R = PlanarContact("N", "friction", mode=mode, slip=(v_x, v_y), slide=f, hold=hold)
    a_x = Output("m/s2", "acceleration along x", (F_x + k_x * (s + r * cos(angle) - r - x) - R.x) / m, rate_of=v_x)
    a_y = Output("m/s2", "acceleration along y", (F_y + k_y * (r * sin(angle) - y) - R.y) / m, rate_of=v_y)
    stop_time, step_size, method = 4.0, 0.01, "radau9"
'''
ClosedScene = tuple[float, float, float, float, float, float]


# ---- closed form


def random_scenes(count: int) -> Iterator[ClosedScene]:
    """Yield mass, force, friction, speed, its direction from that of the force, and the direction of the force."""
    random = np.random.default_rng(3)
    for _ in range(count):
        share = random.choice([random.uniform(1e-3, 0.99), 1.0 - 10 ** random.uniform(-4.0, -2.0)])
        phi = pi - random.choice([random.uniform(0.0, pi), 10 ** random.uniform(-9.0, -3.0)])
        m, f, speed = random.uniform(0.5, 3.0), random.uniform(0.5, 5.0), random.uniform(0.1, 3.0)
        yield m, share * f, f, speed, phi, random.uniform(-pi, pi)


def errors_at_rest(
    fmu: str | Path, m: float, F: float, f: float, speed: float, phi: float, turn: float = 0.0
) -> tuple[float, float, float, float]:
    """Return errors of a run of the model puck: of time and position, relative; speed at the end; error of the hold."""
    time, x, y = rest(m, F, f, speed, phi)
    start = puck_values(m, f, speed, phi + turn)
    stop, force = 1.3 * time, (F * cos(turn), F * sin(turn))
    run = harness.simulate(fmu, start, stop=stop, inputs=constant(*force, stop), rtol=RTOL)
    if run["mode"][-1] != 0:
        return np.inf, np.inf, np.inf, np.inf
    along = run["x"][-1] * cos(turn) + run["y"][-1] * sin(turn) - x
    across = run["y"][-1] * cos(turn) - run["x"][-1] * sin(turn) - y
    hold_error = hypot(run["R.x"][-1] - force[0], run["R.y"][-1] - force[1]) / f
    speed_after = hypot(run["v_x"][-1], run["v_y"][-1])
    return abs(run.events.t[-1] / time - 1.0), hypot(along, across) / (speed * time), speed_after, hold_error


def puck_values(m: float, f: float, speed: float, angle: float) -> dict[str, float]:
    """Return parameters of the model puck on a plate that is not tilted."""
    start = {"alpha": 0.0, "g": 1.0, "m": m, "mu": f / m, "mu_s": f / m}
    return start | {"v_x0": speed * cos(angle), "v_y0": speed * sin(angle)}


def exchange_errors(
    fmu: str | Path, m: float, F: float, f: float, speed: float, phi: float, turn: float = 0.0, rtol: float = 1e-8
) -> tuple[float, float]:
    """Return errors of the time of rest and of the position there in model exchange by CVode, in terms of rtol.

    A load that is nearly as large as the friction takes long to stop the body: its time counts that much less.
    """
    time, x, y = rest(m, F, f, speed, phi)
    values = puck_values(m, f, speed, phi + turn) | {"F_x": F * cos(turn), "F_y": F * sin(turn)}
    run = exchange(fmu, values, 1.3 * time, rtol)
    end = run[-1]
    if end["mode"] != 0 or hypot(end["v_x"], end["v_y"]) > 0.0:
        return np.inf, np.inf
    along = end["x"] * cos(turn) + end["y"] * sin(turn) - x
    across = end["y"] * cos(turn) - end["x"] * sin(turn) - y
    time_error = abs(end["events.t_last"] / time - 1.0) * (1.0 - F / f)
    return time_error / rtol, hypot(along, across) / (speed * time) / rtol


def exchange(fmu: str | Path, values: dict[str, float], stop: float, rtol: float, inputs: Any = None) -> np.ndarray:
    """Return rows of a run in model exchange by fmpy's CVode."""
    rows: np.ndarray = fmpy.simulate_fmu(
        str(fmu),
        fmi_type="ModelExchange",
        start_values=values,
        input=inputs,
        stop_time=stop,
        relative_tolerance=rtol,
        output_interval=stop / 1000,  # CVode may take 500 steps in each
        output=["x", "y", "v_x", "v_y", "mode", "events.t_last", "events.count"],
    )
    return rows


def constant(F_x: float, F_y: float, stop: float) -> dict[str, list[float]]:
    """Return a constant force as inputs."""
    return {"time": [0.0, stop], "F_x": [F_x, F_x], "F_y": [F_y, F_y]}


# ---- driven motions


@dataclass
class DrivenMotion:
    """Parameters of the model, and the force as (time at which it begins, F_x, F_y)."""

    values: dict[str, float]
    forces: list[tuple[float, float, float]]

    def load(self, t: float, y: np.ndarray, force: tuple[float, float, float]) -> np.ndarray:
        """Return the load on the body."""
        p = self.values
        angle = p["Omega"] * t
        return np.array(
            [
                force[1] + p["k_x"] * (p["pull"] * t + p["r"] * cos(angle) - p["r"] - y[0]),
                force[2] + p["k_y"] * (p["r"] * sin(angle) - y[1]),
            ]
        )

    def inputs(self) -> dict[str, list[float]]:
        """Return the force as inputs, with two rows where it jumps."""
        ends = [*(t for t, _, _ in self.forces[1:]), STOP]
        rows = [row for force, end in zip(self.forces, ends, strict=True) for row in (force, (end, *force[1:]))]
        return dict(zip(("time", "F_x", "F_y"), map(list, zip(*rows, strict=True)), strict=True))


def random_driven(seed: int) -> DrivenMotion:
    """Return a random driven motion."""
    random = np.random.default_rng([65, seed])
    f = random.uniform(0.5, 5.0)
    hold, angle, size = f * random.uniform(1.0, 1.6), random.uniform(-pi, pi), f * random.uniform(0.2, 1.8)
    speed, phi = random.choice([0.0, random.uniform(0.05, 1.0)]), random.uniform(-pi, pi)
    turn = random.choice([pi / 2, -pi / 2, pi])
    values = {
        "m": random.uniform(0.5, 3.0),
        "f": f,
        "hold": hold,
        "k_x": random.uniform(20.0, 200.0),
        "pull": random.choice([0.0, random.uniform(0.02, 0.3)]),
        "r": random.choice([0.0, random.uniform(0.02, 0.2)]),
        "Omega": random.uniform(0.5, 8.0),
        "v_x0": speed * cos(phi),
        "v_y0": speed * sin(phi),
    }
    values["k_y"] = random.choice([values["k_x"], random.uniform(20.0, 200.0)])
    times = np.sort(random.uniform(0.2, STOP, 2))
    turned_angle = angle + turn
    forces = [
        (0.0, 0.0, 0.0),
        (float(times[0]), size * cos(angle), size * sin(angle)),
        (float(times[1]), size * cos(turned_angle), size * sin(turned_angle)),
    ]
    return DrivenMotion({name: float(value) for name, value in values.items()}, forces)


class NearTieError(Exception):
    """The load at rest comes close to its limit."""


def solve(motion: DrivenMotion) -> tuple[list[float], np.ndarray]:
    """Return the times of all changes of mode, and the states at the end, by scipy with located events."""
    p = motion.values
    y, events = np.array([0.0, 0.0, p["v_x0"], p["v_y0"]]), list[float]()
    is_stuck = hypot(p["v_x0"], p["v_y0"]) == 0.0
    ends = [*(t for t, _, _ in motion.forces[1:]), STOP]
    for force, end in zip(motion.forces, ends, strict=True):
        t = force[0]
        while t < end:
            if is_stuck:
                t = breakaway(motion, t, end, y, force)
                if t < end:
                    load = motion.load(t, y, force)
                    size = hypot(*load)
                    y = y + np.array([0.0, 0.0, *(KICK * (size - p["f"]) / (p["m"] * size) * load)])
                    events.append(t)
                    is_stuck, t = False, t + KICK
            else:
                t, y, is_stuck = slide(motion, t, end, y, force)
                if is_stuck:
                    events.append(t)
    return events, y


def breakaway(motion: DrivenMotion, t: float, end: float, y: np.ndarray, force: tuple[float, float, float]) -> float:
    """Return when the load exceeds the holding limit; `end` if it does not."""
    hold = motion.values["hold"]

    def excess(s: float) -> float:
        return float(hypot(*motion.load(s, y, force)) / hold - 1.0)

    grid = np.linspace(t, end, 4000)
    values = np.array([excess(s) for s in grid])
    above = np.flatnonzero(values > 0.0)
    before = values[: above[0]] if len(above) else values
    turns = before[1:-1][(before[1:-1] > before[:-2]) & (before[1:-1] >= before[2:])]
    if len(turns) and turns.max() > -NEAR_TIE * 10.0:
        raise NearTieError
    if abs(values[0]) < NEAR_TIE:
        raise NearTieError
    if not len(above):
        return end
    return t if above[0] == 0 else float(brentq(excess, grid[above[0] - 1], grid[above[0]], xtol=1e-15))


def slide(
    motion: DrivenMotion, t: float, end: float, y: np.ndarray, force: tuple[float, float, float]
) -> tuple[float, np.ndarray, bool]:
    """Return time and states where the body rests, or at the end, and whether it rests."""
    m, f = motion.values["m"], motion.values["f"]

    def rates(t: float, y: np.ndarray) -> list[float]:
        v = hypot(y[2], y[3])
        load = motion.load(t, y, force)
        return [y[2], y[3], (load[0] - f * y[2] / v) / m, (load[1] - f * y[3] / v) / m]

    def slow(_t: float, y: np.ndarray) -> float:
        return hypot(y[2], y[3]) - SLOW

    event: Any = slow
    event.terminal, event.direction = True, -1.0
    run = solve_ivp(rates, (t, end), y, "DOP853", rtol=1e-12, atol=1e-15, events=event)
    t, y = float(run.t[-1]), run.y[:, -1].copy()
    if run.status != 1:
        return end, y, False
    load, v = motion.load(t, y, force), hypot(y[2], y[3])
    size = hypot(*load)
    if size < f:
        ahead = m * (f * v + load @ y[2:]) / (f * f - size * size)
        return t + ahead, np.array([y[0], y[1], 0.0, 0.0]), True
    if size < motion.values["hold"]:
        raise NearTieError  # whether it passes zero exactly decides whether it sticks
    y[2:] = KICK * (size - f) / (m * size) * load  # nearly head-on
    return t + KICK, y, False


def compare(fmu: str | Path, motion: DrivenMotion) -> str:
    """Return how a run differs from the solution; empty if it does not."""
    events, y = solve(motion)
    run = harness.simulate(fmu, motion.values, stop=STOP, inputs=motion.inputs(), rtol=RTOL)
    times = [float(t) for t in run.events.t if t > 0.0]
    if len(times) != len(events):
        return f"{len(times)} events instead of {len(events)}"
    time_error = max((abs(a - b) for a, b in zip(times, events, strict=True)), default=0.0)
    position_error = max(abs(run["x"][-1] - y[0]), abs(run["y"][-1] - y[1]))
    return (
        f"events off by {time_error:.1e} s, position by {position_error:.1e} m"
        if max(time_error, position_error) > MAX_DRIVEN_ERROR
        else ""
    )


def compare_exchange(fmu: str | Path, motion: DrivenMotion, rtol: float) -> str:
    """Return how a run in model exchange by CVode differs from one in co-simulation; empty if it does not."""
    inputs = motion.inputs()
    run = harness.simulate(fmu, motion.values, stop=STOP, inputs=inputs, rtol=RTOL)
    types = [(name, float) for name in inputs]
    end = exchange(fmu, motion.values, STOP, rtol, np.array(list(zip(*inputs.values(), strict=True)), types))[-1]
    times = [float(t) for t in run.events.t if t > 0.0]
    if len(times) != end["events.count"]:
        return f"{end['events.count']} events in model exchange instead of {len(times)}"
    time_error = abs(end["events.t_last"] - times[-1]) if times else 0.0
    position_error = max(abs(run["x"][-1] - end["x"]), abs(run["y"][-1] - end["y"]))
    is_off = max(time_error, position_error) > MAX_DRIVEN_EXCHANGE_ERROR * rtol
    return (
        f"last event off by {time_error:.1e} s in model exchange, position by {position_error:.1e} m" if is_off else ""
    )


# ---- campaign


def main(arguments: list[str]) -> int:
    """Run both campaigns; return 1 if a motion differs or fails."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--driven", type=int, default=200)
    parser.add_argument("--exchange", type=int, default=1000)
    options = parser.parse_args(arguments)
    with temporary_directory() as folder:
        build_cache.kept_folder = build_cache.shared_folder = Path(folder)
        return run_campaign(options.scenes, options.driven, options.exchange)


def run_campaign(n_closed: int, n_driven: int, n_exchange: int) -> int:
    """Run this many motions of each kind; return 1 if one differs or fails."""
    puck = build_cache.build_once("puck", *NATIVE) / "puck.fmu"
    failures, largest, largest_exchanged = 0, np.zeros(4), np.zeros(2)
    for n, scene in enumerate(random_scenes(n_closed)):
        try:
            errors = errors_at_rest(puck, *scene)
        except harness.HarnessError as error:
            print(f"closed form {n}: {error}", flush=True)
            failures += 1
            continue
        largest = np.maximum(largest, errors)
        errors_in_exchange = exchange_errors(puck, *scene, rtol=EXCHANGE_RTOL) if n < n_exchange else (0.0, 0.0)
        if max(errors) > MAX_ERROR or max(errors_in_exchange) > MAX_EXCHANGE_ERROR:
            print(f"closed form {n} {scene}: {errors}, by model exchange {errors_in_exchange}", flush=True)
            failures += 1
        largest_exchanged = np.maximum(largest_exchanged, errors_in_exchange)
    print("largest errors of time and position in model exchange:", *(f"{e:.1f} rtol" for e in largest_exchanged))
    print("largest errors of time, position, speed and hold:", *(f"{error:.1e}" for error in largest), flush=True)
    file = build_cache.kept_folder / "driven.py"
    file.write_text(MODEL, encoding="utf-8")
    driven_fmu = next(build_cache.build_user_model(file, *NATIVE).rglob("driven.fmu"))
    near_ties = 0
    for seed in range(n_driven):
        motion = random_driven(seed)
        try:
            text = compare(driven_fmu, motion)
            text = text or (compare_exchange(driven_fmu, motion, EXCHANGE_RTOL) if seed < n_exchange else "")
        except NearTieError:
            near_ties += 1
            continue
        except harness.HarnessError as error:
            text = str(error)
        if text:
            print(f"driven {seed}: {text}", flush=True)
            failures += 1
    print(
        f"{n_closed} motions to rest and {n_driven} driven ones, of which {near_ties} near a tie: {failures} failures"
    )
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
