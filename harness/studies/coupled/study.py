"""A coupled scene from its file to its archive, its runs and their error against the communication step.

An archive that somebody else wrote is run the same way; the finest run takes the place of the reference.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shutil import copy

import numpy as np

from ...errors import HarnessError
from ...process.subprocess_runner import PROJECT_ROOT, run_module
from ...process.temporary_directory import temporary_directory
from ...references.single_model_reference import BODY_MODELS, build_bodies, solve_bodies
from ...results.files import column_heading, write_csv_rows
from ...results.files import write_csv as write_csv
from ...results.folder import replace_folder
from ...results.provenance import describe_sources, write_provenance
from ...running.description import read_description
from ...running.fmi2 import ProgressCallback
from ...scenes.coupled.scene import CoupledScene, load_coupled_scene
from ...scenes.fmu_files import find_fmu
from .convergence import Convergence
from .engine import ENGINES, EXTRA, MAIN_ENGINE, EngineRequest, run_engine

FOLDER = "coupled"
FILES = ("trajectory.csv", "error.csv", "engines.csv", "figure.svg")
SPRING = PROJECT_ROOT / "fmus" / "more" / "spring.py"

Starts = dict[str, dict[str, float]]  # start values of the real parameters of each model


def run_coupled(source: str, out: Path, stop: float | None, report: ProgressCallback) -> tuple[Convergence, Path]:
    """Run a coupled scene or an archive at each communication step, compare, and write out/coupled/<name>; a stop, in
    s, stands above its own."""
    try:
        from . import archive, external_archive
    except ImportError as error:
        raise HarnessError(f"a coupled scene needs {error.name}: {EXTRA}") from None
    from .figure import draw

    with temporary_directory("ssp-") as plain:
        if source.endswith(".ssp"):
            name, file = Path(source).stem, plain / "theirs.ssp"
            asked, fmus, scene = external_archive.read_archive(Path(source), file, stop), [Path(source)], None
        else:
            scene = load_coupled_scene(source, BODY_MODELS, stop)
            defaults = {model: start_values(find_fmu(model)) for model in BODY_MODELS}
            check(scene, defaults)
            name, file = scene.name, plain / f"{scene.identifier}.ssp"
            asked, fmus = unsolved_study(scene), [part.fmu for part in scene.parts]
        folder = out / FOLDER / name
        with replace_folder(folder, (*FILES, file.name), describe_sources(source)) as fresh:
            if scene:
                archive.write(scene, values(scene, defaults), element_fmus(scene, plain), file)
            copy(file, fresh)
            found = study(asked, file, solver(scene, defaults) if scene else None, report)
            save(found, fresh)
            draw(found, fresh / "figure.svg")
            told = {"stop": found.stop} | (vars(scene) if scene else {})
            write_provenance(
                fresh, fmus, external_archive.effective_parameters(file), told, source=describe_sources(source)
            )
    return found, folder


def check(scene: CoupledScene, defaults: Starts) -> None:
    """What is set is there to be set."""
    for part in scene.parts:
        unknown = sorted(set(part.values) - set(defaults[part.model]))
        if unknown:
            raise HarnessError(f"scene {scene.name}: part {part.name} ({part.model}) has no parameter {unknown[0]}")


def start_values(fmu: Path) -> dict[str, float]:
    """The start values of an FMU's real parameters."""
    return {
        variable.name: float(variable.start)
        for variable in read_description(fmu).modelVariables
        if variable.causality == "parameter" and variable.type == "Real"
    }


def values(scene: CoupledScene, defaults: Starts) -> Starts:
    """What is set in each element of the archive: a spring begins where the parts do."""
    models = {part.name: defaults[part.model] | part.values for part in scene.parts}
    found = {part.name: part.values for part in scene.parts if part.values}
    for each in scene.springs:
        ends = {f"x0_{end}": models[part]["x0"] for end, part in (("a", each.a), ("b", each.b)) if part}
        found[each.name] = {"k": each.k, "c": each.c} | ends
    return found


