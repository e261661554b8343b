"""Study of a coupled scene: writes an archive, runs it at several communication steps, and computes the errors.

A given archive is run in the same way; its reference is the run with the smallest step.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np

from ...errors import HarnessError, install_command
from ...process.subprocess_runner import PROJECT_ROOT, run_module
from ...process.temporary_directory import temporary_directory
from ...references.single_model_reference import BODY_MODELS, build_bodies, solve_bodies
from ...results.folder import replace_folder
from ...results.provenance import describe_sources, write_provenance
from ...results.registry import find_study
from ...results.summary import write_summary
from ...running.array_elements import ArrayElement
from ...running.fmu_archive import read_description
from ...running.session import ProgressCallback
from ...running.ssp import ArchiveRun
from ...running.variable_values import REAL_TYPES, variable_unit
from ...scenes.coupled.scene import CoupledScene, load_coupled_scene
from ...scenes.fmu_files import find_fmu, list_models
from .convergence import Convergence
from .engine import ENGINES, EXTRA, run_engine
from .result import CoupledResult

STUDY = find_study("coupled")
SPRING = PROJECT_ROOT / "fmus" / "more" / "spring.py"

Starts = dict[str, dict[str, float]]  # start values of the Real parameters of each model


def run_coupled(source: str, out: Path, stop: float | None, report: ProgressCallback) -> tuple[CoupledResult, Path]:
    """Run a coupled scene or an archive at each communication step, and write the results to out/coupled/<name>.

    A `stop` time in s overrides that of the scene.
    """
    try:
        from . import archive, external_archive
    except ImportError as error:
        raise HarnessError(f"a coupled scene needs {error.name}: {install_command(EXTRA)}") from None

    with temporary_directory("ssp-") as temporary_folder:
        if source.endswith(".ssp"):
            name, file = Path(source).stem, temporary_folder / "archive.ssp"
            plan, fmus, scene = external_archive.read_archive(Path(source), file, stop), [Path(source)], None
        else:
            scene = load_coupled_scene(source, list_models(), stop)
            defaults = {part.model: start_values(part.fmu) for part in scene.parts.values()}
            check_values(scene, defaults)
            check_connections(scene)
            name, file = scene.name, temporary_folder / f"{scene.identifier}.ssp"
            plan, fmus = plan_study(scene), [part.fmu for part in scene.parts.values()]
        folder = out / STUDY.name / name
        with replace_folder(folder, (*STUDY.files, file.name), describe_sources(source)) as new_folder:
            if scene:
                recorded = {name: [variable] for name, variable, _ in plan.read}
                archive.write(
                    scene, element_values(scene, defaults), element_fmus(scene, temporary_folder), recorded, file
                )
            copy(file, new_folder)
            solve_reference = make_reference_solver(scene, defaults) if scene and has_reference(scene) else None
            result = CoupledResult(**vars(run_study(plan, file, solve_reference, report)), name=name)
            result.write(new_folder)
            settings = {"stop": result.stop} | (vars(scene) if scene else {})
            write_provenance(
                new_folder, fmus, external_archive.effective_parameters(file), settings, source=describe_sources(source)
            )
            write_summary(new_folder, result.summary())
    return result, folder


def check_values(scene: CoupledScene, defaults: Starts) -> None:
    """Raise HarnessError if a parameter of the scene does not exist."""
    for name, part in scene.parts.items():
        unknown = sorted(set(part.values) - set(defaults[part.model]))
        if unknown:
            raise HarnessError(
                f"scene {scene.name}: part {name} ({part.model}) has no parameter {unknown[0]} that is one real number"
            )


def check_connections(scene: CoupledScene) -> None:
    """Raise HarnessError if an output or input that is connected does not exist."""
    springs = {spring.name for spring in scene.springs}
    for connection in scene.connections:
        for name, variable, causality in (
            (connection.source, connection.output, "output"),
            (connection.sink, connection.input, "input"),
        ):
            if name not in springs and variable not in real_variables(scene.parts[name].fmu, causality):
                raise HarnessError(f"scene {scene.name}: part {name} has no {causality} {variable}")
    for spring in scene.springs:
        for part in filter(None, (spring.a, spring.b)):
            if "x0" not in real_variables(scene.parts[part].fmu, "parameter"):
                raise HarnessError(f"scene {scene.name}: part {part} has no parameter x0, which a spring needs")


def real_variables(fmu: Path, causality: str) -> list[str]:
    """Return the names of the Real variables of a causality."""
    variables = read_description(fmu).modelVariables
    return [variable.name for variable in variables if variable.causality == causality and variable.type in REAL_TYPES]


def has_reference(scene: CoupledScene) -> bool:
    """Return whether a single model of the whole scene has a known solution: shipped bodies that forces connect."""
    are_bodies = all(part.model in BODY_MODELS and part.fmu == find_fmu(part.model) for part in scene.parts.values())
    return are_bodies and all(connection.input == "F_ext" for connection in scene.direct_connections)


def start_values(fmu: Path) -> dict[str, float]:
    """Return the start values of the Real parameters of an FMU; engines do not set elements of arrays."""
    return {
        variable.name: float(variable.start)
        for variable in read_description(fmu).modelVariables
        if variable.causality == "parameter" and variable.type in REAL_TYPES and not isinstance(variable, ArrayElement)
    }


def element_values(scene: CoupledScene, defaults: Starts) -> Starts:
    """Return the values to set in each element; springs start at the positions of their parts."""
    models = {name: defaults[part.model] | part.values for name, part in scene.parts.items()}
    values_by_element = {name: part.values for name, part in scene.parts.items() if part.values}
    for spring in scene.springs:
        ends = {f"x0_{end}": models[part]["x0"] for end, part in (("a", spring.a), ("b", spring.b)) if part}
        values_by_element[spring.name] = {"k": spring.k, "c": spring.c} | ends
    return values_by_element


def element_fmus(scene: CoupledScene, folder: Path) -> dict[str, Path]:
    """Return the FMU of each element; the FMU of the springs is built here."""
    fmus = {name: part.fmu for name, part in scene.parts.items()}
    if scene.springs:
        build = run_module("build_fmus", str(SPRING), "--out", str(folder))
        if build.returncode:
            raise HarnessError(f"the spring could not be built: {build.stderr.strip()}")
    return fmus | {spring.name: folder / "spring.fmu" for spring in scene.springs}


def plan_study(scene: CoupledScene) -> Convergence:
    """Return the study to run, which records the positions of the parts; of a part without x, its first output."""
    variables = {name: recorded_variable(part.fmu) for name, part in scene.parts.items()}
    read = tuple((name, variable.name, int(variable.valueReference)) for name, variable in variables.items())
    labels = tuple(f"{name} ({part.model})" for name, part in scene.parts.items())
    units = tuple(variable_unit(variable) for variable in variables.values())
    reference = "single-model reference" if has_reference(scene) else "finest run"
    return Convergence(scene.title, read, labels, units, scene.steps, scene.stop, reference)


def recorded_variable(fmu: Path) -> Any:
    """Return the description of the output that a study records."""
    names = real_variables(fmu, "output")
    if not names:
        raise HarnessError(f"{fmu.name} has no Real output")
    name = "x" if "x" in names else names[0]
    return next(variable for variable in read_description(fmu).modelVariables if variable.name == name)


def make_reference_solver(scene: CoupledScene, defaults: Starts) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function that computes reference positions (m, n) at times (m,) in s."""
    system, start = build_bodies(scene, defaults)
    return lambda times: solve_bodies(system, start, times)


