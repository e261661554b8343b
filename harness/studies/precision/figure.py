"""Work-precision figures: run time and right-hand side evaluations over the error.

Three solvers of each case are coloured and labelled: the two fastest methods of the FMU and the fastest other solver at
the error TARGET.  All others are grey; the CSV file of the study has the numbers of all.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from ...references.peer_solvers import CS, FMPY, FMU, ME
from ...results.quantity import format_power
from ...results.style import BLUE, GREEN, GREY, LEGEND_ABOVE, ORANGE, WIDTH, Figure, set_size

if TYPE_CHECKING:
    from .result import PrecisionCase, PrecisionResult

Solver = tuple[str, str]  # tool and method

COSTS = {"seconds": "run time [s]", "evaluations": "right-hand side and Jacobian evaluations"}
STYLES: tuple[dict[str, Any], ...] = (  # styles of the labelled solvers, in their order
    {"color": BLUE, "linestyle": "-", "marker": "o"},
    {"color": ORANGE, "linestyle": "-", "marker": "s"},
    {"color": GREEN, "linestyle": "--", "marker": "^"},
)
OTHER: dict[str, Any] = {"color": "#cccccc", "linewidth": 0.8, "marker": ".", "markersize": 4, "zorder": 1}
CAPTION = "labelled: the two fastest methods of the FMU and the fastest other solver at error {}; grey: all others"
FLOOR = 2.0**-53  # smaller errors are drawn at this value


def draw(study: "PrecisionResult", figure: Figure) -> None:
    """Draw the figure of a study, with one row per law.

    Laws that chatter are drawn in the first row, with their error against true stick and slip.
    """
    cases = [case for case in study.cases if not case.is_chattering]
    shortcuts = [case for case in study.cases if case.is_chattering]
    set_size(figure, 2 * WIDTH, 0.7 + 3.4 * len(cases))
    figure.suptitle(
        f"{study.model}: cost over error, lower left is better\n{CAPTION.format(format_power(study.target))}"
    )
    panels = figure.subplots(len(cases), 2, squeeze=False, sharex=True, sharey="col")
    for case, row in zip(cases, panels, strict=True):
        row_cases = [case, *(shortcuts if case is cases[0] else [])]
        for axes, (cost, name) in zip(row, COSTS.items(), strict=True):
            for row_case in row_cases:
                plot_curves(axes, study, row_case, cost)
            for law in study.deviations:
                if law.largest and law.case in [row_case.name for row_case in row_cases]:
                    name_of_law = "the law" if law.case == case.name else f"the law '{law.law}'"
                    mark_error(axes, law.largest, f"error of {name_of_law} ")
            axes.set_ylabel(name)
            axes.tick_params(labelbottom=True)
        row[0].set_title(case.law)
        add_legend(row[1])
    for axes in panels[-1]:
        axes.set_xlabel("largest error, relative to the largest value")


def draw_case(axes: Axes, study: "PrecisionResult", case: "PrecisionCase") -> None:
    """Plot run time over error of a case."""
    plot_curves(axes, study, case, "seconds")
    axes.set_ylabel(COSTS["seconds"])
    axes.set_xlabel("largest error, relative to the largest value")
    add_legend(axes)


def choose_labelled(study: "PrecisionResult", case: "PrecisionCase") -> list[Solver]:
    """Return the solvers to label, fastest first; those with the smallest error fill up if few reach TARGET."""
    if case.is_chattering:
        return []
    ranks = [(point.tool, point.method) for point in study.rank_solvers(case)]
    own_solvers = [solver for solver in ranks if solver[0] == FMU]
    peers = [solver for solver in ranks if solver[0] != FMU]
    solvers = [solver for solver in study.solvers(case) if solver[0] not in (FMPY, CS, ME)]
    errors = {solver: min((p.largest for p in study.curve(case, *solver)), default=np.inf) for solver in solvers}
    sorted_solvers = sorted(solvers, key=lambda solver: errors[solver])
    return list(dict.fromkeys([*own_solvers[:2], *peers[:1], *ranks, *sorted_solvers]))[: len(STYLES)]


def plot_curves(axes: Axes, study: "PrecisionResult", case: "PrecisionCase", cost: str) -> None:
    """Plot every solver of a case, log-log; failed runs are gaps."""
    labelled_solvers = choose_labelled(study, case)
    for tool, method in study.solvers(case):
        is_duplicate = tool in (FMPY, CS) and (
            cost != "seconds" or case.is_chattering
        )  # the same number of evaluations
        if is_duplicate or not study.curve(case, tool, method):
            continue
        points = [p for p in study.points if (p.case, p.tool, p.method) == (case.name, tool, method)]
        errors = [max(p.error(case.is_chattering), FLOOR) for p in points]
        costs = [np.nan if p.failure else getattr(p, cost) for p in points]
        if (tool, method) in labelled_solvers:
            style = STYLES[labelled_solvers.index((tool, method))] | {"label": f"{tool}: {method}", "markersize": 5}
        else:
            style = OTHER | {"label": "_other"}
        axes.loglog(errors, costs, **style)


def mark_error(axes: Axes, error: float, text: str) -> None:
    """Mark the error of a law against dry friction, which no solver of this law can reduce."""
    axes.axvline(error, color=GREY, linestyle="-.", linewidth=0.8)
    style: dict[str, Any] = {"rotation": 90, "ha": "right", "va": "top", "fontsize": 8, "color": GREY}
    axes.text(error, 0.98, text, transform=axes.get_xaxis_transform(), **style)


def add_legend(axes: Axes) -> None:
    """Add a legend of the labelled solvers above a panel, fastest first."""
    order = [style["color"] for style in STYLES]
    lines = [line for line in axes.lines if not str(line.get_label()).startswith("_")]
    axes.legend(handles=sorted(lines, key=lambda line: order.index(line.get_color())), ncols=3, **LEGEND_ABOVE)
