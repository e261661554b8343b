"""What the report shows, read from results on disk; what is not there is named with the command that makes it."""

import csv
import json
from base64 import b64encode
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

MODELS = {
    "smd": "Spring, mass and viscous damper. Every swing loses the same share: the envelope is an exponential.",
    "coulomb": "Spring and mass with dry friction. Every swing loses the same amount: the envelope is a straight line, "
    "and the mass comes to rest for good where the spring no longer overcomes friction.",
    "stickslip": "A sled pulled through a spring by a driver of constant speed. It sticks while the spring winds up, "
    "breaks away, slips, and sticks again.",
    "pacejka": "The same sled with the smooth friction curve of the magic formula. It never sticks: it creeps, and is "
    "the stiffer the steeper the curve.",
    "pendulum": "A compound pendulum with friction in its pin. Its envelope is nearly a straight line.",
}
CASES = {  # what the published scenes are about
    "smd": ("smd",),
    "coulomb": ("coulomb", "coulomb-sign"),
    "stickslip": ("stickslip", "stickslip-threshold"),
    "pacejka": ("pacejka-0.01", "pacejka-0.001"),
    "pendulum": ("pendulum",),
}
SHORTEST = 12  # decimals cut from long numbers in cells


@dataclass(frozen=True)
class Picture:
    """A PNG file as a data address, with its text alternative."""

    data: str
    text: str


