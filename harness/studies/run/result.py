"""A run with the quantities that its scene measures, its files, its figure and what the command prints."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ...arguments import PATH, check_arguments
from ...errors import SceneError, unknown_name_message
from ...results.files import write_csv, write_csv_rows, write_signals
from ...results.provenance import describe_sources
from ...results.quantity import Quantity, format_number, step_size_quantities
from ...results.result import Result
from ...results.summary import MAX_DEVIATION, PICTURE_FILE, STEPS_TABLE, Outcome, ResultColumn, ResultTable, Summary
from ...scenes.scene import MAX_DEFAULT_PLOTS, KnownValues, Scene, default_plots, is_panel
from ...simulation.plot import choose_outputs, contact_of
from ...simulation.trajectory import Trajectory, describe_accuracy, effective_parameters
from ...simulation.trajectory_files import read_run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OTHER_MACHINE = "other CPU: the published run time was measured on another machine"
OTHER_QUANTITIES = "Quantities without a known value"
CHATTERING_LAWS = ("sign", "threshold")
STEP_QUANTITIES = ("steps", "mean_step")
KINDS = ("published", "reference", "parameter")  # of known values, as in the table
ALWAYS_SHOWN = ("steps", "mean_step", "run_time")  # shown for all scenes, even without a known value
SPAN = ("start", "end", "smallest", "largest")  # values of an output


@dataclass(frozen=True, repr=False, kw_only=True)
class RunResult(Trajectory, Result):
    """A run, as `simulate` returns it and `load_result` reads it; its attributes are those of `Trajectory`.

    Attributes
    ----------
    scene : Scene or None
        Scene whose analyses measure the `quantities`; None for a run of a model or an FMU, and after loading.
    """

    study, _function = "run", "simulate"

    scene: Scene | None = None

    @property
    def title(self) -> str:
        return self.scene.name if self.scene else self.name

    @cached_property
    def _analyses(self) -> dict[str, Any]:
        """The results of the analyses of the scene by name; none of a run that failed.

        Raises
        ------
        HarnessError
            If the run is not sufficient for an analysis.
        """
        if self.scene is None:
            return {}
        check_steps(self.scene, self)
        return {} if self.failure else {name: analyse(name, self, self.scene) for name in self.scene.analyses}

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """The measured quantities: those of the analyses, and run time and evaluations."""
        quantities = tuple(quantity for result in self._analyses.values() for quantity in result.quantities)
        quantities += self.statistics.quantities if self.statistics else ()
        if self.scene and not self.failure:
            check_known_values(self.scene, self, quantities)
        return quantities

    @property
    def _known_values(self) -> KnownValues | None:
        """The values that the quantities are compared with."""
        return self.scene.known if self.scene else None

    @property
    def outcome(self) -> Outcome | None:
        """The largest difference from a known value; steps of a law that chatters are not judged."""
        if not (self._known_values and self._analyses):
            return None
        ignored_names = STEP_QUANTITIES if chatters(self) else ()
        differences = [(deviation(item, self._known_values.values.get(item.name)), item) for item in self.quantities]
        deviations = [
            (percent, item.text)
            for percent, item in differences
            if percent is not None and item.name not in ignored_names
        ]
        if not deviations:
            return None
        percent, name = max(deviations, key=lambda pair: abs(pair[0]))
        text, is_good = f"{name} differs by {percent:+.2g} %", abs(percent) <= MAX_DEVIATION
        return Outcome(f"{percent:+.2g} %", text, is_good, percent, self._known_values.kind, self._known_values.source)

    @property
    def _caption(self) -> str:
        return f"{self.title}: plots of the run"

    def _tabulate(self) -> tuple[ResultTable, ...]:
        return (tabulate_quantities([self], everything=True),) if self.scene else (self._signal_table(),)

    def _tabulate_details(self) -> tuple[ResultTable, ...]:
        return (self._signal_table(), *self._step_table()) if self.scene else self._step_table()

    def _signal_table(self) -> ResultTable:
        """Return the table of the first, the last, the smallest and the largest value of each output."""
        rows = [
            {
                "output": name,
                **dict(zip(SPAN, map(format_value, span_of(column)), strict=True)),
                "unit": self.units[name],
            }
            for name, column in self.columns.items()
        ]
        spans = [ResultColumn(heading, f"{{0[{heading}]}}") for heading in SPAN]
        unit = ResultColumn("unit", lambda row: "" if row["unit"] == "1" else row["unit"], is_text=True)
        return ResultTable(rows, (ResultColumn("output", "{0[output]}", is_text=True), *spans, unit))

    def _step_table(self) -> tuple[ResultTable, ...]:
        """Return the table with one row, the statistics of the internal steps; nothing if there are none."""
        if self.steps is None or not len(self.steps.h):
            return ()
        quantities = step_size_quantities(self.steps.h, int(self.steps.rejected.sum()))
        row = {quantity.text: " ".join(quantity.format()).strip() for quantity in quantities}
        columns = [ResultColumn(name, f"{{0[{name}]}}") for name in row]
        return (
            ResultTable([row], (ResultColumn("case", lambda row: self.title, is_text=True), *columns), STEPS_TABLE),
        )

    def sentences(self) -> list[str]:
        if self.scene:
            return [*describe_known_values(self.scene), *filter(None, [self.note])]
        rests = (
            f"{name}: {changes} change{'s' * (changes != 1)} of mode, sticks for {duration:.6g} s"
            for name, changes, duration in list_rests(self)
        )
        return [*rests, *filter(None, [describe_accuracy(self)])]

    def blocks(self) -> list[ResultTable | str]:
        return [*self._tabulate(), *self.sentences()] if self.scene else super().blocks()

    def summary(self) -> Summary:
        """Return the findings, in which quantities without a known value have a table of their own."""
        sentences, tables = tuple(filter(None, [self.note])), (self._signal_table(), *self._step_table())
        if self.scene and not self.failure:
            sentences = (*filter(None, [self.scene.about]), *self.sentences())
        if self._analyses:
            compared_quantities = [
                item for item in self.quantities if self._known_values and item.name in self._known_values.values
            ]
            others = [item for item in self.quantities if item not in compared_quantities]
            main, rest = (compared_quantities, others) if compared_quantities else (others, compared_quantities)
            columns = quantity_columns(self._known_values)
            other_table = ResultTable([(self, item) for item in rest], columns[:3], OTHER_QUANTITIES)
            tables = (ResultTable([(self, item) for item in main], columns), other_table, *self._step_table())
        return replace(
            super().summary(), sentences=sentences, tables=tuple(part for table in tables for part in table.summarize())
        )

    def as_json(self) -> dict[str, Any]:
        if self.scene:
            error, comparison = self.failure or None, self._comparison_as_json()
            return {
                "scene": self.scene.name,
                "quantities": self.quantities,
                "error": error,
                "comparison": comparison,
            }
        spans = {name: dict(zip(SPAN, span_of(column), strict=True)) for name, column in self.columns.items()}
        contacts = {name: {"changes": changes, "stuck": duration} for name, changes, duration in list_rests(self)}
        return {
            "fmu": self.name,
            "note": describe_accuracy(self),
            "failed": self.failure,
            "final": {name: span["end"] for name, span in spans.items()},
            "outputs": {name: {"unit": self.units[name]} | span for name, span in spans.items()},
            **({"contacts": contacts} if self.events else {}),
        }

    def _comparison_as_json(self) -> dict[str, Any] | None:
        """Return the known values with their kind, source, citation and differences; None without any."""
        if self._known_values is None:
            return None
        known_values, outcome = self._known_values, self.outcome
        compared_quantities = [quantity for quantity in self.quantities if quantity.name in known_values.values]
        values = [
            {
                "name": item.name,
                "value": known_values.values[item.name],
                "percent": deviation(item, known_values.values[item.name]),
            }
            for item in compared_quantities
        ]
        return {
            "kind": known_values.kind,
            "source": known_values.source,
            "citation": known_values.citation,
            "values": values,
            "agrees": outcome.is_good if outcome else None,
            "text": outcome.text if outcome else "",
        }

    def _origin(self) -> dict[str, Any]:
        origin = {"files": [self.spec.fmu], "parameters": effective_parameters(self), "run": self.spec}
        if self.scene is None:
            return origin | {"source": describe_sources(str(self.spec.fmu))}
        return origin | {"source": self.scene.source, "scene": self.scene.presentation}

    def _write(self, folder: Path) -> None:
        """Write tables and figure; the tables hold all data."""
        self._write_tables(folder)
        self._write_figure(folder / PICTURE_FILE)

    def _write_tables(self, folder: Path) -> None:
        """Write trajectory.csv, and steps.csv, events.csv and quantities.csv if there are any of these."""
        write_signals(folder / "trajectory.csv", self.time, self.columns, self.units)
        if self.steps:
            columns = [self.steps.t[1:], self.steps.h, self.steps.rejected]
            write_csv(folder / "steps.csv", ["t [s]", "h [s]", "rejected"], columns)
        if self.events:
            columns = [self.events.t, *self.events.modes.values()]
            write_csv(folder / "events.csv", ["t [s]", *self.events.headings], columns)
        if self._analyses:
            table = ResultTable([(self, item) for item in self.quantities], quantity_columns(self._known_values, ""))
            write_csv_rows(folder / "quantities.csv", table.headings, table.rows())

    @property
    def _plots(self) -> tuple[str, ...]:
        """The names of the plots: those that the scene names, or outputs and the phase plane."""
        if self.scene and self.scene.plots != default_plots(self.scene.run.outputs):
            return self.scene.plots
        return choose_plots(self)

    def _write_figure(self, path: Path) -> None:
        if self._plots:  # otherwise matplotlib is not needed
            super()._write_figure(path)

    def _draw(self, figure: "Figure") -> None:
        from .figure import draw

        draw(self, self.scene.title if self.scene else self.source.name, self._plots, figure)

    def _draw_panel(self, axes: "Axes") -> None:
        self.plot(ax=axes)

    @classmethod
    def _is_stored(cls, folder: Path) -> bool:
        return (folder / "trajectory.csv").is_file()

    @classmethod
    @check_arguments(folder=PATH)
    def _load(cls, folder: str | Path) -> Self:
        return cls(**vars(read_run(Path(folder))))


def analyse(name: str, run: Trajectory, scene: Scene) -> Any:
    """Return the result of an analysis of a run, which is imported only if a scene requests it."""
    if name == "decay":
        from ...analyses.decay.decrement import analyse as analyse_decay

        return analyse_decay(run, scene.decay.gives or "", scene.decay.first, scene.decay.cycles)
    if name == "slip":
        from ...analyses.slip import analyse as analyse_slips

        return analyse_slips(run)
    from ...analyses.steps import analyse as analyse_steps

    return analyse_steps(run)


def check_steps(scene: Scene, run: Trajectory) -> None:
    """Raise SceneError if the scene needs solver steps that the FMU does not expose."""
    panels = [name for name in scene.plots if is_panel(name, scene.run.outputs)]
    if run.steps is None and "steps" in (*scene.analyses, *panels):
        raise SceneError(
            f"'steps' in analyses or plots: {scene.run.fmu.name} does not expose its solver steps; remove 'steps'"
        )


def check_known_values(scene: Scene, run: Trajectory, quantities: tuple[Quantity, ...]) -> None:
    """Raise SceneError unless each known value has a measured quantity with a compatible unit.

    A value in the table [parameter] must be the one that the run sets.
    """
    if scene.known is None:
        return
    kind, quantities_by_name = scene.known.kind, {quantity.name: quantity for quantity in quantities}
    for name, value in scene.known.values.items():
        if name not in quantities_by_name:
            raise SceneError(unknown_name_message(f"name in [{scene.known.kind}]", name, quantities_by_name))
        number, unit = value if isinstance(value, tuple) else (value, quantities_by_name[name].unit)
        try:
            quantities_by_name[name].to_unit(unit)
        except KeyError:
            measured_unit = quantities_by_name[name].unit
            raise SceneError(f"{name} in '{unit}' is incompatible with the measured unit '{measured_unit}'") from None
        is_set = name in run.parameters and (run.parameters[name], run.units[name]) == (number, unit)
        if kind == "parameter" and not is_set:
            raise SceneError(
                f"{name} = {number!r} in [parameter] is not what the run sets: give the value of a parameter of "
                f"{run.spec.model} in its own unit, or name the table [reference]"
            )


def describe_known_values(scene: Scene) -> tuple[str, ...]:
    """Return the publication of the values of a scene, and the remark on the comparison with them."""
    citation = scene.known.citation if scene.known else None
    return tuple(filter(None, (f"Published values: {citation}." if citation else "", scene.remark)))


def choose_plots(run: Trajectory) -> tuple[str, ...]:
    """Return the plots of a run for which none is named.

    These are the first outputs, with the friction forces among them; with several contacts, the forces are additional.
    Modes are not plotted as curves, because shading and lines show them.
    """
    modes = run.events.mode_names.values() if run.events else ()
    outputs = tuple(name for name in run.spec.outputs if name not in modes) or run.spec.outputs
    if len(run.contacts) < 2:
        return default_plots(outputs, choose_outputs(outputs, run.contacts, MAX_DEFAULT_PLOTS))
    others = [name for name in outputs if not contact_of(run, name)]
    return default_plots(outputs, (*others[:MAX_DEFAULT_PLOTS], *run.contacts[:MAX_DEFAULT_PLOTS]))


def tabulate_quantities(runs: Iterable[RunResult], everything: bool) -> ResultTable:
    """Return one table for the scenes of all runs; if `everything`, include quantities without a known value."""
    rows = [
        (run, quantity)
        for run in runs
        for quantity in run.quantities
        if everything
        or quantity.name in ALWAYS_SHOWN
        or (run._known_values and quantity.name in run._known_values.values)
    ]
    known_values = next((run._known_values for run, _ in rows if run._known_values), None)
    columns = quantity_columns(known_values)
    if known_values:
        columns = (*columns[:3], replace(columns[3], heading="compared with"), columns[4])
    note = OTHER_MACHINE if known_values and any(columns[4].cell(row) == "other CPU" for row in rows) else ""
    return ResultTable(rows, columns, group=describe_run, note=note, padding=0)


def describe_run(row: tuple[RunResult, Quantity]) -> tuple[str, ...]:
    """Return the name and the settings of a run, and the origin of its known values, above its quantities."""
    run, known_values = row[0], row[0]._known_values
    origin = ("", "", f"{known_values.kind}\n{known_values.source}") if known_values else ()
    return (f"{run.title}\n  {run.settings_label}", *origin)


def quantity_columns(known_values: KnownValues | None, heading: str = "quantity") -> tuple[ResultColumn, ...]:
    """Return the columns of pairs of a run and a quantity, with those of known values if there are any."""
    columns = (
        ResultColumn(heading, "{0[1].text}", is_text=True),
        ResultColumn("measured", lambda row: quantity_cells(row)[0]),
        ResultColumn("unit", lambda row: quantity_cells(row)[1], is_text=True),
    )
    if known_values is None:
        return columns
    known_column = ResultColumn(known_values.label, lambda row: quantity_cells(row)[2])
    return (*columns, known_column, ResultColumn("difference", lambda row: quantity_cells(row)[3]))


def quantity_cells(row: tuple[RunResult, Quantity]) -> tuple[str, str, str, str]:
    """Return measured value, unit, known value and difference, in the unit of the known value."""
    run, quantity = row
    known_value, value, unit = (
        run._known_values.values.get(quantity.name) if run._known_values else None,
        quantity.value,
        quantity.unit,
    )
    if isinstance(known_value, tuple):
        known_value, unit = known_value
        value = quantity.to_unit(unit)
    if not isinstance(known_value, int | float):
        measured_text, unit = quantity.format()
        return measured_text, unit, str(known_value or ""), ""
    known_text = repr(known_value)
    measured_text = format_number(value, max(5, len(known_text.replace(".", "").lstrip("0"))))
    percent = deviation(quantity, (known_value, unit))
    difference = "" if percent is None else f"{percent:+.2g} %"
    return (
        measured_text,
        "" if unit == "1" else unit,
        known_text,
        "other CPU" if quantity.name == "run_time" else difference,
    )


def deviation(quantity: Quantity, known_value: object) -> float | None:
    """Return the difference from a known value in percent, with two digits; None for texts, zeros and run times."""
    value, unit = known_value if isinstance(known_value, tuple) else (known_value, quantity.unit)
    if not isinstance(value, int | float) or not value or quantity.name == "run_time":
        return None
    return float(f"{100 * (quantity.to_unit(unit) / value - 1):.2g}")


def chatters(run: Trajectory) -> bool:
    """Return whether the friction law of a run chatters, so that its steps depend on rounding."""
    return run.parameters.get("friction") in CHATTERING_LAWS


def explain_chatter(runs: Iterable[RunResult]) -> str:
    """Return why the known steps of scenes whose friction chatters are not judged; empty without any."""
    names = [
        run.title
        for run in runs
        if run._known_values and chatters(run) and {*STEP_QUANTITIES} & {*run._known_values.values}
    ]
    reason = "friction chatters at a stop, so they depend on rounding"
    return f"Steps of {', '.join(names)} are not judged: {reason}." if names else ""


def conclude(runs: Iterable[RunResult]) -> tuple[str, bool]:
    """Return what was checked, with the cases that differ from their known values, and whether all agree."""
    outcomes = [(run.title, outcome) for run in runs if (outcome := run.outcome)]
    counts = {kind: sum(outcome.kind == kind for _, outcome in outcomes) for kind in KINDS}
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    differences = [f"{name}: {outcome.text}" for name, outcome in outcomes if not outcome.is_good]
    text = f"{len(outcomes) - len(differences)} of {len(outcomes)} cases agree within {MAX_DEVIATION:g} % ({kinds})."
    return "\n".join((text, *differences)) if outcomes else "", not differences


def span_of(column: np.ndarray) -> list[Any]:
    """Return the first, the last, the smallest and the largest value of a signal (n,); of texts the first and last."""
    ends = column[[0, -1]].tolist()
    if column.dtype.kind == "U":
        return [*ends, "", ""]
    return [*ends, np.fmin.reduce(column).item(), np.fmax.reduce(column).item()]


def format_value(value: object) -> str:
    """Return a number with six digits, any other value as text."""
    return value if isinstance(value, str) else f"{value:.6g}"


def list_rests(run: Trajectory) -> list[tuple[str, int, float]]:
    """Return for each contact its name, its number of changes of mode, and the time in s for which it sticks."""
    if run.events is None:
        return []
    return [
        (name, len(run.events.changes(name)[0]) - 1, sum(end - begin for begin, end in rests))
        for name, rests in run.sticking.items()
    ]
