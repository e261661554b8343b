"""Work-precision figures: run time and right-hand side evaluations over the error, for every solver."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ...references.certified_reference import ReferenceCase
from ...results.style import GREY, METHOD_COLOURS, WIDTH, open_figure
from .law_deviations import LawDeviation
from .study import CS, FMPY, FMU, ME, Study

TOOLS: dict[str, dict[str, Any]] = {
    FMU: {"linestyle": "-", "marker": "o", "markersize": 4},
    FMPY: {"linestyle": ":", "marker": ".", "markersize": 4},
    CS: {"linestyle": "", "marker": "P", "markersize": 8, "fillstyle": "none"},
    ME: {"linestyle": "-.", "marker": "D", "markersize": 4},
    "scipy": {"linestyle": "--", "marker": "s", "markersize": 4, "fillstyle": "none"},
    "cvode": {"linestyle": "--", "marker": "^", "markersize": 5, "fillstyle": "none"},
}
COSTS = {"seconds": "run time [s]", "evaluations": "right-hand side and Jacobian evaluations"}
CHATTERING: dict[str, Any] = {"linestyle": "-", "marker": "x", "markersize": 4, "linewidth": 0.7}
FILL = {FMU: "full"}  # of the star marker for a closed form
LEGEND = (
    "FMU: code of the FMU in this process; fmpy: FMU through fmpy\n"
    "FMI 3.0 through fmpy: co-simulation (CS) with default settings, model exchange (ME) with fmpy's CVode"
)
FLOOR = 2.0**-53  # smaller errors are drawn at this value


def draw(study: Study, laws: Sequence[LawDeviation], path: Path) -> None:
    """Save the figure of a study, with one row per law.

    Laws that chatter are drawn in the first row, with their error against true stick and slip.
    """
    cases = [case for case in study.cases if not case.is_chattering]
    shortcuts = [case for case in study.cases if case.is_chattering]
    with open_figure(path, 2 * WIDTH + 1.5, 0.8 + 3.6 * len(cases)) as figure:
        figure.suptitle(f"{study.model}: work-precision\n{LEGEND}", fontsize=11)
        panels = figure.subplots(len(cases), 2, squeeze=False, sharex=True, sharey="col")
        for case, row in zip(cases, panels, strict=True):
            row_cases = [case, *(shortcuts if case is cases[0] else [])]
            for axes, (cost, name) in zip(row, COSTS.items(), strict=True):
                for row_case in row_cases:
                    plot_curves(axes, study, row_case, cost)
                for law in laws:
                    if law.largest and law.case in [row_case.name for row_case in row_cases]:
                        axes.axvline(law.largest, color=GREY, linestyle="-.", label="error of the law")
                axes.set_title(case.law)
                axes.set_ylabel(name)
                axes.tick_params(labelbottom=True)
        for axes in panels[-1]:
            axes.set_xlabel("largest error, relative to the largest value")
        lines = {line.get_label(): line for axes in panels.flat for line in axes.lines}
        figure.legend(lines.values(), lines.keys(), loc="outside right upper")


def plot_curves(axes: Axes, study: Study, case: ReferenceCase, cost: str) -> None:
    """Plot every solver of a case, log-log; failed runs are gaps."""
    for tool, method in study.solvers(case):
        is_duplicate = tool in (FMPY, CS) and (
            cost != "seconds" or case.is_chattering
        )  # the same number of evaluations
        if is_duplicate or not study.curve(case, tool, method):
            continue
        points = [p for p in study.points if (p.case, p.tool, p.method) == (case.name, tool, method)]
        errors = [
            max(p.beside_dry if case.is_chattering and p.beside_dry is not None else p.largest, FLOOR) for p in points
        ]
        style = CHATTERING if case.is_chattering else TOOLS[tool]
        text = f"{method}, law '{case.law}'" if case.is_chattering else f"{tool}: {method}"
        star = {"markersize": 9, "marker": "*", "fillstyle": FILL.get(tool, "none")}
        shape = {**style, **(star if method == "exact" and tool != CS else {})}
        costs = [np.nan if p.failure else getattr(p, cost) for p in points]
        axes.loglog(errors, costs, color=METHOD_COLOURS.get(method, GREY), label=text, **shape)
