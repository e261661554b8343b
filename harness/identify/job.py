"""A measured record or a scene, from its file to what its decay says, in a folder of results."""

from collections.abc import Callable
from dataclasses import asdict
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from ..errors import SceneError
from ..folder import replacing
from ..run import heading, write
from ..scene import check_built, load
from ..terminal import as_text
from .fit import Estimate, Identified, Known, identify
from .record import Columns, Record, read

FOLDER = "decay"
FILES = ("decay.json", "turning-points.csv", "fit.csv", "figure.png")
RECORDS = (".csv", ".txt", ".dat", ".tsv")


def perform(
    source: str, columns: Columns, known: Known, drag: bool, out: Path, report: Callable[[float], None]
) -> tuple[Identified, Path]:
    """Identify the decay of a record's file or of a scene; results go to out/decay/<name>."""
    record, known = load_record(source, columns, known, report)
    found = identify(record, known, drag)
    folder = out / FOLDER / record.name
    with replacing(folder, FILES) as fresh:
        save(found, fresh)
    return found, folder


def load_record(source: str, columns: Columns, known: Known, report: Callable[[float], None]) -> tuple[Record, Known]:
    """The record of a file, or of a run of a scene together with the stiffness that its model has."""
    if Path(source).suffix.lower() in RECORDS:
        return read(Path(source), columns), known
    if Path(source).exists() and Path(source).suffix != ".toml":
        raise SceneError(f"{source} is no record and no scene; a record ends in {', '.join(RECORDS)}, a scene in .toml")
    from ..fmu import simulate

    scene = load(source)
    check_built(scene.fmu)
    for role in ("position", "velocity"):
        if role not in scene.motion:
            raise SceneError(f"scene {scene.name}: a decay needs the {role} among the outputs")
    run = simulate(scene, report)
    unit = run.units[scene.motion["position"]]
    inside = (run.time >= columns.begin) & (run.time <= columns.end)
    record = Record(scene.name, run.time[inside], run.motion("position")[inside], run.motion("velocity")[inside], unit)
    if known.k is None and known.m is None:
        names = ("m", "g", "a") if unit == "rad" else ("k",)
        k = prod(run.parameter(name, "the decay of a scene") for name in names)
        known = Known(k=k, pendulum=unit == "rad")
    return record, known


def save(found: Identified, folder: Path) -> None:
    """Write numbers, turning points, the fitted motion and the figure."""
    from ..plots.decay import draw

    unit = found.record.unit
    (folder / "decay.json").write_text(as_text(numbers(found)) + "\n", encoding="utf-8")
    write(folder / "turning-points.csv", ["t [s]", heading("x", unit)], [found.turns.t, found.turns.x])
    t, x, fitted = found.record.t[found.used], found.record.x[found.used], found.best.x
    heads = ["t [s]", heading("x", unit), heading("fit", unit), heading("residual", unit)]
    write(folder / "fit.csv", heads, [t, x, fitted, x - fitted])
    draw(found, folder / "figure.png")


def numbers(found: Identified) -> dict[str, Any]:
    """Everything found, for JSON."""
    return {
        "record": found.record.name,
        "unit": found.record.unit,
        "sentence": found.sentence,
        "remarks": list(found.remarks),
        "noise": found.turns.noise,
        "residual": found.best.rms,
        "turning points": len(found.turns.t),
        "fit": [asdict(each) for each in found.best.estimates],
        "turning_points": [asdict(each) for each in found.by_turns],
        "published": [asdict(each) for each in found.published],
        "laws": [{"terms": list(fit.terms), "bic": fit.bic, "residual": fit.rms} for fit in found.fits],
    }


def table(found: Identified) -> Table:
    """What was found, three ways side by side, each with half of its 95 % interval."""
    shown = Table(box=SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0), title=found.record.name, title_justify="left")
    shown.add_column("")
    for head in ("whole signal", "turning points", "two peaks"):
        shown.add_column(head, justify="right", no_wrap=True)
    shown.add_column("", no_wrap=True)
    turns = {each.name: each for each in found.by_turns}
    peaks = {each.name: each for each in found.published}
    for each in found.best.estimates:
        cells = [told(by[each.name]) if each.name in by else "" for by in (turns, peaks)]
        unit = "" if each.unit == "1" else each.unit
        shown.add_row(f"{each.text}, {each.name}", told(each), *cells, unit)
    return shown


def told(each: Estimate) -> str:
    """Value, with the digits that its margin leaves, and margin; the value alone where there is none."""
    margin = each.high - each.value
    if not np.isfinite(margin):
        return f"{each.value:.5g}"
    digits = 8
    if margin > 0 and each.value:
        digits = int(np.clip(np.ceil(np.log10(abs(each.value) / margin)) + 1, 1, 8))
    return f"{each.value:.{digits}g} ± {margin:.1e}"
