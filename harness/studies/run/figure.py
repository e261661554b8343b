"""Figures of a run, one panel for each plot that its scene names; as a scene asks for them."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ...results.style import BLUE, HEIGHT, ORANGE, WIDTH, Axes, drawable, label, sheet
from ...running.run import Run

BESIDE = ("phase", "steps")  # on the right; what is over time stands on the left, one below the other
EDGES = np.array([[1.01, -0.01], [-0.01, 1.01]])  # of a time axis, from start and stop

Results = dict[str, Any]  # by the name of the analysis


def draw(title: str, plots: Iterable[str], run: Run, results: Results, path: Path) -> None:
    """Save the figure of these plots as a PNG file; of an array every element, of a text nothing."""
    chosen = [each for name in plots for each in drawn(name, run)]
    columns = [names for right in (False, True) if (names := [name for name in chosen if (name in BESIDE) == right])]
    if not columns:
        return
    height = HEIGHT * max(2, *map(len, columns), 2)
    with sheet(path, WIDTH * len(columns), height) as figure:
        figure.suptitle(f"{title}\n{run.setting}", fontsize=11)
        parts = figure.subfigures(1, len(columns), squeeze=False)[0]
        for part, names in zip(parts, columns, strict=True):
            over_time = names[0] not in BESIDE
            for axes, name in zip(part.subplots(len(names), sharex=over_time, squeeze=False)[:, 0], names, strict=True):
                PANELS[name](axes, run, results) if name in PANELS else history(axes, run, name)


def drawn(name: str, run: Run) -> list[str]:
    """What is drawn for one plot that is named."""
    if name in PANELS or name in run.wanted.motion:
        return [name]
    own = [each for each in run.columns if each == name or each.startswith(f"{name}[")]
    return [each for each in own if run.columns[each].dtype.kind != "U"]


def history(axes: Axes, run: Run, name: str) -> None:
    """One output over time, or what plays its role."""
    name = run.wanted.motion.get(name, name)
    style = "steps-post" if run.columns[name].dtype.kind in "iu" else "default"
    axes.plot(run.time, drawable(run.columns[name]), color=BLUE, drawstyle=style, label=name)
    axes.set_title(run.descriptions[name])
    axes.set_ylabel(label(name, run.units[name]))
    axes.set_xlabel("t [s]")
    axes.set_xlim(*EDGES @ run.time[[0, -1]])
    axes.label_outer()


def position(axes: Axes, run: Run, results: Results) -> None:
    """Position over time, with the driver's if it is recorded, and the turning points if they were measured."""
    history(axes, run, "position")
    if "x_driver" in run.columns:
        axes.plot(run.time, run.columns["x_driver"], color=ORANGE, linestyle="--", label="x_driver")
    if "decay" in results:
        decay = results["decay"]
        axes.plot(decay.times, decay.positions, "o", color=ORANGE, fillstyle="none", label="turning points used")
    if len(axes.lines) > 1:
        axes.legend()


def phase(axes: Axes, run: Run, results: Results) -> None:
    """Velocity over position."""
    x, v = run.wanted.motion["position"], run.wanted.motion["velocity"]
    axes.plot(drawable(run.columns[x]), drawable(run.columns[v]), color=BLUE)
    axes.set_title("phase plane")
    axes.set_xlabel(label(x, run.units[x]))
    axes.set_ylabel(label(v, run.units[v]))


def steps(axes: Axes, run: Run, results: Results) -> None:
    """Size of the solver's own steps over the time where they begin, with the mean if it was measured."""
    assert run.steps is not None  # the scene was checked for it
    axes.semilogy(run.steps.t[:-1], run.steps.h, color=BLUE, linewidth=0.6, marker=".", markersize=3)
    axes.set_title("step size of the solver")
    if "steps" in results:
        mean, told = results["steps"].mean, " ".join(results["steps"].quantities[1].told())
        axes.axhline(mean, color=ORANGE, linestyle="--")
        axes.set_title(f"step size of the solver (dashed: mean {told})")
    axes.set_xlim(*EDGES @ run.time[[0, -1]])
    axes.set_xlabel("t [s]")
    axes.set_ylabel("h [s]")


Panel = Callable[[Axes, Run, Results], None]
PANELS: dict[str, Panel] = {"position": position, "phase": phase, "steps": steps}
