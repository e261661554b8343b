"""Run that a user specifies by a model, an FMU or a scene."""

from dataclasses import replace
from pathlib import Path

from ..errors import SceneError, unknown_source_message
from ..scenes.fmu_files import check_built, find_fmu, list_models
from ..scenes.run_spec import DEFAULT_EQUAL_STEPS, RunOptions, RunSpec
from ..scenes.scene import Scene, load_scene, shipped_scenes
from .fmu_archive import exposes_solver_steps, read_description

FMU_SUFFIXES = (".fmu", ".py")
METHOD, RTOL = "solver.method", "solver.rtol"


def resolve(source: str | Path, options: RunOptions | None = None) -> RunSpec:
    """Return the run of a source, as in `find_source`.

    Parameters
    ----------
    options : RunOptions, optional
        Options of the run of an FMU or a model; a scene has its own.
    """
    return specify_run(find_source(source), options)


def specify_run(item: Path | Scene, options: RunOptions | None = None) -> RunSpec:
    """Return the run of an FMU with options, or of a scene, which has its own; HarnessError if it is not built."""
    if isinstance(item, Path):
        return RunSpec(item, **vars(options or RunOptions(equal_steps=DEFAULT_EQUAL_STEPS)))
    check_built(item.run.fmu)
    return item.run


def prefer_scene(source: str) -> str | Path:
    """Return the file of the built-in scene of this name, which a model may have as well, or else the source."""
    return next((file for file in shipped_scenes() if file.stem == source), source)


def find_source(source: str | Path) -> Path | Scene:
    """Return the FMU or the scene of a source.

    Parameters
    ----------
    source : str or path
        The path of an FMU or of a model file, the name of a model, or the name or path of a scene. A name that a scene
        and a model share means the model.

    Raises
    ------
    SceneError
        If there is no such source.
    """
    path, name = Path(source), str(source)
    scenes = {file.stem for file in shipped_scenes()}
    if path.suffix in FMU_SUFFIXES or name in list_models():
        return find_fmu(name)
    if path.is_dir() and name not in scenes:
        raise SceneError(
            f"{source} is a folder: give a model, a scene or an FMU; the provenance.json of a result has its command"
        )
    try:
        return load_scene(source)
    except SceneError as error:
        if path.suffix == ".toml":
            raise
        names = sorted(list_models() | scenes)
        raise SceneError(
            unknown_source_message("model or scene", name, names, ", or the path of an FMU or a scene")
        ) from error


def set_rtol(spec: RunSpec, rtol: float) -> RunSpec:
    """Return a run with a relative tolerance: of the solver, or of the step refinement of an external FMU."""
    if spec.exchange or not exposes_solver_steps(read_description(spec.fmu, spec.lenient)):
        return replace(spec, tolerance=rtol)
    return replace(spec, values={**spec.values, RTOL: rtol})
