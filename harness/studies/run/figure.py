"""Figures of a run, one panel for each plot that its scene names; as a scene asks for them.

Where the body is stuck is shaded, changes of mode are marked, published values stand beside ours, and angles are in
degrees.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...results.quantity import PUBLISHED_UNITS, Quantity, display_unit
from ...results.step_sizes import published_mean_step
from ...results.style import (
    BLUE,
    GREEN,
    GREY,
    HEIGHT,
    LEGEND_ABOVE,
    ORANGE,
    WIDTH,
    Axes,
    axis_label,
    mask_undrawable,
    open_figure,
)
from ...running import runner
from ...running.description import read_description
from ...running.fmi2 import simulate
from ...running.trajectory import Trajectory

BESIDE = ("phase", "steps")  # on the right; what is over time stands on the left, one below the other
EDGES = np.array([[1.01, -0.01], [-0.01, 1.01]])  # of a time axis, from start and stop
SMOOTH = 1000  # points of a curve without corners, no two of them farther apart than twice the mean
MARKED = 100  # events: beyond, one cannot be told from the next
PEAKS = {"sample_0": 0, "x_0": 0, "sample_n": -1, "x_n": -1}  # published, and which of the turning points each is
LEVELS = {"velocity": "peak_speed", "acceleration": "peak_acceleration"}

HANDLE, LINE = 5, 75  # letters that a line beside its label takes, and that stand beside each other above a panel
LIFTED = 20  # points, of a title above the legend

Results = dict[str, Any]  # by the name of the analysis


@dataclass(frozen=True)
class PlottedRun:
    """A run with points enough for smooth curves, the `results` of its analyses, and the `published` figures."""

    run: Trajectory
    results: Results
    published: Mapping[str, Any]

    def unit(self, name: str) -> tuple[str, float]:
        """The unit in which an output is drawn, and its size in the output's own."""
        return display_unit(self.run.units[name])

    def values(self, name: str) -> np.ndarray:
        """An output (n,) as it is drawn."""
        values, (_, size) = mask_undrawable(self.run.columns[name]), self.unit(name)
        return values if size == 1 else values / size

    def figure(self, name: str) -> float | None:
        """A published figure in SI units, None where there is no such number."""
        found = self.published.get(name)
        value, unit = found if isinstance(found, tuple) else (found, "")
        return value * PUBLISHED_UNITS.get(unit, ("", 1.0))[1] if isinstance(value, int | float) else None


def draw(
    title: str,
    plots: Iterable[str],
    run: Trajectory,
    results: Results,
    path: Path,
    published: Mapping[str, Any] | None = None,
) -> None:
    """Save the figure of these plots; of an array every element, of a text nothing."""
    chosen = [each for name in plots for each in drawn(name, run)]
    columns = [names for right in (False, True) if (names := [name for name in chosen if (name in BESIDE) == right])]
    if not columns:
        return
    shown = PlottedRun(smooth(run), results, published or {})
    height = HEIGHT * max(2, *map(len, columns), 2)
    with open_figure(path, WIDTH * len(columns), height) as figure:
        figure.suptitle(f"{title}\n{run.settings_label}".strip(), fontsize=11)
        parts = figure.subfigures(1, len(columns), squeeze=False)[0]
        for part, names in zip(parts, columns, strict=True):
            over_time = names[0] not in BESIDE
            for axes, name in zip(part.subplots(len(names), sharex=over_time, squeeze=False)[:, 0], names, strict=True):
                PANELS[name](axes, shown) if name in PANELS else history(axes, shown, name)


def drawn(name: str, run: Trajectory) -> list[str]:
    """What is drawn for one plot that is named."""
    if name in PANELS or name in run.spec.motion_outputs:
        return [name]
    own = [each for each in run.columns if each == name or each.startswith(f"{name}[")]
    return [each for each in own if run.columns[each].dtype.kind != "U"]


def smooth(run: Trajectory) -> Trajectory:
    """The run with what the FMU says between its points, where these are far apart; that it is asked does not move
    it."""
    start, stop = run.time[[0, -1]].tolist()
    fine = np.diff(run.time).max() <= 2 * (stop - start) / SMOOTH
    if fine or run.failure or not runner.exposes_solver_steps(read_description(run.spec.fmu)):
        return run
    between = simulate(replace(run.spec, start=start, stop=stop, grid=(stop - start) / SMOOTH, follow=False, repeat=1))
    time, places = np.unique(np.append(run.time, between.time), return_index=True)
    columns = {name: np.append(column, between.columns[name])[places] for name, column in run.columns.items()}
    return replace(run, time=time, columns=columns)


def history(axes: Axes, shown: PlottedRun, name: str) -> None:
    """One output over time, or what plays its role."""
    run, role = shown.run, name
    name = run.spec.motion_outputs.get(role, role)
    values, (unit, size) = shown.values(name), shown.unit(name)
    style = "steps-post" if values.dtype.kind in "iu" else "default"
    axes.plot(run.time, values, color=BLUE, drawstyle=style)
    modes(axes, run)
    level = shown.figure(LEVELS.get(role, ""))
    if level is not None:
        axes.axhline(level / size, color=GREEN, linestyle=":", label="published peak")
    axes.set_title(run.descriptions[name])
    legend(axes)
    axes.set_ylabel(axis_label(name, unit))
    axes.set_xlabel("t [s]")
    axes.set_xlim(*EDGES @ run.time[[0, -1]])
    axes.label_outer()