@dataclass(frozen=True)
class Grid:
    """A table: its headings and its rows of texts."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Part:
    """A piece of a section: heading, sentences, table and pictures, as far as there are any."""

    title: str
    sentences: tuple[str, ...] = ()
    grid: Grid | None = None
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Section:
    """A section of the page; `missing` names what its results lack, and the commands that make them."""

    name: str
    title: str
    intro: str
    parts: tuple[Part, ...]
    missing: tuple[tuple[str, str], ...]


def sections(results: Path) -> list[Section]:
    """Every section, from the results below a folder."""
    return [
        make(results)
        for make in (oscillators, decays, steps, precision, stability, importers, sweeps, comparisons, coupled, bench)
    ]


def oscillators(results: Path) -> Section:
    parts, missing = [], []
    for model, text in MODELS.items():
        present = [case for case in CASES[model] if (results / case / "figures.csv").is_file()]
        missing += [(case, f"python -m harness run {case}") for case in CASES[model] if case not in present]
        if not present:
            parts.append(Part(model, (text,)))
        for i, case in enumerate(present):
            grid = table(results / case / "figures.csv")
            picture = drawn(results / case / "figure.png", f"{case}: position, velocity and phase plane of the run")
            parts.append(Part(case, () if i else (text,), grid, picture))
    intro = "What each of the five does, with figures measured here beside those that were published."
    return Section("oscillators", "The five oscillators", intro, tuple(parts), tuple(missing))


def decays(results: Path) -> Section:
    parts = []
    for folder in folders(results / "decay", "decay.json"):
        found = json.loads((folder / "decay.json").read_text(encoding="utf-8"))
        turns = {each["name"]: each for each in found["turning_points"]}
        peaks = {each["name"]: each for each in found["published"]}
        rows = tuple(
            (
                each["text"],
                interval(each),
                interval(turns.get(each["name"])),
                interval(peaks.get(each["name"])),
                unit(each),
            )
            for each in found["fit"]
        )
        grid = Grid(("", "whole signal", "turning points", "first and last peak", "unit"), rows)
        alternative = (
            f"Decay of {found['record']}: signal, turning points, envelope and fit, and residuals. {found['sentence']}"
        )
        sentences = (found["sentence"], *found["remarks"])
        parts.append(Part(found["record"], sentences, grid, drawn(folder / "figure.png", alternative)))
    missing = () if parts else (("a decay", "python -m harness decay coulomb"),)
    intro = "Damping and dry friction told apart, by the whole signal and by its turning points, with 95 % margins."
    return Section("decay", "Decay", intro, tuple(parts), missing)


def steps(results: Path) -> Section:
    rows = []
    for case in (case for cases in CASES.values() for case in cases):
        found = table(results / case / "steps.csv", cut=False)
        if found and found.rows:
            sizes = [float(cells[1]) for cells in found.rows]
            refused = sum(float(cells[2]) for cells in found.rows)
            figures = (f"{1e3 * size:.4g}" for size in (min(sizes), sum(sizes) / len(sizes), max(sizes)))
            rows.append((case, str(len(sizes)), *figures, f"{refused:g}"))
    heads = ("case", "steps", "smallest [ms]", "mean [ms]", "largest [ms]", "refused")
    parts = (Part("The solver's own steps", (), Grid(heads, tuple(rows))),) if rows else ()
    intro = (
        "Seen through solver.t_next, whatever the communication step. Where friction is a jump that the solver is not "
        "told of, its steps collapse at every reversal; where stick and slip are modes, they do not."
    )
    return Section("steps", "Steps", intro, parts, () if rows else (("steps", "python -m harness"),))


def precision(results: Path) -> Section:
    parts, missing = [], []
    for model in MODELS:
        picture = drawn(
            results / "precision" / f"{model}.png",
            f"{model}: run time and right-hand sides over the largest error, by method",
        )
        if picture:
            text = results / "precision" / f"{model}.txt"
            said = (text.read_text(encoding="utf-8").strip(),) if text.is_file() else ()
            exchanged = table(results / "precision" / f"{model}-exchange.csv")
            parts.append(Part(model, said, exchanged, picture))
            if not exchanged:
                again = f"python build_fmus.py {model} --fmi 3 && python -m harness precision {model}"
                missing.append((f"{model} in model exchange", again))
        else:
            missing.append((model, f"python -m harness precision {model}"))
    anchors = table(results / "precision" / "anchors.csv")
    if anchors:
        parts.append(Part("Anchors from the literature", (), anchors))
    intro = "Error against run time and against right-hand sides; lower left is better. References are certified."
    return Section("precision", "Error against run time", intro, tuple(parts), tuple(missing))


def stability(results: Path) -> Section:
    file, parts = results / "stability/stability.csv", []
    found = table(file, cut=False)
    if found:
        at = {name: i for i, name in enumerate(found.heads)}
        endings = Counter((row[at["model"]], row[at["method"]], row[at["ended"]]) for row in found.rows)
        kinds = sorted({ending for _, _, ending in endings})
        pairs = sorted(
            {(model, method) for model, method, _ in endings}, key=lambda pair: (list(MODELS).index(pair[0]), pair)
        )
        rows = tuple((*pair, *(str(endings[(*pair, kind)]) for kind in kinds)) for pair in pairs)
        picture = drawn(
            results / "stability/region.png", "Steps of each method over the speed at the peak of the friction curve"
        )
        text = f"{len(found.rows)} stiff and extreme cases; how each ended:"
        parts.append(Part("Endings", (text,), Grid(("model", "method", *kinds), rows), picture))
    intro = "Every case either finishes within its error bound or is refused with a sentence: none hangs, none lies."
    missing = () if parts else (("stability", "python -m harness stability"),)
    return Section("stability", "Stability", intro, tuple(parts), missing)


def importers(results: Path) -> Section:
    found = table(results / "importers/importers.csv")
    parts = (Part("Checks", (), found),) if found else ()
    missing = () if found else (("importers", "python -m harness importers"),)
    return Section("importers", "Importers", "The same FMUs in other tools, beside fmpy.", parts, missing)


def sweeps(results: Path) -> Section:
    parts = []
    for folder in folders(results / "sweep", "sweep.csv"):
        found = table(folder / "sweep.csv", cut=False)
        assert found is not None
        failed = sum(bool(row[found.heads.index("error")]) for row in found.rows)
        measured = [head for head in found.heads if head != "error"]
        text = f"{len(found.rows)} runs, {failed} failed. Columns: {', '.join(measured)}."
        parts.append(Part(folder.name, (text,), None, drawn(folder / "figure.png", f"Sweep {folder.name}. {text}")))
    command = "python -m harness sweep stickslip --vary mu_d=0.3:0.9:60 --vary v_driver=0.01:0.1:60 --measure slips"
    intro = "What happens over many parameters; known boundaries are dashed."
    return Section("sweeps", "Sweeps", intro, tuple(parts), () if parts else (("a sweep", command),))


def comparisons(results: Path) -> Section:
    parts = []
    for folder in folders(results / "compare", "compare.json"):
        found = json.loads((folder / "compare.json").read_text(encoding="utf-8"))
        rows = tuple(
            (each["name"], f"{each['largest']:.3g}", f"{each['rms']:.3g}", f"{each['relative']:.2g}", each["unit"])
            for each in found["variables"]
        )
        grid = Grid(("variable", "largest", "rms", "relative", "unit"), rows)
        said = tuple(filter(None, (found["one"]["note"], found["two"]["note"], found["events"])))
        picture = drawn(
            folder / "figure.png", f"{found['one']['name']} and {found['two']['name']}, and their difference"
        )
        parts.append(Part(f"{found['one']['name']} and {found['two']['name']}", said, grid, picture))
    command = "python -m harness compare results/coulomb results/coulomb-sign"
    intro = "How far two results or two FMUs are apart."
    return Section("compare", "Comparisons", intro, tuple(parts), () if parts else (("a comparison", command),))


def coupled(results: Path) -> Section:
    parts = []
    for folder in folders(results / "coupled", "error.csv"):
        alternative = f"Coupled scene {folder.name}: positions beside the monolithic reference, and error over the step"
        parts.append(Part(folder.name, (), table(folder / "error.csv"), drawn(folder / "figure.png", alternative)))
    missing = () if parts else (("a coupled scene", "python -m harness couple two-masses"),)
    intro = "Several FMUs joined, run by an existing engine, beside one model of the whole."
    return Section("coupled", "Coupled", intro, tuple(parts), missing)


def bench(results: Path) -> Section:
    found = table(results / "bench/bench.csv")
    parts = (Part("Reached and seen", (), found),) if found else ()
    missing = () if found else (("numbers", "python -m harness bench"),)
    return Section("bench", "Numbers", "What was to be reached, and what was measured beside it.", parts, missing)


def folders(parent: Path, file: str) -> list[Path]:
    """The result folders below a folder that hold a file, by name."""
    return sorted(path.parent for path in parent.glob(f"[!.]*/{file}"))


def drawn(file: Path, text: str) -> tuple[Picture, ...]:
    """The picture in a file, if there is one."""
    if not file.is_file():
        return ()
    return (Picture(f"data:image/png;base64,{b64encode(file.read_bytes()).decode()}", text),)


def table(file: Path, cut: bool = True) -> Grid | None:
    """The table in a CSV file, if there is one; `cut`: long numbers to four digits."""
    if not file.is_file():
        return None
    with file.open(encoding="utf-8", newline="") as text:
        heads, *rows = csv.reader(text)
    return Grid(tuple(heads), tuple(tuple(shortened(cell) if cut else cell for cell in row) for row in rows))


def shortened(cell: str) -> str:
    """A number of many digits with four of them."""
    try:
        return f"{float(cell):.4g}" if len(cell) > SHORTEST else cell
    except ValueError:
        return cell


def interval(each: dict | None) -> str:
    """Value and half of its 95 % interval, where there is one."""
    if each is None:
        return ""
    if each["high"] is None:
        return f"{each['value']:.5g}"
    return f"{each['value']:.7g} ± {each['high'] - each['value']:.1g}"


def unit(each: dict) -> str:
    return "" if each["unit"] == "1" else each["unit"]
