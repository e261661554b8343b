"""Plots of a trajectory for interactive work; the studies draw the figures of result folders."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..results.files import column_heading
from .fmu_archive import read_description
from .variable_values import variable_unit

PANEL = (7.0, 1.7)  # inches, width and height
BAR = 0.7  # height of the bars of one contact, whose rows are 1 high


def plot(run: Any, names: Sequence[str], inputs: Sequence[str]) -> np.ndarray:
    """Plot outputs and input signals over time with pyplot, so that notebooks show the figure.

    Parameters
    ----------
    run : Trajectory
        The run, whose module imports this one; with several contacts, a further panel shows when each of them sticks.
    names, inputs : sequence of str
        Recorded outputs, and columns of the table of input signals.

    Returns
    -------
    ndarray
        The axes, one for each panel.
    """
    import matplotlib.pyplot as plt

    width, height = PANEL
    has_contacts = len(run.contacts) > 1
    count = len(names) + len(inputs) + has_contacts
    figure, axes = plt.subplots(
        count, sharex=True, squeeze=False, figsize=(width, height * count + 0.5), layout="constrained"
    )
    panels: np.ndarray = axes[:, 0]
    for panel, name in zip(panels, names, strict=False):
        values = run.columns[name]
        panel.plot(run.time, values, drawstyle="steps-post" if values.dtype.kind in "iu" else "default")
        panel.set_ylabel(column_heading(name, run.units[name]))
        for begin, end in run.sticking.get(run.contact_of(name), ()):
            panel.axvspan(begin, end, color="0.5", alpha=0.15, linewidth=0)
    for panel, name in zip(panels[len(names) :], inputs, strict=False):
        unit = next(variable_unit(variable) for variable in declared_variables(run) if variable.name == name)
        panel.plot(run.spec.inputs["time"], run.spec.inputs[name])
        panel.set_ylabel(column_heading(name, unit))
    if has_contacts:
        draw_sticking(panels[-1], run, "0.5")
        panels[-1].set_ylabel("sticking")
    panels[-1].set_xlabel("time [s]")
    panels[-1].set_xlim(run.time[0], run.time[-1])
    figure.suptitle(run.spec.model)
    return panels


def declared_variables(run: Any) -> Any:
    """Return the variables of the FMU of a run."""
    return read_description(run.spec.fmu, lenient=True).modelVariables


def draw_sticking(axes: Any, run: Any, color: str) -> None:
    """Draw a row of bars for each contact, which show when it sticks; the first contact is at the top."""
    for row, intervals in enumerate(run.sticking.values()):
        bars = [(begin, end - begin) for begin, end in intervals]
        axes.broken_barh(bars, (row - 0.5 * BAR, BAR), color=color, alpha=0.5, linewidth=0, zorder=2)
    axes.set_yticks(range(len(run.contacts)), run.contacts)
    axes.set_ylim(len(run.contacts) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
