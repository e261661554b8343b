"""Runs and comparisons of anyone's FMUs and results, in folders of results."""

from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from ...results.files import to_json
from ...results.folder import replace_folder
from ...results.provenance import describe_sources, prefix_parameters, write_provenance
from ...running.fmi2 import ProgressCallback
from ...running.run_spec import RunSpec
from . import trajectory_sources
from .difference import Comparison, compare


def run_comparison(
    sources: tuple[str, str], how: RunSpec, out: Path, report: ProgressCallback
) -> tuple[Comparison, Path]:
    """Compare two FMUs, scenes, result folders or CSV files, and write the differences to out/compare/<one>-<two>;
    `how` says how FMUs are run."""
    from .figure import draw

    names = trajectory_sources.display_names(sources)
    folder = out / "compare" / "-".join(names).replace("/", "-")
    with replace_folder(folder, ("compare.json", "figure.svg"), describe_sources(*sources)) as fresh:
        one, two = (
            replace(each, name=name)
            for each, name in zip(trajectory_sources.load_both(sources, how, report), names, strict=True)
        )
        found = compare(one, two)
        (fresh / "compare.json").write_text(to_json(comparison_as_json(found)) + "\n", encoding="utf-8")
        draw(found, fresh / "figure.svg")
        values = prefix_parameters({"one": one.parameters, "two": two.parameters})
        write_provenance(
            fresh, [each.file for each in (one, two) if each.file], values, how, source=describe_sources(*sources)
        )
    return found, folder


def comparison_as_json(found: Comparison) -> dict[str, Any]:
    """Everything found, for JSON."""
    return {
        "one": {"name": found.one.name, "note": found.one.note},
        "two": {"name": found.two.name, "note": found.two.note},
        "times": len(found.time),
        "interpolated": found.interpolated,
        "variables": [
            {name: getattr(each, name) for name in ("name", "unit", "largest", "at", "rms", "relative")}
            for each in found.differences
        ],
        "left_out": list(found.left_out),
        **events(found),
    }


def events(found: Comparison) -> dict[str, Any]:
    """The events, for JSON: changes of mode as times in s and new modes, NaN for a shift where one side has more."""
    pairs = found.pairs
    if pairs is None:
        return {"events": "", "event_shift": None}
    return {
        "events": found.events,
        "event_shift": pairs.shift,
        "matched": {"one": pairs.one.tolist(), "two": pairs.two.tolist(), "shift": pairs.largest_shift},
        "only_one": pairs.unmatched[0].tolist(),
        "only_two": pairs.unmatched[1].tolist(),
    }


def difference_table(found: Comparison) -> Table:
    """The differences, a row for each variable."""
    shown = Table(box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    shown.add_column("")
    for head in ("largest difference", "at t [s]", "rms", "relative to largest"):
        shown.add_column(head, justify="right", no_wrap=True)
    shown.add_column("", no_wrap=True)
    for each in found.differences:
        figures = (f"{each.largest:.3e}", f"{each.at:.6g}", f"{each.rms:.3e}", f"{each.relative:.2e}")
        shown.add_row(each.name, *figures, each.unit)
    return shown


def summary_lines(found: Comparison) -> list[str]:
    """How the two came about, what was compared, and what their events say."""
    how = "those of the coarser one; the other lies between its samples" if found.interpolated else "common to both"
    said = [f"{each.name}: {each.note}" for each in (found.one, found.two) if each.note]
    lost = [each for each in found.differences if isnan(each.largest)]
    return [
        *said,
        f"Compared at {len(found.time)} times ({how}).",
        *(f"{each.name} is not a finite number at t = {each.at:g} s" for each in lost),
        *found.left_out,
        *filter(None, [found.events]),
    ]
