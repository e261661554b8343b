"""Draw the synthetic records docs/records/pulled_block.csv and sled.csv.

The motion is integrated from event to event by scipy (benchmarks/references/event_located.py), which is
independent of the FMUs. The sensors have noise, steps and irregular intervals; each record lacks one value.

    python docs/make_records.py FOLDER
"""

import sys
from collections.abc import Sequence
from math import exp
from pathlib import Path
from random import Random

import numpy as np

from benchmarks.references.event_located import HybridProblem, StateVector, solve

G = 9.81  # m/s2
RTOL, ATOL = 1e-11, 1e-13


class PulledBlock(HybridProblem):
    """Block that a motor pulls over a table through a spring, with friction mu_s at rest and mu_d while it slides."""

    start, stop, first = (0.0, 0.0), 8.0, (0,)
    m, k, v_driver = 1.25, 180.0, 0.020
    mu_s, mu_d = 0.42, 0.31

    def force(self, t: float, x: float) -> float:
        """Return the force of the spring."""
        return self.k * (self.v_driver * t - x)

    def holding_force(self) -> float:
        """Return the largest friction force at rest."""
        return self.mu_s * self.m * G

    def sliding_force(self, speed: float) -> float:
        """Return the friction force at a speed."""
        return self.mu_d * self.m * G

    def rates(self, t: float, y: StateVector, modes: list[int]) -> list[float]:
        """Return velocity and acceleration."""
        x, v = y
        if modes[0] == 0:
            return [0.0, 0.0]
        return [v, (self.force(t, x) - modes[0] * self.sliding_force(abs(v))) / self.m]

    def contacts(self, t: float, y: StateVector, modes: list[int]) -> list[tuple[float, float, float]]:
        """Return the velocity, the force of the spring and the largest friction force at rest."""
        return [(y[1], self.force(t, y[0]), self.holding_force())]

    def stop_slip(self, y: np.ndarray, modes: list[int]) -> None:
        """Set the speed of a stuck block to zero."""
        if modes[0] == 0:
            y[1] = 0.0


class StribeckSled(PulledBlock):
    """Sled whose friction falls from f_s at rest to f_d at high speed, with the speed v_s."""

    stop = 12.0
    m, k, v_driver = 12.5, 742.5, 0.034
    f_s, f_d, v_s = 105.0, 62.0, 0.15

    def holding_force(self) -> float:
        """Return the largest friction force at rest."""
        return self.f_s

    def sliding_force(self, speed: float) -> float:
        """Return the friction force at a speed."""
        return self.f_d + (self.f_s - self.f_d) * exp(-speed / self.v_s)


def draw_clock(rate: float, stop: float, random: Random) -> list[float]:
    """Return times in s at irregular intervals, in whole ms, from 0 to `stop`; `rate` in Hz is the mean."""
    times = [0.0]
    while times[-1] + 1.5 / rate < stop:
        times.append(round(times[-1] + random.uniform(0.7, 1.3) / rate, 3))
    return times


def measure(value: float, noise: float, step: float, random: Random) -> float:
    """Return the reading of a sensor with noise and steps, all in the same unit."""
    return round((value + random.gauss(0.0, noise)) / step) * step


def draw_pulled_block() -> str:
    """Return the text of a record of a load cell and a laser."""
    problem, random = PulledBlock(), Random(20261123)
    times = draw_clock(50.0, problem.stop, random)
    x = integrate(problem, times)
    lines = [
        "# Block on a table, pulled through a spring by a motor. Synthetic record, drawn by docs/make_records.py",
        "# block 1.250 kg; motor 20 mm/s; force: load cell, steps of 0.02 N; position: laser, steps of 0.05 mm",
        "time [ms],force [N],position [mm]",
    ]
    for i, (t, at) in enumerate(zip(times, x, strict=True)):
        force = measure(problem.force(t, at), 0.06, 0.02, random)
        position = measure(1e3 * at, 0.10, 0.05, random)
        lines.append(f"{1e3 * t:.0f},{force:.2f},{'NaN' if i == 137 else f'{position:.2f}'}")
    return "\n".join(lines) + "\n"


def draw_sled() -> str:
    """Return the text of a record of a laser."""
    problem, random = StribeckSled(), Random(20261124)
    times = draw_clock(40.0, problem.stop, random)
    lines = [
        "# Sled, pulled through a spring. Synthetic record, drawn by docs/make_records.py",
        "# sled 12.5 kg; motor 34 mm/s; spring 742.5 N/m; laser in steps of 0.5 mm",
        "time [s],laser [mm]",
    ]
    for i, (t, at) in enumerate(zip(times, integrate(problem, times), strict=True)):
        lines.append(f"{t:.3f},{'NaN' if i == 200 else f'{measure(1e3 * at, 0.8, 0.5, random):.1f}'}")
    return "\n".join(lines) + "\n"


def integrate(problem: HybridProblem, times: Sequence[float]) -> list[float]:
    """Return the positions (n,) in m at the times in s."""
    states, _ = solve(problem, times, "DOP853", RTOL, ATOL)
    return [float(x) for x in states[:, 0]]


RECORDS = {"pulled_block.csv": draw_pulled_block, "sled.csv": draw_sled}


if __name__ == "__main__":
    for name, draw in RECORDS.items():
        (Path(sys.argv[1]) / name).write_text(draw(), encoding="utf-8")