def element_fmus(scene: CoupledScene, folder: Path) -> dict[str, Path]:
    """The FMU of each element; that of the springs is built for the occasion."""
    fmus = {part.name: part.fmu for part in scene.parts}
    if scene.springs:
        done = run_module("build_fmus", "", str(SPRING), "--out", str(folder))
        if done.returncode:
            raise HarnessError(f"the spring could not be built: {done.stderr.strip()}")
    return fmus | {each.name: folder / "spring.fmu" for each in scene.springs}


def unsolved_study(scene: CoupledScene) -> Convergence:
    """What is to be run: the positions of the parts."""
    read = tuple((part.name, "x", reference(part.fmu, "x")) for part in scene.parts)
    labels = tuple(f"{part.name} ({part.model})" for part in scene.parts)
    return Convergence(scene.title, read, labels, ("m",) * len(read), scene.steps, scene.stop, "monolithic reference")


def reference(fmu: Path, name: str) -> int:
    """The value reference of a variable."""
    return next(int(each.valueReference) for each in read_description(fmu).modelVariables if each.name == name)


def solver(scene: CoupledScene, defaults: Starts) -> Callable[[np.ndarray], np.ndarray]:
    """What gives the positions (m, n) at times (m,) in s."""
    system, start = build_bodies(scene, defaults)
    return lambda times: solve_bodies(system, start, times)


def study(
    asked: Convergence, archive: Path, truth: Callable[[np.ndarray], np.ndarray] | None, report: ProgressCallback
) -> Convergence:
    """Run the archive at each communication step, beside the reference; with the finest one in the other engines,
    too."""
    runs = []
    for i, step in enumerate(asked.steps):
        runs.append(np.array(run_engine(MAIN_ENGINE, request(asked, archive, step))))
        report((i + 1) / (len(asked.steps) + len(ENGINES)))
    finest = runs[-1]
    times = [np.arange(len(x)) * step for step, x in zip(asked.steps, runs, strict=True)]
    everywhere = np.unique(np.concatenate(times))
    if truth:
        reference = truth(everywhere)
    else:
        reference = np.column_stack([np.interp(everywhere, times[-1], column) for column in finest.T])
    truths = [reference[np.searchsorted(everywhere, each)] for each in times]
    errors = [float(np.abs(x - its).max()) for x, its in zip(runs, truths, strict=True)]
    if not truth:  # the finest is its own
        errors = errors[:-1]
    others = {}
    for engine in ENGINES:
        try:
            x = (
                finest
                if engine == MAIN_ENGINE
                else np.array(run_engine(engine, request(asked, archive, asked.steps[-1])))
            )
            late = len(truths[-1]) - len(x)
            others[engine] = tuple(x[-1].tolist()), float(np.abs(x - truths[-1][late:]).max()), ""
        except HarnessError as error:
            others[engine] = (), float("nan"), str(error)
    return replace(asked, time=times[-1], x=finest, truth=truths[-1], errors=tuple(errors), engines=others)


def request(asked: Convergence, archive: Path, step: float) -> EngineRequest:
    return EngineRequest(str(archive), step, round(asked.stop / step), list(asked.read), asked.values)


def save(found: Convergence, folder: Path) -> None:
    """Write the three tables."""
    names = [f"{element}.{variable}" for element, variable, _ in found.read]
    heads, truths, ends = (
        [column_heading(name + more, size) for name, size in zip(names, found.units, strict=True)]
        for more in ("", " reference", " at the stop")
    )
    write_csv(folder / "trajectory.csv", ["t [s]", *heads, *truths], [found.time, *found.x.T, *found.truth.T])
    columns = [np.array(found.steps[: len(found.errors)]), np.array(found.errors)]
    write_csv(folder / "error.csv", ["communication step [s]", column_heading("largest error", found.unit)], columns)
    table = [[engine, *(end or [None] * len(names)), off, why] for engine, (end, off, why) in found.engines.items()]
    table.append([found.reference, *found.truth[-1].tolist(), 0.0, ""])
    write_csv_rows(
        folder / "engines.csv", ["engine", *ends, column_heading("largest error", found.unit), "why not"], table
    )
