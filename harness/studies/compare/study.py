"""Study that compares two FMUs, scenes, result folders or files, and writes the result folder."""

from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

from rich.table import Table

from ...results.files import to_json
from ...results.folder import replace_folder
from ...results.provenance import describe_sources, prefix_parameters, write_provenance
from ...results.summary import Summary, make_terminal_table, read_cells, write_summary
from ...running.runner import ProgressCallback
from ...scenes.run_spec import RunSpec
from . import trajectory_sources
from .difference import Comparison, compare


def run_comparison(
    sources: tuple[str, str], options: RunSpec, out: Path, report: ProgressCallback
) -> tuple[Comparison, Path]:
    """Compare two sources and write the differences to out/compare/<one>-<two>; FMUs are run with the `options`."""
    from .figure import draw

    names = trajectory_sources.display_names(sources)
    folder = out / "compare" / "-".join(names).replace("/", "-")
    with replace_folder(folder, ("compare.json", "figure.svg"), describe_sources(*sources)) as new_folder:
        one, two = (
            replace(side, label=name)
            for side, name in zip(trajectory_sources.load_both(sources, options, report), names, strict=True)
        )
        comparison = compare(one, two)
        (new_folder / "compare.json").write_text(to_json(comparison_as_json(comparison)) + "\n", encoding="utf-8")
        draw(comparison, new_folder / "figure.svg")
        values = prefix_parameters({"one": one.effective_parameters, "two": two.effective_parameters})
        write_provenance(
            new_folder,
            [side.spec.fmu for side in (one, two)],
            values,
            options.options,
            source=describe_sources(*sources),
        )
        title = f"{comparison.one.name} and {comparison.two.name}"
        write_summary(
            new_folder,
            Summary(
                "compare",
                title,
                tuple(filter(None, (comparison.one.accuracy, comparison.two.accuracy, comparison.events))),
                read_cells(difference_table(comparison)),
                f"{title}, and their difference",
            ),
        )
    return comparison, folder


def comparison_as_json(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison for JSON output."""
    return {
        "one": {"name": comparison.one.name, "note": comparison.one.accuracy},
        "two": {"name": comparison.two.name, "note": comparison.two.accuracy},
        "times": len(comparison.time),
        "interpolated": comparison.interpolated,
        "variables": [
            {name: getattr(variable, name) for name in ("name", "unit", "largest", "at", "rms", "relative")}
            for variable in comparison.differences
        ],
        "left_out": list(comparison.left_out),
        **events_as_json(comparison),
    }


def events_as_json(comparison: Comparison) -> dict[str, Any]:
    """Return the events for JSON output: time in s, new mode, and the contact if there are several.

    The shift is NaN if some are unmatched.
    """
    pairs = comparison.pairs
    if pairs is None:
        return {"events": "", "event_shift": None}
    return {
        "events": comparison.events,
        "event_shift": pairs.shift,
        "matched": {"one": pairs.list_rows(pairs.one), "two": pairs.list_rows(pairs.two), "shift": pairs.largest_shift},
        "only_one": pairs.list_rows(pairs.unmatched[0]),
        "only_two": pairs.list_rows(pairs.unmatched[1]),
    }


def difference_table(comparison: Comparison) -> Table:
    """Return the table of differences, with one row per variable."""
    result = make_terminal_table()
    result.add_column("variable")
    for heading in ("largest difference", "at t [s]", "rms", "relative to largest"):
        result.add_column(heading, justify="right", no_wrap=True)
    result.add_column("unit", no_wrap=True)
    for variable in comparison.differences:
        cells = (f"{variable.largest:.3e}", f"{variable.at:.6g}", f"{variable.rms:.3e}", f"{variable.relative:.2e}")
        result.add_row(variable.name, *cells, variable.unit)
    return result


def summary_lines(comparison: Comparison) -> list[str]:
    """Return notes on both sides, on the times of comparison, and on events."""
    grid = "those of the coarser side; the other one is interpolated" if comparison.interpolated else "common to both"
    notes = [f"{side.name}: {side.accuracy}" for side in (comparison.one, comparison.two) if side.accuracy]
    nonfinite = [variable for variable in comparison.differences if isnan(variable.largest)]
    return [
        *notes,
        f"Compared at {len(comparison.time)} times ({grid}).",
        *(f"{variable.name} is not a finite number at t = {variable.at:g} s" for variable in nonfinite),
        *comparison.left_out,
        *filter(None, [comparison.events]),
    ]