def run_study(
    plan: Convergence,
    archive: Path,
    solve_reference: Callable[[np.ndarray], np.ndarray] | None,
    report: ProgressCallback,
) -> Convergence:
    """Run the archive at each communication step, and at the smallest step in the other engines as well."""
    main_engine, first = run_first_step(plan, archive)
    runs = [first]
    for i, step in enumerate(plan.steps[1:]):
        report((i + 1) / (len(plan.steps) + len(ENGINES)))
        runs.append(run_step(main_engine, plan, archive, step))
    finest = runs[-1]
    times = [np.arange(len(x)) * step for step, x in zip(plan.steps, runs, strict=True)]
    all_times = np.unique(np.concatenate(times))
    if solve_reference:
        reference = solve_reference(all_times)
    else:
        reference = np.column_stack([np.interp(all_times, times[-1], column) for column in finest.T])
    references = [reference[np.searchsorted(all_times, run_times)] for run_times in times]
    errors = [float(np.abs(x - reference_values).max()) for x, reference_values in zip(runs, references, strict=True)]
    if not solve_reference:  # the run with the smallest step is the reference
        errors = errors[:-1]
    engines = {}
    for engine in ENGINES:
        try:
            x = finest if engine == main_engine else run_step(engine, plan, archive, plan.steps[-1])
            n_missing = len(references[-1]) - len(x)
            engines[engine] = tuple(x[-1].tolist()), float(np.abs(x - references[-1][n_missing:]).max()), ""
        except HarnessError as error:
            engines[engine] = (), float("nan"), str(error)
    return replace(plan, time=times[-1], x=finest, truth=references[-1], errors=tuple(errors), engines=engines)


def run_first_step(plan: Convergence, archive: Path) -> tuple[str, np.ndarray]:
    """Return the first engine that runs the archive with the largest step, and the rows (m, n) of that run.

    Raises
    ------
    HarnessError
        If no engine runs it, with the reason of each.
    """
    reasons = []
    for engine in plan.candidates:
        try:
            return engine, run_step(engine, plan, archive, plan.steps[0])
        except HarnessError as error:
            reasons.append(str(error))
    raise HarnessError("\n".join(reasons))


def run_step(engine: str, plan: Convergence, archive: Path, step: float) -> np.ndarray:
    """Return the rows (m, n) of a run of an archive with a communication step in s."""
    if engine in plan.unsupported:
        raise HarnessError(plan.unsupported[engine])
    run = ArchiveRun(archive, plan.names, plan.stop, step)
    return np.array(run_engine(engine, run, plan.read, plan.values))
