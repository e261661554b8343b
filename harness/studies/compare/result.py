"""A comparison of two trajectories with its files, its figure and what the command prints."""

from dataclasses import dataclass, replace
from math import isnan
from typing import TYPE_CHECKING, Any

from ...results.provenance import describe_sources, prefix_parameters
from ...results.result import Result
from ...results.summary import ResultColumn, ResultTable, Summary
from ...simulation.trajectory import describe_accuracy, effective_parameters
from .study import Comparison

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIELDS = ("name", "unit", "largest", "at", "rms", "relative")  # of a variable
COLUMNS = (
    ResultColumn("variable", "{0[name]}", is_text=True),
    ResultColumn("largest difference", "{0[largest]:.3e}"),
    ResultColumn("at t [s]", "{0[at]:.6g}"),
    ResultColumn("rms", "{0[rms]:.3e}"),
    ResultColumn("relative to largest", "{0[relative]:.2e}"),
    ResultColumn("unit", "{0[unit]}", is_text=True),
)


@dataclass(frozen=True, repr=False)
class ComparisonResult(Result, Comparison):
    """The comparison of two trajectories, as `compare` returns it and `load_result` reads it.

    Its attributes are those of `Comparison`.
    """

    study, _function = "compare", "compare"

    @property
    def title(self) -> str:
        return f"{self.one.name} and {self.two.name}"

    @property
    def _headline(self) -> str:
        names = ", ".join(variable.name for variable in self.differences)
        return f"{names}; worst relative difference {self.worst:.3g}"

    @property
    def _caption(self) -> str:
        return f"{self.title}, and their difference"

    def _tabulate(self) -> tuple[ResultTable, ...]:
        return (ResultTable([{name: getattr(item, name) for name in FIELDS} for item in self.differences], COLUMNS),)

    def sentences(self) -> list[str]:
        grid = "those of the coarser side; the other one is interpolated" if self.interpolated else "common to both"
        nonfinite = [variable for variable in self.differences if isnan(variable.largest)]
        return [
            *(f"{side.name}: {text}" for side in (self.one, self.two) if (text := describe_accuracy(side))),
            f"Compared at {len(self.time)} times ({grid}).",
            *(f"{variable.name} is not a finite number at t = {variable.at:g} s" for variable in nonfinite),
            *self.left_out,
        ]

    def summary(self) -> Summary:
        summary = super().summary()
        return replace(summary, sentences=(*filter(None, [self.events]), *summary.sentences))

    def blocks(self) -> list[ResultTable | str]:
        return [*([self.events, ""] if self.events else []), *super().blocks()]

    def as_json(self) -> dict[str, Any]:
        return {
            "one": {"name": self.one.name, "note": describe_accuracy(self.one)},
            "two": {"name": self.two.name, "note": describe_accuracy(self.two)},
            "times": len(self.time),
            "interpolated": self.interpolated,
            "variables": self._tabulate()[0].records(),
            "left_out": list(self.left_out),
            **self.events_as_json(),
        }

    def events_as_json(self) -> dict[str, Any]:
        """Return the events for JSON output: time in s, new mode, and the contact if there are several.

        The shift is NaN if some are unmatched.
        """
        pairs = self.pairs
        if pairs is None:
            return {"events": self.events, "event_shift": None}
        return {
            "events": self.events,
            "event_shift": pairs.shift,
            "matched": {
                "one": pairs.list_rows(pairs.one),
                "two": pairs.list_rows(pairs.two),
                "shift": pairs.largest_shift,
            },
            "only_one": pairs.list_rows(pairs.unmatched[0]),
            "only_two": pairs.list_rows(pairs.unmatched[1]),
        }

    def _origin(self) -> dict[str, Any]:
        sides = (self.one, self.two)
        return {
            "files": [side.source for side in sides if side.source],
            "parameters": prefix_parameters(
                {"one": effective_parameters(self.one), "two": effective_parameters(self.two)}
            ),
            "source": describe_sources(*(str(side.source or side.name) for side in sides)),
        }

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, figure)

    def _draw_panel(self, axes: "Axes") -> None:
        from .figure import plot_difference, select_variables

        for variable in select_variables(self)[:1]:
            plot_difference(axes, self, variable)
            axes.set_ylabel(variable.name)
            axes.set_xlabel("t [s]")
