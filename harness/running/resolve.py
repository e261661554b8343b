"""Run that a user specifies by a model, an FMU, a scene or a stored result."""

from dataclasses import replace
from pathlib import Path

from ..errors import SceneError, unknown_source_message
from ..results.provenance import load_verified_provenance
from ..scenes.fmu_files import check_built, find_fmu, list_models
from ..scenes.run_spec import DEFAULT_EQUAL_STEPS, RunOptions, RunSpec
from ..scenes.scene import load_scene, scene_from_provenance, shipped_scenes
from .fmu_archive import exposes_solver_steps, read_description

FMU_SUFFIXES = (".fmu", ".py")
METHOD, RTOL = "solver.method", "solver.rtol"


def resolve(source: str | Path, options: RunOptions | None = None, scenes_first: bool = False) -> RunSpec:
    """Return the run that a user specifies.

    Parameters
    ----------
    source : str or path
        The path of an FMU or of a model file, the name of a model, the name or path of a scene, or the folder of a
        stored result.
    options : RunOptions, optional
        Options of the run of an FMU or a model; scenes and stored results have their own.
    scenes_first : bool
        Whether a name that a scene and a model share means the scene.

    Raises
    ------
    HarnessError
        If there is no such source, or if the files of a stored result have changed since it was written.
    """
    path, name = Path(source), str(source)
    scenes = {file.stem for file in shipped_scenes()} if scenes_first else set()
    if path.suffix in FMU_SUFFIXES or (name in list_models() - scenes and not path.is_dir()):
        return RunSpec(find_fmu(name), **vars(options or RunOptions(equal_steps=DEFAULT_EQUAL_STEPS)))
    if path.is_dir() and name not in scenes:
        return read_stored_run(path)
    try:
        scene = load_scene(source)
    except SceneError as error:
        if path.suffix == ".toml":
            raise
        names = sorted(list_models() | {file.stem for file in shipped_scenes()})
        other = ", or the path of an FMU, a scene or a result"
        raise SceneError(unknown_source_message("model or scene", name, names, other)) from error
    check_built(scene.run.fmu)
    return scene.run


def read_stored_run(folder: Path) -> RunSpec:
    """Return the run of a stored result; raise HarnessError if its files have changed since it was written."""
    provenance = load_verified_provenance(folder)
    scene = provenance["scene"] or {}
    try:
        if "title" in scene and not provenance.get("run"):  # of an earlier version
            return scene_from_provenance(provenance).run
        return RunSpec.from_json(provenance.get("run") or scene)
    except SceneError as error:
        raise SceneError(f"{folder} does not hold the result of one run ({error}): name another folder") from None


def set_rtol(spec: RunSpec, rtol: float) -> RunSpec:
    """Return a run with a relative tolerance: of the solver, or of the step refinement of an external FMU."""
    if spec.exchange or not exposes_solver_steps(read_description(spec.fmu, spec.lenient)):
        return replace(spec, tolerance=rtol)
    return replace(spec, values={**spec.values, RTOL: rtol})