def modes(axes: Axes, run: Trajectory) -> None:
    """Where friction holds, shaded; where a motion turns without a rest, a line."""
    if run.events is None:
        return
    ends = [*run.events.t.tolist(), float(run.time[-1])]
    turns = []
    for (begin, end), mode, before in zip(pairwise(ends), run.events.mode, [0, *run.events.mode], strict=False):
        if mode == 0:
            axes.axvspan(begin, end, color=GREY, alpha=0.15, linewidth=0, label="stuck")
        elif before == -mode:
            turns.append(begin)
    if 0 < len(turns) <= MARKED:
        t, y = np.repeat(turns, 3), np.tile([0.0, 1.0, np.nan], len(turns))  # one line: each alone would be measured
        place = axes.get_xaxis_transform()
        axes.plot(t, y, color=GREY, linewidth=0.5, linestyle=":", label="reversal", transform=place)


def position(axes: Axes, shown: PlottedRun) -> None:
    """Position over time, with the driver's if it is recorded, and the turning points if they were measured."""
    run, results = shown.run, shown.results
    if "x_driver" in run.columns:
        axes.plot(run.time, run.columns["x_driver"], color=ORANGE, linestyle="--", label="x_driver")
    if "decay" in results:
        decay = results["decay"]
        _, size = shown.unit(run.spec.motion_outputs["position"])
        axes.plot(decay.times, decay.positions / size, "o", color=ORANGE, fillstyle="none", label="turning points")
        for name, which in PEAKS.items():
            peak = shown.figure(name)
            if peak is not None:
                signed = np.copysign(peak / size, decay.positions[which])
                axes.plot(decay.times[which], signed, "+", color=GREEN, markersize=11, label="published")
        value = shown.figure(decay.result.name)
        if value is not None:
            top = envelope(decay, value) / size
            for side in (top, -top):
                axes.plot(decay.times, side, color=GREEN, linestyle=":", label="published")
    first, period = shown.figure("first_slip"), shown.figure("period")
    if first is not None and period is not None:
        for at in np.arange(first, run.time[-1], period):
            axes.axvline(at, color=GREEN, linestyle=":", label="published slip")
    history(axes, shown, "position")


def envelope(decay: Any, value: float) -> np.ndarray:
    """The sizes of the turning points (n,) from the first on by the `value` that a decay gives: zeta, f or T_f."""
    share, sizes = np.linspace(0, 1, len(decay.times)), np.abs(decay.positions)
    if decay.result.name == "zeta":
        return sizes[0] * np.exp(-2 * np.pi * value / np.sqrt(1 - value * value) * decay.cycles * share)
    return sizes[0] - (sizes[0] - sizes[-1]) * value / decay.result.value * share


def legend(axes: Axes) -> None:
    """What there is to tell, each once, above the panel, where it hides nothing."""
    handles, labels = axes.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    if once:
        axes.legend(once.values(), once, **LEGEND_ABOVE, ncols=len(once))
        title = axes.get_title(loc="left")
        if len(title) + sum(len(each) + HANDLE for each in once) > LINE:
            axes.set_title(title, pad=LIFTED)


def phase(axes: Axes, shown: PlottedRun) -> None:
    """Velocity over position."""
    motion = shown.run.spec.motion_outputs
    x, v = motion["position"], motion["velocity"]
    axes.plot(shown.values(x), shown.values(v), color=BLUE)
    axes.set_title("phase plane")
    axes.set_xlabel(axis_label(x, shown.unit(x)[0]))
    axes.set_ylabel(axis_label(v, shown.unit(v)[0]))


def steps(axes: Axes, shown: PlottedRun) -> None:
    """Size of the solver's own steps over the time where they begin, with the mean if it was measured."""
    run = shown.run
    assert run.steps is not None  # the scene was checked for it
    axes.semilogy(run.steps.t[:-1], run.steps.h, color=BLUE, linewidth=0.6, marker=".", markersize=3)
    if "steps" in shown.results:
        found = {
            "mean": (published_mean_step(run.steps.h), ORANGE, "--"),
            "published": (shown.figure("mean_step"), GREEN, ":"),
        }
        for word, (mean, color, style) in found.items():
            if mean is not None:
                told = " ".join(Quantity("mean_step", mean, "s", "").formatted())
                axes.axhline(mean, color=color, linestyle=style, label=f"{word} {told}")
    axes.set_title("step size of the solver")
    legend(axes)
    axes.set_xlim(*EDGES @ run.time[[0, -1]])
    axes.set_xlabel("t [s]")
    axes.set_ylabel("h [s]")


Panel = Callable[[Axes, PlottedRun], None]
PANELS: dict[str, Panel] = {"position": position, "phase": phase, "steps": steps}
