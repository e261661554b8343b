"""Study that runs one scene, all scenes with known values, or an FMU given by its path.

Analyses and plots are imported only when a scene requests them.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ...errors import HarnessError, SceneError, unknown_name_message
from ...process.interrupt import check_interrupt
from ...results.folder import replace_folder
from ...results.provenance import describe_sources, write_provenance
from ...results.quantity import Quantity
from ...results.registry import find_study
from ...results.summary import write_summary
from ...scenes.fmu_files import check_built
from ...scenes.run_spec import RunSpec
from ...scenes.scene import MAX_DEFAULT_PLOTS, Scene, default_plots, is_panel, load_scene, shipped_scenes
from ...simulation import runner
from ...simulation.plot import choose_outputs, contact_of
from ...simulation.trajectory import Trajectory, summarize_run
from .table import SceneOutcome, summarize_quantities, write_quantities

STUDY = find_study("run")


def decay(run: Trajectory, scene: Scene) -> Any:
    from ...analyses.decay.decrement import analyse

    return analyse(run, scene.decay.gives or "", scene.decay.first, scene.decay.cycles)


def slip(run: Trajectory, scene: Scene) -> Any:
    from ...analyses.slip import analyse

    return analyse(run)


def steps(run: Trajectory, scene: Scene) -> Any:
    from ...analyses.steps import analyse

    return analyse(run)


ANALYSES = {"decay": decay, "slip": slip, "steps": steps}


def run_scene(scene: Scene, out: Path, report: Callable[[float], None]) -> SceneOutcome:
    """Run and analyse a scene, and write the results to out/<scene>.

    Raises
    ------
    HarnessError
        If the run or an analysis fails; previous results are kept.
    """
    try:
        with replace_folder(out / scene.name, STUDY.files, scene.source) as folder:
            return run_and_write(scene, folder, report)
    except HarnessError as error:
        raise type(error)(f"scene {scene.name}: {error}") from None


def run_and_write(scene: Scene, folder: Path, report: Callable[[float], None]) -> SceneOutcome:
    """Run and analyse a scene, and write the results to an empty folder."""
    check_built(scene.run.fmu)
    run = runner.run(scene.run, report)
    check_steps(scene, run)
    results: dict[str, Any] = {}
    for name in () if run.failure else scene.analyses:
        results[name] = ANALYSES[name](run, scene)
    quantities = tuple(quantity for result in results.values() for quantity in result.quantities)
    quantities += run.statistics.quantities if run.statistics else ()
    if not run.failure:
        check_known_values(scene, run, quantities)
    run.write_tables(folder)
    stop = scene.run.stop if run.failure else float(run.time[-1])
    effective_run = replace(run.spec, outputs=scene.run.outputs, start=float(run.time[0]), stop=stop)
    write_provenance(
        folder, [scene.run.fmu], run.effective_parameters, scene.presentation, source=scene.source, run=effective_run
    )
    summary = summarize_run(run, scene.name)
    if results:
        write_quantities(quantities, scene.known, folder / "quantities.csv")
        summary = summarize_quantities(summary, quantities, scene.known, run)
    if not run.failure:
        summary = replace(summary, sentences=(*describe_scene(scene), *summary.sentences))
    if scene.plots:
        from .figure import draw

        draw(scene.title, scene.plots, run, results, folder / "figure.svg", scene.known)
    write_summary(folder, summary)
    return SceneOutcome(scene.name, scene, run, quantities, run.failure or None)


def check_steps(scene: Scene, run: Trajectory) -> None:
    """Raise SceneError if the scene needs solver steps that the FMU does not expose."""
    panels = [name for name in scene.plots if is_panel(name, scene.run.outputs)]
    if run.steps is None and "steps" in (*scene.analyses, *panels):
        raise SceneError(
            f"'steps' in analyses or plots: {scene.run.fmu.name} does not expose its solver steps; remove 'steps'"
        )


def describe_scene(scene: Scene) -> tuple[str, ...]:
    """Return the description of a scene, the publication of its values, and the remark on the comparison."""
    return (*filter(None, [scene.about]), *describe_known_values(scene))


def describe_known_values(scene: Scene) -> tuple[str, ...]:
    """Return the publication of the values of a scene, and the remark on the comparison with them."""
    citation = scene.known.citation if scene.known else None
    return tuple(filter(None, (f"Published values: {citation}." if citation else "", scene.remark)))


def check_known_values(scene: Scene, run: Trajectory, quantities: tuple[Quantity, ...]) -> None:
    """Raise SceneError unless each known value has a measured quantity with a compatible unit.

    A value in the table [parameter] must be the one that the run sets.
    """
    if scene.known is None:
        return
    kind, quantities_by_name = scene.known.kind, {quantity.name: quantity for quantity in quantities}
    for name, value in scene.known.values.items():
        if name not in quantities_by_name:
            raise SceneError(unknown_name_message(f"name in [{scene.known.kind}]", name, quantities_by_name))
        number, unit = value if isinstance(value, tuple) else (value, quantities_by_name[name].unit)
        try:
            quantities_by_name[name].to_unit(unit)
        except KeyError:
            measured = quantities_by_name[name].unit
            raise SceneError(f"{name} in '{unit}' is incompatible with the measured unit '{measured}'") from None
        is_set = name in run.parameters and (run.parameters[name], run.units[name]) == (number, unit)
        if kind == "parameter" and not is_set:
            raise SceneError(
                f"{name} = {number!r} in [parameter] is not what the run sets: give the value of a parameter of "
                f"{run.spec.model} in its own unit, or name the table [reference]"
            )


def compared_scene_names() -> list[str]:
    """Return the names of the shipped scenes with known values; HarnessError if an FMU is not built."""
    scenes = [scene for scene in map(load_scene, shipped_scenes()) if scene.known]
    for scene in scenes:
        check_built(scene.run.fmu)
    return [scene.name for scene in scenes]


def run_scenes(names: Iterable[str], out: Path, report: Callable[[str, float], None]) -> Iterator[SceneOutcome]:
    """Yield the outcome of each scene; a failed scene does not stop the others."""
    for name in names:
        check_interrupt()
        try:
            yield run_scene(load_scene(name), out, partial(report, name))
        except HarnessError as error:
            check_interrupt()  # a Python FMU may have swallowed an interrupt
            yield SceneOutcome(name, None, None, (), str(error))


def run_fmu(spec: RunSpec, out: Path, report: Callable[[float], None]) -> tuple[Trajectory, Path]:
    """Run one FMU and write its outputs to out/<name of the FMU>."""
    from .figure import draw

    folder, source = out / spec.model, describe_sources(str(spec.fmu))
    with replace_folder(folder, STUDY.files, source) as new_folder:
        trajectory = runner.run(spec, report)
        trajectory.write_tables(new_folder)
        draw(spec.fmu.name, choose_plots(trajectory), trajectory, {}, new_folder / "figure.svg")
        write_provenance(new_folder, [spec.fmu], trajectory.effective_parameters, source=source, run=trajectory.spec)
        write_summary(new_folder, summarize_run(trajectory, folder.name))
    return trajectory, folder


def choose_plots(run: Trajectory) -> tuple[str, ...]:
    """Return the plots of a run without a scene.

    These are the first outputs, with the friction forces among them.  With several contacts, the forces are additional,
    and the modes are not plotted as curves.
    """
    outputs = run.spec.outputs
    if len(run.contacts) < 2:
        return default_plots(outputs, choose_outputs(outputs, run.contacts, MAX_DEFAULT_PLOTS))
    others = [name for name in outputs if not contact_of(run, name)]
    return default_plots(outputs, (*others[:MAX_DEFAULT_PLOTS], *run.contacts[:MAX_DEFAULT_PLOTS]))
