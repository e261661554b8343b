"""Study that identifies the decay of a measured record or a scene, and writes the result folder."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from os.path import exists
from pathlib import Path
from typing import Any

import numpy as np

from ...analyses.decay.estimates import KnownParameters
from ...analyses.decay.identification import DecayIdentification, fit_decay
from ...analyses.decay.law import AMPLITUDE, T0
from ...analyses.estimation.estimate import ColumnResiduals, UsedSamples, shared_json
from ...errors import HarnessError, SceneError, format_value
from ...records.columns import ColumnOptions, read_record
from ...records.record import Record, check_record
from ...results import provenance
from ...results.files import column_heading, to_json, write_csv
from ...results.folder import replace_folder
from ...results.summary import write_summary
from .table import summarize_decay

FOLDER = "decay"
FILES = ("decay.json", "turning-points.csv", "fit.csv", "figure.svg")


LoadedRecord = tuple[Record, KnownParameters, dict[str, Any]]  # with provenance: files, parameters, run


def identify_decay(
    source: str,
    columns: ColumnOptions,
    parameters: KnownParameters,
    drag: bool,
    drift: bool,
    out: Path,
    report: Callable[[float], None],
) -> tuple[DecayIdentification, Path]:
    """Identify the decay of a record file or a scene, and write the results to out/decay/<name>."""
    record, properties, provenance_data = load_record(source, columns, parameters, report)
    options = vars(columns) | vars(parameters) | {"drag": drag, "drift": drift}
    folder = out / FOLDER / record.name
    source_text = provenance.describe_sources(source)
    # opened before the fit, so that conflicts are reported at once
    with replace_folder(folder, FILES, source_text) as new_folder:
        identification = fit_decay(record, properties, drag, drift, report)
        write_results(identification, new_folder)
        provenance.write_provenance(new_folder, **provenance_data, scene=options, source=source_text)
        write_summary(new_folder, summarize_decay(identification))
    return identification, folder


@contextmanager
def pause_gc() -> Iterator[None]:
    """Pause garbage collection of cycles in the block; it takes a quarter of the run time of a short command."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def load_record(
    source: str, columns: ColumnOptions, parameters: KnownParameters, report: Callable[[float], None]
) -> LoadedRecord:
    """Load the record of a file, or run a scene and take the stiffness from its model."""
    path = Path(source)
    if source == "-":
        return read_record(source, columns, "stdin"), parameters, {"files": ()}
    if is_record_file(source):
        if not exists(source):
            raise SceneError(f"{format_value(source)} does not exist: give an existing record, or a scene")
        name = path.stem.encode("utf-8", "replace").decode()
        return read_record(source, columns, name), parameters, {"files": (path,)}
    if path.is_dir():
        raise SceneError(f"{source} is a folder; give a file in it")
    return record_of_scene(source, columns, parameters, report)


def is_record_file(source: str) -> bool:
    """Return whether a source of the command decay is a record, not a scene."""
    path = Path(source)
    return source == "-" or (path.suffix.lower() != ".toml" and (path.is_file() or path.is_fifo() or bool(path.suffix)))


def record_of_scene(
    source: str, columns: ColumnOptions, parameters: KnownParameters, report: Callable[[float], None]
) -> LoadedRecord:
    """Run a scene and return its position as a record."""
    from ...analyses.decay.decrement import stiffness
    from ...running.runner import run as run_fmu
    from ...scenes.fmu_files import check_built
    from ...scenes.scene import load_scene

    scene = load_scene(source)
    check_built(scene.run.fmu)
    if "position" not in scene.run.motion_outputs:
        raise SceneError(f"scene {scene.name}: a decay needs the position among the outputs")
    run = run_fmu(scene.run, report)
    if run.failure:
        raise HarnessError(f"scene {scene.name}: {run.failure}")
    position = run.spec.motion_outputs["position"]
    unit = run.units[position]
    if not unit:
        raise SceneError(
            f"scene {scene.name}: {position} has no unit in {run.spec.fmu.name}: run the scene, and identify the decay "
            "in its trajectory.csv with --unit"
        )
    record = Record(scene.name, run.time, run.column_of_role("position"), unit, 0, unit).select(
        columns.begin, columns.end
    )
    check_record(record)
    provenance_data = {"files": (run.spec.fmu,), "parameters": run.effective_parameters, "run": run.spec}
    if parameters.k is None and parameters.m is None:
        with suppress(HarnessError):  # a model without stiffness has no friction force
            parameters = KnownParameters(
                k=stiffness(run, unit == "rad", "the decay of a scene"), pendulum=unit == "rad"
            )
    return record, parameters, provenance_data


def write_results(identification: DecayIdentification, folder: Path) -> None:
    """Write decay.json, turning points, fit and figure."""
    from .figure import draw

    unit = identification.record.unit
    (folder / "decay.json").write_text(to_json(identification_as_json(identification)) + "\n", encoding="utf-8")
    write_csv(
        folder / "turning-points.csv",
        ["t [s]", column_heading("x", identification.record.base)],
        [identification.extrema.t, identification.extrema.x],
    )
    name = identification.record.symbol
    headings = ["t [s]", column_heading(name, unit), column_heading("fit", unit), column_heading("residual", unit)]
    columns = [
        identification.t,
        identification.x,
        identification.fit_values,
        identification.x - identification.fit_values,
    ]
    write_csv(folder / "fit.csv", headings, columns)
    draw(identification, folder / "figure.svg")


def identification_as_json(identification: DecayIdentification) -> dict[str, Any]:
    """Return the identified decay for JSON output."""
    problem, record, best = identification.problem, identification.record, identification.best
    loss = identification.energy_loss
    samples = UsedSamples(record.name, identification.t, len(record.t))
    column = ColumnResiduals(
        record.name,
        record.symbol,
        record.unit,
        identification.rms,
        problem.noise * problem.scale,
        float(np.ptp(identification.x)),
    )
    return {
        **shared_json([samples], [column], identification.estimates, identification.remarks),
        "quantity": record.quantity,
        "unit": record.unit,
        "sentence": identification.sentence,
        "noise": identification.extrema.noise,
        "residual": identification.rms,
        "turning points": len(identification.extrema.t),
        "used": samples.as_json(),
        "release": {
            "time": float(best.p[T0]) + problem.time_origin,
            "amplitude": float(best.p[AMPLITUDE]) * problem.scale,
            "unit": record.base,
        },
        "turning_points": [asdict(estimate) for estimate in identification.extrema_estimates],
        "published": [asdict(estimate) for estimate in identification.two_peak_estimates],
        "why_empty": {name: reason for name, reason in identification.unavailable.items() if reason},
        "laws": [
            {
                "terms": list(law.terms),
                "bic": law.bic,
                "residual": float(np.sqrt(law.sum_of_squares / len(identification.t))) * problem.scale,
            }
            for law in identification.laws
        ],
        "loss": {
            "unit": record.base,
            "amplitude": loss.amplitude.tolist(),
            "share_of_energy": loss.fraction.tolist(),
            "laws": {"+".join(law.terms): loss.curves[law.terms][1].tolist() for law in identification.laws},
            "laws_amplitude": {"+".join(law.terms): loss.curves[law.terms][0].tolist() for law in identification.laws},
        },
    }
