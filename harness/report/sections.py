"""What the report shows, read from results on disk; what is not there is named with the command that makes it."""

import csv
import json
from base64 import b64encode
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import first_line
from ..results import provenance
from ..results.quantity import format_interval as spelled_interval
from ..results.step_sizes import step_size_quantities as step_sizes

TRAJECTORY_FILE = "trajectory.csv"
SHORTEST = 12  # decimals cut from long numbers in cells


@dataclass(frozen=True)
class PublishedScene:
    """A scene with figures that others published: its name, that of its model, and what this does, where it says so."""

    name: str
    model: str
    about: str


@dataclass(frozen=True)
class Picture:
    """An SVG file, the same as a data address, and its text alternative."""

    file: Path
    data: str
    text: str


@dataclass(frozen=True)
class TableCells:
    """A table: its headings and its rows of texts."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class SectionItem:
    """A piece of a section: heading, sentences, table and pictures, as far as there are any, sentences on
    their origin, and files of its numbers; `lost` if its results could not be read, which a sentence says."""

    title: str
    sentences: tuple[str, ...] = ()
    grid: TableCells | None = None
    pictures: tuple[Picture, ...] = ()
    unreadable: bool = False
    origin: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Section:
    """A section of the page; `missing` names what its results lack, and the commands that make them."""

    name: str
    title: str
    intro: str
    parts: tuple[SectionItem, ...]
    missing: tuple[tuple[str, str], ...]


def build_sections(results: Path, scenes: Sequence[PublishedScene]) -> list[Section]:
    """Every section, from the results below a folder; those of the published scenes stand first."""
    found = [
        *(oscillators(scenes, results), runs(scenes, results), decays(results), steps(scenes, results)),
        *(precision(scenes, results), stability(results), importers(results), sweeps(results)),
        *(comparisons(results), coupled(results), bench(results)),
    ]
    return [each for each in found if each.parts or each.missing]


def section(name: str, title: str, intro: str, parts: list[SectionItem], lack: str, command: str) -> Section:
    """A section that lacks nothing as soon as it has a part."""
    return Section(name, title, intro, tuple(parts), () if parts else ((lack, f"python -m harness {command}"),))


def items(results: Path, pattern: str, show: Callable[[Path], SectionItem]) -> list[SectionItem]:
    """What is shown of every file of a pattern below a folder; of the folder that holds it, where that is free."""
    files = sorted(results.glob(pattern))
    return [read(file.parent if "*" in pattern else file, show) for file in files]


def read(place: Path, make: Callable[[Path], SectionItem]) -> SectionItem:
    """What is made of a file or folder of results; a sentence in its place if that holds something else."""
    try:
        part = make(place)
        return replace(part, origin=origin(place), files=numbers(place)) if part.grid or part.pictures else part
    except Exception as error:  # it may hold anything: half of a file, another version's, somebody else's
        return SectionItem(
            place.name,
            (f"{place} cannot be shown ({type(error).__name__}: {first_line(error)[:100]}).",),
            unreadable=True,
        )


def origin(place: Path) -> tuple[str, ...]:
    """Where the results at a place came from: told in their folder, or in a file of their own beside them."""
    own = place.with_suffix(".json")
    return provenance.summarize_provenance(
        own if own.is_file() else (place if place.is_dir() else place.parent) / provenance.FILE
    )


def numbers(place: Path) -> tuple[Path, ...]:
    """The CSV files of the results at a place: those in its folder, or those whose names begin with its own."""
    return tuple(sorted(place.glob("*.csv") if place.is_dir() else place.parent.glob(f"{place.stem}*.csv")))


def oscillators(scenes: Sequence[PublishedScene], results: Path) -> Section:
    parts, missing = [], []
    for scene in scenes:
        said = (scene.about,) if scene.about else ()
        if (results / scene.name / "quantities.csv").is_file():
            parts.append(read(results / scene.name, partial(oscillator, said)))
        else:
            missing.append((scene.name, f"python -m harness run {scene.name}"))
            parts += [SectionItem(scene.name, said)] if said else []
    intro = "What each of them does, with figures measured here beside those that were published."
    return Section("oscillators", "The oscillators", intro, tuple(parts), tuple(missing))


def oscillator(said: tuple[str, ...], folder: Path) -> SectionItem:
    picture = drawn(folder / "figure.svg", f"{folder.name}: position, velocity and phase plane of the run")
    return SectionItem(folder.name, said, table(folder / "quantities.csv", cut=False), picture)


def runs(scenes: Sequence[PublishedScene], results: Path) -> Section:
    """What was run besides: scenes and FMUs of whoever reads the page."""
    cases = [scene.name for scene in scenes]
    found = sorted(file.parent for file in results.glob(f"[!.]*/{TRAJECTORY_FILE}"))
    others = [folder for folder in found if folder.name not in cases or not (folder / "quantities.csv").is_file()]
    intro = "Scenes and FMUs of one's own, from their first value to their last."
    return Section("runs", "Other runs", intro, tuple(read(folder, own) for folder in others), ())


def own(folder: Path) -> SectionItem:
    figures, recorded = folder / "quantities.csv", table(folder / TRAJECTORY_FILE)
    rows = tuple(zip(recorded.heads, recorded.rows[0], recorded.rows[-1], strict=True))
    grid = table(figures, cut=False) if figures.is_file() else TableCells(("", "first", "last"), rows)
    return SectionItem(
        folder.name, (), grid, drawn(folder / "figure.svg", f"{folder.name}: the plots that its scene names")
    )


def decays(results: Path) -> Section:
    intro = "Damping and dry friction told apart, by the whole signal and by its turning points, with 95 % margins."
    parts = items(results, "decay/[!.]*/decay.json", decay)
    return section("decay", "Decay", intro, parts, "a decay", "decay coulomb")


def decay(folder: Path) -> SectionItem:
    found = json.loads((folder / "decay.json").read_text(encoding="utf-8"))
    ways = [{one["name"]: interval(one) for one in found[way]} for way in ("fit", "turning_points", "published")]
    rows = tuple(
        (one["text"], *(way.get(one["name"], "") for way in ways), "" if one["unit"] == "1" else one["unit"])
        for one in found["fit"]
    )
    grid = TableCells(("", "whole signal", "turning points", "first and last peak", "unit"), rows)
    said = found["sentence"]
    text = f"Decay of {found['record']}: signal, turning points, envelope and fit, and residuals. {said}"
    return SectionItem(found["record"], (said, *found["remarks"]), grid, drawn(folder / "figure.svg", text))


def steps(scenes: Sequence[PublishedScene], results: Path) -> Section:
    cases = [results / scene.name for scene in scenes if (results / scene.name / "steps.csv").is_file()]
    made = [read(case, sizes) for case in cases]
    rows = [row for part in made if part.grid for row in part.grid.rows]
    heads = next((part.grid.heads for part in made if part.grid), ())
    parts = [SectionItem("The solver's own steps", (), TableCells(heads, tuple(rows)))] if rows else []
    parts += [part for part in made if not part.grid]
    intro = (
        "Seen through solver.t_next, whatever the communication step. Where friction is a jump that the solver is not "
        "told of, its steps collapse at every reversal; where stick and slip are modes, they do not."
    )
    return Section("steps", "Steps", intro, tuple(parts), () if rows else (("steps", "python -m harness"),))


def sizes(folder: Path) -> SectionItem:
    """The row of one case."""
    _, h, rejected = np.array(table(folder / "steps.csv", cut=False).rows, float).T
    told = step_sizes(h, int(rejected.sum()))
    row = (folder.name, *(" ".join(each.formatted()).strip() for each in told))
    return SectionItem(folder.name, grid=TableCells(("case", *(each.text for each in told)), (row,)))


def precision(scenes: Sequence[PublishedScene], results: Path) -> Section:
    parts, missing, folder = [], [], results / "precision"
    models = {scene.model for scene in scenes}
    for model in sorted(models | {file.stem for file in folder.glob("*.svg")}):
        if not (folder / f"{model}.svg").is_file():
            missing.append((model, f"python -m harness precision {model}"))
            continue
        parts.append(read(folder / model, tradeoff))
        if model in models and not (folder / f"{model}-exchange.csv").is_file():
            again = f"python build_fmus.py {model} --fmi 3 && python -m harness precision {model}"
            missing.append((f"{model} in model exchange", again))
    parts += items(folder, "anchors.csv", partial(whole, "Anchors from the literature"))
    intro = "Error against run time and against right-hand sides; lower left is better. References are certified."
    return Section("precision", "Error against run time", intro, tuple(parts), tuple(missing))


def tradeoff(place: Path) -> SectionItem:
    """One model's, whose files begin with its name."""
    picture = drawn(
        place.with_suffix(".svg"), f"{place.name}: run time and right-hand sides over the largest error, by method"
    )
    text, exchanged = place.with_suffix(".txt"), place.with_name(f"{place.name}-exchange.csv")
    said = (text.read_text(encoding="utf-8").strip(),) if text.is_file() else ()
    return SectionItem(place.name, said, table(exchanged) if exchanged.is_file() else None, picture)


