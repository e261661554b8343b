"""Study that identifies the decay of a measured record or a scene, and writes the result folder."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from os.path import exists
from pathlib import Path
from typing import Any

from ...analyses.decay.estimates import KnownParameters
from ...analyses.decay.identification import fit_decay
from ...errors import HarnessError, SceneError, format_value
from ...records.columns import ColumnOptions
from ...records.motion import Motion, check_samples
from ...records.record import load_record as load_file
from ...results import provenance
from ...results.folder import replace_folder
from ...results.registry import find_study
from ...results.summary import write_summary
from .result import DecayResult

STUDY = find_study("decay")

LoadedRecord = tuple[Motion, KnownParameters, dict[str, Any]]  # with provenance: files, parameters, run


def identify_decay(
    source: str,
    columns: ColumnOptions,
    parameters: KnownParameters,
    drag: bool,
    drift: bool,
    out: Path,
    report: Callable[[float], None],
) -> tuple[DecayResult, Path]:
    """Identify the decay of a record file or a scene, and write the results to out/decay/<name>."""
    record, properties, provenance_data = load_record(source, columns, parameters, report)
    options = vars(columns) | vars(parameters) | {"drag": drag, "drift": drift}
    folder = out / STUDY.name / record.name
    source_text = provenance.describe_sources(source)
    # opened before the fit, so that conflicts are reported at once
    with replace_folder(folder, STUDY.files, source_text) as new_folder:
        result = DecayResult(**vars(fit_decay(record, properties, drag, drift, report)))
        result.write(new_folder)
        provenance.write_provenance(new_folder, **provenance_data, scene=options, source=source_text)
        write_summary(new_folder, result.summary())
    return result, folder


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
        return load_file(source, columns).motion, parameters, {"files": ()}
    if is_record_file(source):
        if not exists(source):
            raise SceneError(f"{format_value(source)} does not exist: give an existing record, or a scene")
        return load_file(source, columns).motion, parameters, {"files": (path,)}
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
    position = run.motion_outputs["position"]
    unit = run.units[position]
    if not unit:
        raise SceneError(
            f"scene {scene.name}: {position} has no unit in {run.spec.fmu.name}: run the scene, and identify the decay "
            "in its trajectory.csv with --unit"
        )
    record = Motion(scene.name, run.time, run.column_of_role("position"), unit, 0, unit).select(*columns.interval)
    check_samples(record.name, record.t, record.x)
    provenance_data = {"files": (run.spec.fmu,), "parameters": run.effective_parameters, "run": run.spec}
    if parameters.k is None and parameters.m is None:
        with suppress(HarnessError):  # a model without stiffness has no friction force
            parameters = KnownParameters(
                k=stiffness(run, unit == "rad", "the decay of a scene"), pendulum=unit == "rad"
            )
    return record, parameters, provenance_data
