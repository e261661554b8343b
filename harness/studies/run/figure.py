"""Figure of a run, with one panel for each plot that the scene names.

Sticking is shaded, reversals are marked, known values are drawn in green, and angles are in degrees.  With several
contacts, only the panels of their friction forces and modes are shaded; a panel below shows when each contact sticks.
Lookup tables of the FMU are drawn in the right column, with the values of the run.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...results.quantity import PUBLISHED_UNITS, Quantity, display_unit, published_mean_step
from ...results.style import (
    BLUE,
    GREEN,
    GREY,
    HEIGHT,
    LEGEND_ABOVE,
    ORANGE,
    WIDTH,
    Axes,
    Figure,
    axis_label,
    mask_undrawable,
    set_size,
)
from ...scenes.scene import MAX_DEFAULT_PLOTS, KnownValues, is_panel
from ...simulation.fmu_archive import exposes_solver_steps, read_description
from ...simulation.model_data import LookupTable, read_model_data
from ...simulation.plot import contact_of, draw_sticking, draw_table
from ...simulation.runner import run_own_fmu
from ...simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from .result import RunResult

RIGHT_COLUMN = ("phase", "steps")  # plots in the right column; plots over time are in the left column
CONTACT_HEIGHT = 0.12  # of a row of the panel with all contacts, in heights of a panel
PHASE_HEIGHT = 1.8  # of the phase plane, which is a square, in heights of a panel
LIMITS = np.array([[1.01, -0.01], [-0.01, 1.01]])  # limits of a time axis from start and stop, with a margin of 1 %
CURVE_POINTS = 1000  # points of a smooth curve
MAX_MARKED = 100  # reversals that are marked; more would be indistinguishable
KNOWN_PEAKS = {"sample_0": 0, "x_0": 0, "sample_n": -1, "x_n": -1}  # known value and index of its turning point
PEAK_LEVELS = {"velocity": "peak_speed", "acceleration": "peak_acceleration"}

HANDLE_WIDTH, LINE_WIDTH = 5, 75  # in characters: legend handle, width of a panel
TITLE_PAD = 20  # in points: padding of a title above a legend


@dataclass(frozen=True)
class PlottedRun:
    """A run with enough points for smooth curves, the `results` of its analyses, and the `known_values`."""

    run: Trajectory
    results: dict[str, Any]
    known_values: KnownValues | None

    @property
    def kind(self) -> str:
        """Return the kind of the known values, for labels."""
        return self.known_values.kind if self.known_values else ""

    def unit(self, name: str) -> tuple[str, float]:
        """Return the display unit of an output and its size in the unit of the output."""
        return display_unit(self.run.units[name])

    def values(self, name: str) -> np.ndarray:
        """Return an output (n,) in its display unit."""
        values, (_, size) = mask_undrawable(self.run.columns[name]), self.unit(name)
        return values if size == 1 else values / size

    def known_value(self, name: str) -> float | None:
        """Return a known value in SI units, or None."""
        entry = self.known_values.values.get(name) if self.known_values else None
        value, unit = entry if isinstance(entry, tuple) else (entry, "")
        return value * PUBLISHED_UNITS.get(unit, ("", 1.0))[1] if isinstance(value, int | float) else None


def draw(run: "RunResult", title: str, plots: Iterable[str], figure: Figure) -> None:
    """Draw the named plots; arrays are drawn by element, strings are skipped."""
    columns: list[list[Any]] = [*arrange_columns([panel for name in plots for panel in expand_plot(name, run)], run)]
    if not columns:
        return
    if tables := read_model_data(run.spec.fmu).tables:
        right = columns.pop() if is_right(columns[-1][0], run) else []
        columns.append([*right, *tables])
    plotted_run = PlottedRun(refine(run), run._analyses, run._known_values)
    # with several contacts, each column over time ends with a panel of all contacts
    below = [len(run.contacts) * CONTACT_HEIGHT + 0.2] if len(run.contacts) > 1 else []
    ratios = [
        [PHASE_HEIGHT if name == "phase" and is_right(name, run) else 1.0 for name in names]
        + below * (not is_right(names[0], run))
        for names in columns
    ]
    set_size(figure, WIDTH * len(columns), HEIGHT * max(2, *map(sum, ratios), 2))
    figure.suptitle(f"{title}\n{run.settings_label}".strip(), fontsize=11)
    parts = figure.subfigures(1, len(columns), squeeze=False)[0]
    for part, names, heights in zip(parts, columns, ratios, strict=True):
        over_time = not is_right(names[0], run)
        grid = part.subplots(len(heights), sharex=over_time, squeeze=False, height_ratios=heights)[:, 0]
        for axes, name in zip(grid, names, strict=False):
            if isinstance(name, LookupTable):
                draw_table(axes, name, name.y_with(run.parameters), BLUE)
                continue
            PANELS.get(name if is_panel(name, run.columns) else "", plot_output)(axes, plotted_run, name)
        if len(heights) > len(names):
            plot_sticking(grid[-1], plotted_run)


def is_right(panel: str | LookupTable, run: Trajectory) -> bool:
    """Return whether a panel belongs to the right column."""
    return isinstance(panel, LookupTable) or (panel in RIGHT_COLUMN and is_panel(panel, run.columns))


def arrange_columns(panels: list[str], run: Trajectory) -> list[list[str]]:
    """Return the panels of the left and the right column; many panels over time take both if there are no others."""
    over_time, others = ([name for name in panels if is_right(name, run) == right] for right in (False, True))
    if len(over_time) > MAX_DEFAULT_PLOTS and not others:
        half = (len(over_time) + 1) // 2
        return [over_time[:half], over_time[half:]]
    return [names for names in (over_time, others) if names]


def expand_plot(name: str, run: Trajectory) -> list[str]:
    """Return the panels of one named plot."""
    if is_panel(name, run.spec.outputs):
        return [name]
    names = [column for column in run.columns if column == name or column.startswith(f"{name}[")]
    return [column for column in names if run.columns[column].dtype.kind != "U"]


def refine(run: Trajectory) -> Trajectory:
    """Return the run with additional points if its points are far apart.

    Additional communication points do not change the internal steps of the FMU.
    """
    start, stop = run.time[[0, -1]].tolist()
    is_fine = np.diff(run.time).max() <= 2 * (stop - start) / CURVE_POINTS
    if is_fine or run.failure or not exposes_solver_steps(read_description(run.spec.fmu)):
        return run
    fine_run = run_own_fmu(
        replace(run.spec, start=start, stop=stop, grid=(stop - start) / CURVE_POINTS, follow=False, repeat=1)
    )
    time, order = np.unique(np.append(run.time, fine_run.time), return_index=True)
    columns = {name: np.append(column, fine_run.columns[name])[order] for name, column in run.columns.items()}
    return replace(run, time=time, columns=columns)


def plot_output(axes: Axes, plotted_run: PlottedRun, name: str) -> None:
    """Plot an output, or the output with a role, over time."""
    run = plotted_run.run
    role = name if is_panel(name, run.columns) else ""
    name = run.motion_outputs.get(role, name)
    values, (unit, size) = plotted_run.values(name), plotted_run.unit(name)
    style = "steps-post" if values.dtype.kind in "iu" else "default"
    axes.plot(run.time, values, color=BLUE, drawstyle=style)
    mark_modes(axes, run, contact_of(run, name))
    level = plotted_run.known_value(PEAK_LEVELS.get(role, ""))
    if level is not None:
        axes.axhline(level / size, color=GREEN, linestyle=":", label=f"{plotted_run.kind} peak")
    axes.set_title(run.descriptions[name])
    add_legend(axes)
    axes.set_ylabel(axis_label(name, unit))
    axes.set_xlabel("t [s]")
    axes.set_xlim(*LIMITS @ run.time[[0, -1]])
    axes.label_outer()


def mark_modes(axes: Axes, run: Trajectory, contact: str) -> None:
    """Shade the sticking of a contact, and mark its reversals without sticking."""
    if run.events is None or not contact:
        return
    for begin, end in run.sticking[contact]:
        axes.axvspan(begin, end, color=GREY, alpha=0.15, linewidth=0, label="stuck")
    times, modes = run.events.changes(contact)
    reversals = times[1:][(modes[1:] != 0) & (modes[1:] == -modes[:-1])]
    if 0 < len(reversals) <= MAX_MARKED:
        # one artist for all reversals, because the layout measures every artist
        t, y = np.repeat(reversals, 3), np.tile([0.0, 1.0, np.nan], len(reversals))
        transform = axes.get_xaxis_transform()
        axes.plot(t, y, color=GREY, linewidth=0.5, linestyle=":", label="reversal", transform=transform)


def plot_sticking(axes: Axes, plotted_run: PlottedRun) -> None:
    """Plot a row for each contact that shows when it sticks."""
    draw_sticking(axes, plotted_run.run, GREY)
    axes.set_title("sticking of each contact")
    axes.set_xlabel("t [s]")
    axes.set_xlim(*LIMITS @ plotted_run.run.time[[0, -1]])
    axes.label_outer()


def plot_position(axes: Axes, plotted_run: PlottedRun, name: str) -> None:
    """Plot position over time, with driver position and turning points if available."""
    run, results = plotted_run.run, plotted_run.results
    if "x_driver" in run.columns:
        axes.plot(run.time, run.columns["x_driver"], color=ORANGE, linestyle="--", label="x_driver")
    if "decay" in results:
        decay = results["decay"]
        _, size = plotted_run.unit(run.motion_outputs["position"])
        axes.plot(decay.times, decay.positions / size, "o", color=ORANGE, fillstyle="none", label="turning points")
        for peak_name, index in KNOWN_PEAKS.items():
            peak = plotted_run.known_value(peak_name)
            if peak is not None:
                position = np.copysign(peak / size, decay.positions[index])
                axes.plot(decay.times[index], position, "+", color=GREEN, markersize=11, label=plotted_run.kind)
        value = plotted_run.known_value(decay.result.name)
        if value is not None:
            top = envelope(decay, value) / size
            for side in (top, -top):
                axes.plot(decay.times, side, color=GREEN, linestyle=":", label=plotted_run.kind)
    first, period = plotted_run.known_value("first_slip"), plotted_run.known_value("period")
    if first is not None and period is not None:
        for at in np.arange(first, run.time[-1], period):
            axes.axvline(at, color=GREEN, linestyle=":", label=f"{plotted_run.kind} slip")
    plot_output(axes, plotted_run, name)


def envelope(decay: Any, value: float) -> np.ndarray:
    """Return the amplitudes (n,) of the turning points predicted by `value`: zeta, f or T_f."""
    share, sizes = np.linspace(0, 1, len(decay.times)), np.abs(decay.positions)
    if decay.result.name == "zeta":
        return sizes[0] * np.exp(-2 * np.pi * value / np.sqrt(1 - value * value) * decay.cycles * share)
    return sizes[0] - (sizes[0] - sizes[-1]) * value / decay.result.value * share


def add_legend(axes: Axes) -> None:
    """Put a legend above the panel, without the labels that the legend of a panel before it has."""
    legends = filter(None, (panel.get_legend() for panel in axes.figure.figure.axes if panel is not axes))
    shown_labels = {text.get_text() for legend in legends for text in legend.get_texts()}
    handles, labels = axes.get_legend_handles_labels()
    entries = {label: handle for label, handle in zip(labels, handles, strict=True) if label not in shown_labels}
    if entries:
        axes.legend(entries.values(), entries, **LEGEND_ABOVE, ncols=len(entries))
        title = axes.get_title(loc="left")
        if len(title) + sum(len(text) + HANDLE_WIDTH for text in entries) > LINE_WIDTH:
            axes.set_title(title, pad=TITLE_PAD)


def plot_phase_plane(axes: Axes, plotted_run: PlottedRun, name: str) -> None:
    """Plot velocity over position in a square, in which a free oscillation is a circle."""
    motion = plotted_run.run.motion_outputs
    x, v = motion["position"], motion["velocity"]
    axes.plot(plotted_run.values(x), plotted_run.values(v), color=BLUE)
    axes.set_title("phase plane")
    axes.set_box_aspect(1)
    axes.set_anchor("N")
    axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel(axis_label(x, plotted_run.unit(x)[0]))
    axes.set_ylabel(axis_label(v, plotted_run.unit(v)[0]))


def plot_steps(axes: Axes, plotted_run: PlottedRun, name: str) -> None:
    """Plot the internal step sizes over the start times of the steps, with their mean if it was measured."""
    run = plotted_run.run
    assert run.steps is not None  # ensured by check_steps()
    axes.semilogy(run.steps.t[:-1], run.steps.h, color=BLUE, linewidth=0.6, marker=".", markersize=3)
    if "steps" in plotted_run.results:
        means = {
            "mean": (published_mean_step(run.steps.h), ORANGE, "--"),
            plotted_run.kind: (plotted_run.known_value("mean_step"), GREEN, ":"),
        }
        for word, (mean, color, style) in means.items():
            if mean is not None:
                label_text = " ".join(Quantity("mean_step", mean, "s", "").format())
                axes.axhline(mean, color=color, linestyle=style, label=f"{word} {label_text}")
    axes.set_title("step size of the solver")
    add_legend(axes)
    axes.set_xlim(*LIMITS @ run.time[[0, -1]])
    axes.set_xlabel("t [s]")
    axes.set_ylabel("h [s]")


Panel = Callable[[Axes, PlottedRun, str], None]
PANELS: dict[str, Panel] = {"position": plot_position, "phase": plot_phase_plane, "steps": plot_steps}