def stability(results: Path) -> Section:
    intro = "Every case either finishes within its error bound or is refused with a sentence: none hangs, none lies."
    parts = items(results, "stability/stability.csv", endings)
    return section("stability", "Stability", intro, parts, "stability", "stability")


def endings(file: Path) -> SectionItem:
    found = table(file, cut=False)
    at = {name: i for i, name in enumerate(found.heads)}
    counts = Counter((row[at["model"]], row[at["method"]], row[at["ended"]]) for row in found.rows)
    kinds = sorted({ending for _, _, ending in counts})
    pairs = sorted({(model, method) for model, method, _ in counts})
    rows = tuple((*pair, *(str(counts[(*pair, kind)]) for kind in kinds)) for pair in pairs)
    picture = drawn(
        file.with_name("region.svg"), "Steps of each method over the speed at the peak of the friction curve"
    )
    text = f"{len(found.rows)} stiff and extreme cases; how each ended:"
    return SectionItem("Endings", (text,), TableCells(("model", "method", *kinds), rows), picture)


def importers(results: Path) -> Section:
    parts = items(results, "importers/importers.csv", partial(whole, "Checks"))
    intro = "The same FMUs in other tools, beside fmpy."
    return section("importers", "Importers", intro, parts, "importers", "importers")


def sweeps(results: Path) -> Section:
    command = "sweep stickslip --vary mu_d=0.3:0.9:60 --vary v_driver=0.01:0.1:60 --measure slips"
    intro = "What happens over many parameters; known boundaries are dashed."
    return section("sweeps", "Sweeps", intro, items(results, "sweep/[!.]*/sweep.csv", swept), "a sweep", command)


