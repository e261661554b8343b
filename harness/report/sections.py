"""Sections of the report, read from results on disk; missing results are listed with their commands."""

import csv
import json
import re
from base64 import b64encode
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import first_line
from ..results import provenance
from ..results.quantity import format_interval as spelled_interval
from ..results.step_sizes import step_size_quantities as step_sizes

TRAJECTORY_FILE = "trajectory.csv"
QUANTITIES_FILE = "quantities.csv"
MAX_NUMBER_LENGTH = 32  # characters of a number with its interval; longer cells are texts
NUMBER_STARTS = (*"0123456789+-<", "nan", "not finite")
MIN_LENGTH = 12  # cells longer than this are shortened to four digits
RUN_TIME = "run time"  # row of quantities.csv; a busy machine makes more than two of its digits meaningless
FAILED = "wrong"  # outcome of a stability case that did not end as expected
LOSSES = {"zeta": "viscous damping", "r": "dry friction", "b": "quadratic drag"}  # terms of a fitted decay


@dataclass(frozen=True)
class PublishedScene:
    """A scene with published values: its name, its model, and a description of the model (may be empty)."""

    name: str
    model: str
    about: str


@dataclass(frozen=True)
class Picture:
    """An SVG file, its content as a data URL, and its text alternative."""

    file: Path
    data: str
    text: str


