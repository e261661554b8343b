"""Plots of a trajectory for interactive work; the command `run` draws the panels that a scene names."""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from ..results.files import column_heading
from .fmu_archive import read_description
from .model_data import LookupTable
from .variable_values import variable_unit

PANEL = (7.0, 1.7)  # inches, width and height
MAX_PANELS = 8  # of a plot without named outputs
BAR = 0.7  # height of the bars of one contact, whose rows are 1 high


def draw_panels(figure: Any, run: Any, names: Sequence[str], inputs: Sequence[str], x: str | None = None) -> np.ndarray:
    """Draw outputs and input signals over time, or over another output.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    run : Signals
        The signals, whose module imports this one; with several contacts, a further panel shows when each of them
        sticks.
    names, inputs : sequence of str
        Recorded outputs, and columns of the table of input signals.
    x : str, optional
        Output of the horizontal axis instead of time.

    Returns
    -------
    ndarray
        The axes, one for each panel.
    """
    width, height = PANEL
    has_contacts = len(run.contacts) > 1 and x is None
    count = len(names) + len(inputs) + has_contacts
    figure.set_size_inches(width, height * (count if x is None else 2 * count) + 0.5)
    figure.set_layout_engine("constrained")
    panels: np.ndarray = figure.subplots(count, sharex=True, squeeze=False)[:, 0]
    for panel, name in zip(panels, names, strict=False):
        plot_output(panel, run, name, x)
        panel.set_xlabel("")
    for panel, name in zip(panels[len(names) :], inputs, strict=False):
        unit = next(variable_unit(variable) for variable in declared_variables(run) if variable.name == name)
        panel.plot(run.spec.inputs["time"], run.spec.inputs[name])
        panel.set_ylabel(column_heading(name, unit))
    if has_contacts:
        draw_sticking(panels[-1], run, "0.5")
        panels[-1].set_ylabel("sticking")
    panels[-1].set_xlabel("time [s]" if x is None else column_heading(x, run.units[x]))
    if x is None:
        panels[-1].set_xlim(run.time[0], run.time[-1])
    figure.suptitle(run.name)
    return panels


def plot_output(axes: Any, run: Any, name: str, x: str | None = None) -> None:
    """Plot an output over time, with its times of sticking, or over another output."""
    values, across = run.columns[name], run.time if x is None else run.columns[x]
    axes.plot(across, values, drawstyle="steps-post" if values.dtype.kind in "iu" and x is None else "default")
    axes.set_ylabel(column_heading(name, run.units[name]))
    axes.set_xlabel("time [s]" if x is None else column_heading(x, run.units[x]))
    for begin, end in run.sticking.get(contact_of(run, name), ()) if x is None else ():
        axes.axvspan(begin, end, color="0.5", alpha=0.15, linewidth=0)


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


def draw_table(axes: Any, table: LookupTable, y: Sequence[float], color: str, label: str | None = None) -> None:
    """Draw the points of a lookup table, with values of y, and the curve through them."""
    axes.plot(*table.curve(y), color=color, linewidth=1.2, label=label)
    axes.plot(table.x, y, ".", color=color, markersize=5)
    axes.set_title(f"table {table.name}")
    axes.set_xlabel(column_heading("argument", table.unit_x))
    axes.set_ylabel(column_heading(table.name, table.unit_y))


def choose_plotted(run: Any) -> tuple[str, ...]:
    """Return the outputs that are plotted if none is named: numbers, at most MAX_PANELS."""
    numeric = [name for name, column in run.columns.items() if column.dtype.kind != "U"]
    return choose_outputs(numeric, run.contacts, MAX_PANELS)


def choose_outputs(outputs: Sequence[str], contacts: Collection[str], count: int) -> tuple[str, ...]:
    """Return the first outputs, at most `count`, with preference for friction forces."""
    forces = [name for name in outputs if name in contacts][:count]
    others = [name for name in outputs if name not in contacts][: count - len(forces)]
    return tuple(name for name in outputs if name in forces or name in others)


def list_inputs(run: Any) -> list[str]:
    """Return the input signals of a run that are plotted; none of signals from a file."""
    spec = getattr(run, "spec", None)
    return [name for name in spec.inputs if name != "time" and name not in run.columns] if spec else []


def contact_of(run: Any, name: str) -> str:
    """Return the contact whose sticking is shown in the panel of an output; empty if there is none.

    It is the only contact of the model, or the contact whose friction force or mode the output is.
    """
    if len(run.contacts) == 1:
        return str(run.contacts[0])
    mode_names = run.events.mode_names if run.events else {}
    return next((contact for contact in run.contacts if name in (contact, mode_names.get(contact))), "")