def swept(folder: Path) -> SectionItem:
    with (folder / "sweep.csv").open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file)  # one at a time: there may be millions
        heads = next(rows)
        place = heads.index("error")
        failed = Counter(bool(row[place]) for row in rows)
    measured = ", ".join(heads[:place])
    text = f"{failed.total()} runs, {failed[True]} failed. Columns: {measured}."
    return SectionItem(folder.name, (text,), None, drawn(folder / "figure.svg", f"Sweep {folder.name}. {text}"))


def comparisons(results: Path) -> Section:
    intro, command = "How far two results or two FMUs are apart.", "compare results/coulomb results/coulomb-sign"
    parts = items(results, "compare/[!.]*/compare.json", comparison)
    return section("compare", "Comparisons", intro, parts, "a comparison", command)


def comparison(folder: Path) -> SectionItem:
    found = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
    figures = {"largest": ".3e", "rms": ".3e", "relative": ".2e"}
    rows = tuple(
        (one["name"], *(digits(one[key], how) for key, how in figures.items()), one["unit"])
        for one in found["variables"]
    )
    grid = TableCells(("variable", "largest", "rms", "relative", "unit"), rows)
    title = f"{found['one']['name']} and {found['two']['name']}"
    said = tuple(filter(None, (found["one"]["note"], found["two"]["note"], found["events"])))
    return SectionItem(title, said, grid, drawn(folder / "figure.svg", f"{title}, and their difference"))


def coupled(results: Path) -> Section:
    intro = "Several FMUs joined, run by an existing engine, beside one model of the whole."
    parts = items(results, "coupled/[!.]*/error.csv", pair)
    return section("coupled", "Coupled", intro, parts, "a coupled scene", "couple two-masses")


def pair(folder: Path) -> SectionItem:
    alternative = f"Coupled scene {folder.name}: positions beside the monolithic reference, and error over the step"
    return SectionItem(folder.name, (), table(folder / "error.csv"), drawn(folder / "figure.svg", alternative))


def bench(results: Path) -> Section:
    parts = items(results, "bench/bench.csv", partial(whole, "Reached and seen"))
    intro = "What was to be reached, and what was measured beside it."
    return section("bench", "Numbers", intro, parts, "numbers", "bench")


def whole(title: str, file: Path) -> SectionItem:
    """All of a table."""
    return SectionItem(title, (), table(file))


def drawn(file: Path, text: str) -> tuple[Picture, ...]:
    """The picture in a file, if there is one."""
    if not file.is_file():
        return ()
    data = file.read_bytes()
    if not (b"<svg" in data and data.rstrip().endswith(b"</svg>")):
        raise ValueError(f"{file.name} is not a whole SVG drawing")
    return (Picture(file, f"data:image/svg+xml;base64,{b64encode(data).decode()}", text),)


def table(file: Path, cut: bool = True) -> TableCells:
    """The table in a CSV file; `cut`: long numbers to four digits."""
    with file.open(encoding="utf-8", newline="") as text:
        heads, *rows = csv.reader(text)
    if any(len(row) != len(heads) for row in rows):
        raise ValueError(f"a row of {file.name} has more or fewer cells than its heading")
    return TableCells(tuple(heads), tuple(tuple(shortened(cell) if cut else cell for cell in row) for row in rows))


def shortened(cell: str) -> str:
    """A number of many digits with four of them."""
    try:
        return f"{float(cell):.4g}" if len(cell) > SHORTEST else cell
    except ValueError:
        return cell


def digits(number: float | None, how: str) -> str:
    """A number written so; none where JSON had no number for it."""
    return "not finite" if number is None else f"{number:{how}}"


def interval(one: dict[str, Any]) -> str:
    """Value and 95 % interval."""
    if one["value"] is None:
        return "not finite"
    low, high = (nan if one[end] is None else one[end] for end in ("low", "high"))
    return spelled_interval(one["value"], low, high)