@dataclass(frozen=True)
class TableCells:
    """A table: headings and rows of text."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def is_text(self, column: int) -> bool:
        """Return whether a column has texts, which are set flush left."""
        cells = [row[column] for row in self.rows if row[column]]
        return not any(cell.startswith(NUMBER_STARTS) and len(cell) <= MAX_NUMBER_LENGTH for cell in cells)


@dataclass(frozen=True)
class SectionItem:
    """A piece of a section: heading, sentences, table and pictures if any, sentences on their origin, and data files.

    `folded` are further tables by their titles, which the reader opens. `unreadable` marks results that could not be
    read; a sentence gives the reason.
    """

    title: str
    sentences: tuple[str, ...] = ()
    grid: TableCells | None = None
    pictures: tuple[Picture, ...] = ()
    folded: tuple[tuple[str, TableCells], ...] = ()
    unreadable: bool = False
    origin: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()

    @property
    def has_results(self) -> bool:
        return bool(self.grid or self.folded or self.pictures)


@dataclass(frozen=True)
class Section:
    """A section of the page; `missing` lists missing results and the commands that create them."""

    name: str
    title: str
    intro: str
    parts: tuple[SectionItem, ...]
    missing: tuple[tuple[str, str], ...]


def build_sections(results: Path, scenes: Sequence[PublishedScene]) -> list[Section]:
    """Return all sections for the results in a folder, published scenes first."""
    sections = [
        *(published_section(scenes, results), runs_section(scenes, results)),
        *(decay_section(results), steps_section(scenes, results)),
        *(precision_section(scenes, results), stability_section(results), importers_section(results)),
        *(sweeps_section(results), comparisons_section(results), coupled_section(results), bench_section(results)),
    ]
    return [section for section in sections if section.parts or section.missing]


def make_section(
    name: str, title: str, intro: str, parts: list[SectionItem], missing_name: str, command: str
) -> Section:
    """Return a section whose results are missing if it has no parts."""
    return Section(name, title, intro, tuple(parts), () if parts else ((missing_name, f"python -m harness {command}"),))


def read_items(results: Path, pattern: str, show: Callable[[Path], SectionItem]) -> list[SectionItem]:
    """Return an item for every file that matches a pattern, or for its folder if the pattern has a wildcard."""
    files = sorted(results.glob(pattern))
    return [read_item(file.parent if "*" in pattern else file, show) for file in files]


def read_item(path: Path, make: Callable[[Path], SectionItem]) -> SectionItem:
    """Return the item of a file or folder of results, or an item with the reason why it cannot be read."""
    try:
        part = make(path)
        return replace(part, origin=read_origin(path), files=csv_files(path)) if part.has_results else part
    except Exception as error:  # the content may be truncated, of another version or of another program
        return SectionItem(
            path.name,
            (f"{path} cannot be shown ({type(error).__name__}: {first_line(error)[:100]}).",),
            unreadable=True,
        )


def read_origin(path: Path) -> tuple[str, ...]:
    """Return the provenance of results, from their folder or from a JSON file of the same name."""
    own = path.with_suffix(".json")
    return provenance.summarize_provenance(
        own if own.is_file() else (path if path.is_dir() else path.parent) / provenance.FILE
    )


def csv_files(path: Path) -> tuple[Path, ...]:
    """Return the CSV files of results: those in the folder, or those whose names start with the name of the file."""
    return tuple(sorted(path.glob("*.csv") if path.is_dir() else path.parent.glob(f"{path.stem}*.csv")))


def published_section(scenes: Sequence[PublishedScene], results: Path) -> Section:
    parts, missing = [], []
    for scene in scenes:
        sentences = (scene.about,) if scene.about else ()
        if (results / scene.name / QUANTITIES_FILE).is_file():
            parts.append(read_item(results / scene.name, partial(published_item, sentences)))
        else:
            missing.append((scene.name, f"python -m harness run {scene.name}"))
    intro = "Each published value with the measured one. Run times depend on the machine."
    return Section("published", "Published cases", intro, tuple(parts), tuple(missing))


def published_item(sentences: tuple[str, ...], folder: Path) -> SectionItem:
    """Return the item of a published case; quantities without a published value are folded."""
    picture = read_picture(folder / "figure.svg", f"{folder.name}: position, velocity and phase plane of the run")
    measured = read_quantities(folder / QUANTITIES_FILE)
    column = next((i for i, head in enumerate(measured.heads) if head.startswith("published")), len(measured.heads))
    shown = tuple(row for row in measured.rows if any(row[column:]))
    others = tuple(row[:column] for row in measured.rows if not any(row[column:]))
    if not shown:
        return SectionItem(folder.name, sentences, measured, picture)
    folded = (("Quantities without a published value", TableCells(measured.heads[:column], others)),) if others else ()
    return SectionItem(folder.name, sentences, TableCells(measured.heads, shown), picture, folded)


def read_quantities(file: Path) -> TableCells:
    """Return the table of measured quantities, with two digits of the run time."""
    cells = read_table(file, cut=False)
    return TableCells(cells.heads, tuple(round_run_time(row) for row in cells.rows))


def round_run_time(row: tuple[str, ...]) -> tuple[str, ...]:
    """Return a row of quantities.csv; the measured value of a run time is rounded to two digits."""
    name, value, *others = row
    return (name, f"{float(f'{float(value):.2g}'):g}", *others) if name == RUN_TIME else row


def runs_section(scenes: Sequence[PublishedScene], results: Path) -> Section:
    """Section of runs without published values: user scenes and FMUs."""
    cases = [scene.name for scene in scenes]
    folders = sorted(file.parent for file in results.glob(f"[!.]*/{TRAJECTORY_FILE}"))
    others = [folder for folder in folders if folder.name not in cases or not (folder / QUANTITIES_FILE).is_file()]
    intro = "User scenes and FMUs, with first and last values."
    return Section("runs", "Other runs", intro, tuple(read_item(folder, run_item) for folder in others), ())


def run_item(folder: Path) -> SectionItem:
    quantities, trajectory = folder / QUANTITIES_FILE, read_table(folder / TRAJECTORY_FILE)
    rows = tuple(zip(trajectory.heads, trajectory.rows[0], trajectory.rows[-1], strict=True))
    grid = read_quantities(quantities) if quantities.is_file() else TableCells(("", "first", "last"), rows)
    return SectionItem(folder.name, (), grid, read_picture(folder / "figure.svg", f"{folder.name}: plots of the run"))


def decay_section(results: Path) -> Section:
    intro = "Damping, dry friction and drag from the whole signal and from its turning points, with 95 % intervals."
    parts = read_items(results, "decay/[!.]*/decay.json", decay_item)
    return make_section("decay", "Decay", intro, parts, "a decay", "decay coulomb")


def decay_item(folder: Path) -> SectionItem:
    data = json.loads((folder / "decay.json").read_text(encoding="utf-8"))
    estimates = [
        {quantity["name"]: format_estimate(quantity) for quantity in data[by_name]}
        for by_name in ("fit", "turning_points", "published")
    ]
    rows = tuple(
        (
            quantity["text"],
            *(by_name.get(quantity["name"], "") for by_name in estimates),
            "" if quantity["unit"] == "1" else quantity["unit"],
        )
        for quantity in data["fit"]
    )
    two_peaks = "first and last peak, if this loss acted alone"
    grid = TableCells(("", "whole signal", "turning points", two_peaks, "unit"), rows)
    summary, ranked, _ = data["sentence"].partition(" (BIC ")
    summary += "." if ranked else ""
    text = f"Decay of {data['record']}: signal, turning points, envelope and fit, and residuals. {summary}"
    picture = read_picture(folder / "figure.svg", text)
    folded = (("Combinations of losses, best first", law_table(data["laws"], data["unit"])),)
    return SectionItem(data["record"], (summary, *data["remarks"]), grid, picture, folded)


def law_table(laws: list[dict[str, Any]], unit: str) -> TableCells:
    """Return the table of fitted combinations of losses, best first."""
    rows = (
        (
            ", ".join(LOSSES.get(term, term) for term in law["terms"]),
            format_cell(law["bic"], ".1f"),
            format_cell(law["residual"], ".3g"),
        )
        for law in laws
    )
    return TableCells(("losses", "BIC, smaller is better", f"rms residual [{unit}]"), tuple(rows))


def steps_section(scenes: Sequence[PublishedScene], results: Path) -> Section:
    cases = [results / scene.name for scene in scenes if (results / scene.name / "steps.csv").is_file()]
    items = [read_item(case, steps_item) for case in cases]
    rows = [row for part in items if part.grid for row in part.grid.rows]
    heads = next((part.grid.heads for part in items if part.grid), ())
    parts = [SectionItem("Internal steps of the solver", (), TableCells(heads, tuple(rows)))] if rows else []
    parts += [part for part in items if not part.grid]
    intro = (
        "Internal steps, read from solver.t_next, independent of the communication step. If friction jumps without an "
        "event, the steps collapse at every reversal; with stick and slip as modes they do not."
    )
    return Section("steps", "Steps", intro, tuple(parts), () if rows else (("steps", "python -m harness"),))


def steps_item(folder: Path) -> SectionItem:
    """Return the table row of one case."""
    _, h, rejected = np.array(read_table(folder / "steps.csv", cut=False).rows, float).T
    quantities = step_sizes(h, int(rejected.sum()))
    row = (folder.name, *(" ".join(quantity.formatted()).strip() for quantity in quantities))
    return SectionItem(folder.name, grid=TableCells(("case", *(quantity.text for quantity in quantities)), (row,)))


def precision_section(scenes: Sequence[PublishedScene], results: Path) -> Section:
    parts, missing, folder = [], [], results / "precision"
    models = {scene.model for scene in scenes}
    for model in sorted(models | {file.stem for file in folder.glob("*.svg")}):
        if not (folder / f"{model}.svg").is_file():
            missing.append((model, f"python -m harness precision {model}"))
            continue
        parts.append(read_item(folder / model, precision_item))
        if model in models and not (folder / f"{model}-exchange.csv").is_file():
            command = f"python build_fmus.py {model} --fmi 3 && python -m harness precision {model}"
            missing.append((f"{model} in model exchange", command))
    parts += read_items(folder, "anchors.csv", partial(table_item, "Problems from the literature"))
    intro = (
        "Error against run time and right-hand side evaluations; lower left is better. References are certified. FMU "
        "is the code of the FMU in this process; scipy and cvode solve the same equations."
    )
    return Section("precision", "Error against run time", intro, tuple(parts), tuple(missing))


def precision_item(path: Path) -> SectionItem:
    """Return the item of one model, whose files start with its name."""
    picture = read_picture(
        path.with_suffix(".svg"),
        f"{path.name}: run time and right-hand side evaluations over the largest error, by method",
    )
    text, exchanged = path.with_suffix(".txt"), path.with_name(f"{path.name}-exchange.csv")
    sentence = text.read_text(encoding="utf-8").strip().removeprefix(f"{path.name}: ") if text.is_file() else ""
    folded = (("Model exchange with fmpy's CVode", read_table(exchanged)),) if exchanged.is_file() else ()
    return SectionItem(path.name, split_clauses(sentence), None, picture, folded)


def split_clauses(text: str) -> tuple[str, ...]:
    """Split a recommendation at its semicolons, except those in parentheses, into sentences.

    >>> split_clauses("use exact (1e-15; ode45 2 times); no more.")
    ('Use exact (1e-15; ode45 2 times).', 'No more.')
    """
    clauses = re.split(r"; (?![^()]*\))", text.rstrip("."))
    return tuple(f"{clause[:1].upper()}{clause[1:]}." for clause in clauses if clause)


def stability_section(results: Path) -> Section:
    intro = "Every case either finishes within its error bound or is rejected with an error message; none hangs."
    parts = read_items(results, "stability/stability.csv", stability_item)
    return make_section("stability", "Stability", intro, parts, "stability", "stability")


def stability_item(file: Path) -> SectionItem:
    cells = read_table(file, cut=False)
    column = {name: i for i, name in enumerate(cells.heads)}
    counts = Counter((row[column["model"]], row[column["method"]], row[column["ended"]]) for row in cells.rows)
    kinds = sorted({ending for _, _, ending in counts})
    pairs = sorted({(model, method) for model, method, _ in counts})
    rows = tuple((*pair, *(str(counts[(*pair, kind)]) for kind in kinds)) for pair in pairs)
    heads = ("model", "method", *("failed" if kind == FAILED else kind for kind in kinds))
    failed = [row for row in cells.rows if row[column["ended"]] == FAILED]
    reasons = tuple(tuple(row[column[name]] for name in ("model", "scene", "method", "sentence")) for row in failed)
    picture = read_picture(
        file.with_name("region.svg"),
        "Internal steps of each method over x_m, the speed of maximum friction",
    )
    outcomes = "Number of outcomes by model and method", TableCells(heads, rows)
    n_passed = len(cells.rows) - len(failed)
    text = f"{n_passed} of {len(cells.rows)} stiff and extreme cases ended as expected."
    if not failed:
        return SectionItem("Outcomes", (text,), outcomes[1], picture)
    failures = TableCells(("model", "case", "method", "reason"), reasons)
    return SectionItem("Outcomes", (text, "The other cases:"), failures, picture, (outcomes,))


def importers_section(results: Path) -> Section:
    parts = read_items(results, "importers/importers.csv", partial(table_item, "Checks"))
    intro = (
        "The same FMUs in other tools. Numbers are the largest difference from fmpy, relative to the largest value; "
        "message: the tool reports the error of the FMU; - : not checked with this tool."
    )
    return make_section("importers", "Importers", intro, parts, "importers", "importers")


def sweeps_section(results: Path) -> Section:
    command = "sweep stickslip --vary mu_d=0.3:0.9:60 --vary v_driver=0.01:0.1:60 --measure slips"
    intro = "Parameter sweeps; known boundaries are dashed."
    return make_section(
        "sweeps", "Sweeps", intro, read_items(results, "sweep/[!.]*/sweep.csv", sweep_item), "a sweep", command
    )


def sweep_item(folder: Path) -> SectionItem:
    with (folder / "sweep.csv").open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file)  # read row by row: there may be millions
        heads = next(rows)
        error_column = heads.index("error")
        failed = Counter(bool(row[error_column]) for row in rows)
    measured = ", ".join(heads[:error_column])
    text = f"{failed.total()} runs, {failed[True]} failed. Columns: {measured}."
    return SectionItem(folder.name, (text,), None, read_picture(folder / "figure.svg", f"Sweep {folder.name}. {text}"))


def comparisons_section(results: Path) -> Section:
    intro, command = "Differences between two results or FMUs.", "compare results/coulomb results/coulomb-sign"
    parts = read_items(results, "compare/[!.]*/compare.json", comparison_item)
    return make_section("compare", "Comparisons", intro, parts, "a comparison", command)


def comparison_item(folder: Path) -> SectionItem:
    data = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    formats = {"largest": ".3e", "rms": ".3e", "relative": ".2e"}
    rows = tuple(
        (variable["name"], *(format_cell(variable[key], spec) for key, spec in formats.items()), variable["unit"])
        for variable in data["variables"]
    )
    grid = TableCells(("variable", "largest", "rms", "relative", "unit"), rows)
    title = f"{data['one']['name']} and {data['two']['name']}"
    notes = tuple(filter(None, (data["one"]["note"], data["two"]["note"], data["events"])))
    return SectionItem(title, notes, grid, read_picture(folder / "figure.svg", f"{title}, and their difference"))


def coupled_section(results: Path) -> Section:
    intro = "Coupled FMUs, run by existing engines and compared with one model of the whole system."
    parts = read_items(results, "coupled/[!.]*/error.csv", coupled_item)
    return make_section("coupled", "Coupled", intro, parts, "a coupled scene", "couple two-masses")


def coupled_item(folder: Path) -> SectionItem:
    alternative = (
        f"Coupled scene {folder.name}: positions with the monolithic reference, and error over the communication step"
    )
    return SectionItem(
        folder.name, (), read_table(folder / "error.csv"), read_picture(folder / "figure.svg", alternative)
    )


def bench_section(results: Path) -> Section:
    parts = read_items(results, "bench/bench.csv", bench_item)
    intro = "Targets, measured values and baselines of the same run. Times depend on the machine and on its load."
    return make_section("bench", "Benchmarks", intro, parts, "benchmarks", "bench")


def bench_item(file: Path) -> SectionItem:
    """Return the item of the benchmarks; those that meet their target or were not measured are folded."""
    with file.open(encoding="utf-8", newline="") as text:
        rows = list(csv.DictReader(text))
    groups: dict[str, list[tuple[str, ...]]] = {"missed": [], "met": [], "not measured": []}
    for _, same in groupby(rows, key=lambda row: row["benchmark"]):
        baselines = list(same)
        first = baselines[0]
        outcome = "not measured" if first["measured"] == "nan" else "met" if first["met"] == "True" else "missed"
        groups[outcome].append(bench_row(first, baselines))
    n_measured = len(groups["met"]) + len(groups["missed"])
    sentence = f"{len(groups['met'])} of {n_measured} targets met."
    heads = ("benchmark", "measured", "target", "unit", "baselines")
    missed = TableCells(heads, tuple(groups["missed"])) if groups["missed"] else None
    titles = {"met": "Targets that are met", "not measured": "Not measured"}
    folded = tuple((titles[name], TableCells(heads, tuple(groups[name]))) for name in titles if groups[name])
    sentences = (sentence, "Targets that are missed:") if missed else (sentence,)
    return SectionItem("Targets and measurements", sentences, missed, (), folded)


def bench_row(first: dict[str, str], baselines: list[dict[str, str]]) -> tuple[str, ...]:
    """Return the row of a benchmark, with two digits of what was measured."""
    unit = "" if first["unit"] == "1" else first["unit"]
    compared = [f"{row['baseline']} {round_cell(row['baseline value'])}".strip() for row in baselines]
    measured, target = (
        "" if cell == "nan" else cell for cell in (round_cell(first["measured"]), shorten(first["target"]))
    )
    return first["benchmark"], measured, target, unit, "; ".join(compared)


def round_cell(cell: str) -> str:
    """Round a number to two digits."""
    try:
        return f"{float(cell):.2g}"
    except ValueError:
        return cell


def table_item(title: str, file: Path) -> SectionItem:
    """Return an item with a whole table."""
    return SectionItem(title, (), read_table(file))


def read_picture(file: Path, text: str) -> tuple[Picture, ...]:
    """Return the picture in a file, or nothing if there is no file.

    Raises
    ------
    ValueError
        If the file is not a complete SVG drawing.
    """
    if not file.is_file():
        return ()
    data = file.read_bytes()
    if not (b"<svg" in data and data.rstrip().endswith(b"</svg>")):
        raise ValueError(f"{file.name} is not a complete SVG drawing")
    return (Picture(file, f"data:image/svg+xml;base64,{b64encode(data).decode()}", text),)


def read_table(file: Path, cut: bool = True) -> TableCells:
    """Return the table in a CSV file; if `cut`, long numbers are shortened to four digits."""
    with file.open(encoding="utf-8", newline="") as text:
        heads, *rows = csv.reader(text)
    if any(len(row) != len(heads) for row in rows):
        raise ValueError(f"the rows of {file.name} and its heading differ in length")
    return TableCells(tuple(heads), tuple(tuple(shorten(cell) if cut else cell for cell in row) for row in rows))


def shorten(cell: str) -> str:
    """Shorten a long number to four digits."""
    try:
        return f"{float(cell):.4g}" if len(cell) > MIN_LENGTH else cell
    except ValueError:
        return cell


def format_cell(number: float | None, spec: str) -> str:
    """Format a number, which is None in JSON if it is not finite."""
    return "not finite" if number is None else f"{number:{spec}}"


def format_estimate(estimate: dict[str, Any]) -> str:
    """Format a value with its 95 % interval."""
    if estimate["value"] is None:
        return "not finite"
    low, high = (nan if estimate[end] is None else estimate[end] for end in ("low", "high"))
    return spelled_interval(estimate["value"], low, high)
