"""A measured record or a scene, from its file to what its decay says, in a folder of results."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ...analyses.decay.decrement import stiffness
from ...analyses.decay.energy_loss import EnergyLoss, measure_energy_loss
from ...analyses.decay.estimates import KnownParameters
from ...analyses.decay.identification import DecayIdentification, fit_decay
from ...analyses.decay.law import AMPLITUDE, T0
from ...errors import HarnessError, SceneError
from ...records.columns import ColumnOptions, read_record
from ...records.record import Record, check_record
from ...results import provenance
from ...results.files import column_heading, to_json, write_csv
from ...results.folder import replace_folder

FOLDER = "decay"
FILES = ("decay.json", "turning-points.csv", "fit.csv", "figure.svg")


LoadedRecord = tuple[Record, KnownParameters, dict[str, Any]]  # and what their account tells: files, parameters, scene


def identify_decay(
    source: str,
    columns: ColumnOptions,
    known: KnownParameters,
    drag: bool,
    drift: bool,
    out: Path,
    report: Callable[[float], None],
) -> tuple[DecayIdentification, Path]:
    """Identify the decay of a record's file or of a scene; results go to out/decay/<name>."""
    record, force, told = load_record(source, columns, known, report)
    scene = told.pop("scene", {}) | vars(columns) | vars(known) | {"drag": drag, "drift": drift}
    folder = out / FOLDER / record.name
    named = provenance.describe_sources(source)
    with replace_folder(folder, FILES, named) as fresh:  # before the fit: what is in the way is told at once
        found = fit_decay(record, force, drag, drift, report)
        write_results(found, fresh)
        provenance.write_provenance(fresh, **told, scene=scene, source=named)
    return found, folder


@contextmanager
def gc_paused() -> Iterator[None]:
    """Without the collection of cycles: importing, fitting and drawing leave few, and to look for them, also when the
    process ends, takes a quarter of a short command."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def load_record(
    source: str, columns: ColumnOptions, known: KnownParameters, report: Callable[[float], None]
) -> LoadedRecord:
    """The record of a file, or of a run of a scene together with the stiffness that its model has."""
    path = Path(source)
    if source == "-":
        return read_record(source, columns, "stdin"), known, {"files": ()}
    if path.suffix.lower() != ".toml" and (path.is_file() or path.is_fifo() or path.suffix):
        name = path.stem.encode("utf-8", "replace").decode()
        return read_record(source, columns, name), known, {"files": (path,)}
    if path.is_dir():
        raise SceneError(f"{source} is a folder; name a file in it")
    return record_of_scene(source, columns, known, report)


def record_of_scene(
    source: str, columns: ColumnOptions, known: KnownParameters, report: Callable[[float], None]
) -> LoadedRecord:
    """The positions in a run of a scene."""
    from ...running.fmi2 import simulate
    from ...running.run_spec import spec_from_scene
    from ...scenes.fmu_files import check_built
    from ...scenes.scene import load_scene

    scene = load_scene(source)
    check_built(scene.file)
    wanted = spec_from_scene(scene)
    if "position" not in wanted.motion_outputs:
        raise SceneError(f"scene {scene.name}: a decay needs the position among the outputs")
    run = simulate(wanted, report)
    unit = run.units[wanted.motion_outputs["position"]]
    record = Record(scene.name, run.time, run.column_of_role("position"), unit, 0, unit).select(
        columns.begin, columns.end
    )
    check_record(record)
    told = {"files": (scene.file,), "parameters": run.effective_parameters, "scene": vars(scene)}
    if known.k is None and known.m is None:
        with suppress(HarnessError):  # a model without it has no force to tell
            known = KnownParameters(k=stiffness(run, unit == "rad", "the decay of a scene"), pendulum=unit == "rad")
    return record, known, told


def write_results(found: DecayIdentification, folder: Path) -> None:
    """Write numbers, turning points, the fitted motion and the figure."""
    from .figure import draw

    unit = found.record.unit
    loss = measure_energy_loss(found)
    (folder / "decay.json").write_text(to_json(identified_as_json(found, loss)) + "\n", encoding="utf-8")
    write_csv(
        folder / "turning-points.csv",
        ["t [s]", column_heading("x", found.record.base)],
        [found.extrema.t, found.extrema.x],
    )
    fitted = found.signal(found.best, found.t)
    name = ("x", "v", "a")[found.record.order]
    heads = ["t [s]", column_heading(name, unit), column_heading("fit", unit), column_heading("residual", unit)]
    write_csv(folder / "fit.csv", heads, [found.t, found.x, fitted, found.x - fitted])
    draw(found, loss, folder / "figure.svg")


def identified_as_json(found: DecayIdentification, loss: EnergyLoss | None = None) -> dict[str, Any]:
    """Everything found, for JSON."""
    problem, record, best = found.problem, found.record, found.best
    loss = loss or measure_energy_loss(found)
    return {
        "record": record.name,
        "quantity": record.quantity,
        "unit": record.unit,
        "sentence": found.sentence,
        "remarks": list(found.remarks),
        "noise": found.extrema.noise,
        "residual": found.rms,
        "turning points": len(found.extrema.t),
        "used": {
            "from": float(found.t[0]),
            "until": float(found.t[-1]),
            "samples": len(found.t),
            "of": len(record.t),
            "time_unit": "s",
        },
        "release": {
            "time": float(best.p[T0]) + problem.time_origin,
            "amplitude": float(best.p[AMPLITUDE]) * problem.scale,
            "unit": record.base,
        },
        "fit": [asdict(each) for each in found.estimates],
        "turning_points": [asdict(each) for each in found.extrema_estimates],
        "published": [asdict(each) for each in found.two_peak_estimates],
        "why_empty": {name: why for name, why in found.unavailable.items() if why},
        "laws": [
            {
                "terms": list(law.terms),
                "bic": law.bic,
                "residual": float(np.sqrt(law.sum_of_squares / len(found.t))) * problem.scale,
            }
            for law in found.laws
        ],
        "loss": {
            "unit": record.base,
            "amplitude": loss.amplitude.tolist(),
            "share_of_energy": loss.fraction.tolist(),
            "laws": {"+".join(law.terms): loss.curves[law.terms][1].tolist() for law in found.laws},
            "laws_amplitude": {"+".join(law.terms): loss.curves[law.terms][0].tolist() for law in found.laws},
        },
    }
