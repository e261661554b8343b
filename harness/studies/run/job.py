"""One scene from file to results, the main job, which is every published one, and an FMU of any origin by its path.

What a scene does not name is not imported: analyses and plots load here, when they are asked for.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ...errors import HarnessError, SceneError, unknown
from ...process.interrupt import check
from ...results.files import write_motion
from ...results.folder import replacing
from ...results.provenance import named, record
from ...results.quantity import Quantity
from ...running import any_fmu
from ...running.run import Run
from ...running.specification import Specification, of_scene
from ...running.trajectory import Trajectory, of_run
from ...scenes.fmus import check_built
from ...scenes.scene import Scene, load, shipped, usual
from .table import Outcome, save

FILES = ("trajectory.csv", "steps.csv", "events.csv", "figures.csv", "figure.svg")  # all that a result folder may hold


def decay(run: Run, scene: Scene) -> Any:
    from ...analyses.decay.decrement import analyse

    return analyse(run, scene.decay.gives or "", scene.decay.first, scene.decay.cycles)


def slip(run: Run, scene: Scene) -> Any:
    from ...analyses.slip import analyse

    return analyse(run)


def steps(run: Run, scene: Scene) -> Any:
    from ...analyses.steps import analyse

    return analyse(run)


ANALYSE = {"decay": decay, "slip": slip, "steps": steps}


def perform(scene: Scene, out: Path, report: Callable[[float], None]) -> Outcome:
    """Run, analyse and write results to out/<scene>; HarnessError leaves older results as they are."""
    try:
        with replacing(out / scene.name, FILES, scene.source) as folder:
            return fill(scene, folder, report)
    except HarnessError as error:
        raise type(error)(f"scene {scene.name}: {error}") from None


def fill(scene: Scene, folder: Path, report: Callable[[float], None]) -> Outcome:
    """Run and analyse a scene, and write its results into an empty folder."""
    check_built(scene.file)
    run = any_fmu.run(of_scene(scene), report)
    check_steps(scene, run)
    results: dict[str, Any] = {}
    for name in () if run.failed else scene.analyses:
        results[name] = ANALYSE[name](run, scene)
    quantities = tuple(quantity for result in results.values() for quantity in result.quantities)
    quantities += run.cost.quantities if run.cost else ()
    if not run.failed:
        check_published(scene, quantities)
    run.save(folder)
    stop = scene.stop if run.failed else float(run.time[-1])
    follow = scene.follow if run.wanted.grid is None else run.wanted.follow
    as_run = replace(scene, start=float(run.time[0]), stop=stop, grid=run.wanted.grid, follow=follow)
    record(folder, [scene.file], run.in_force, as_run, source=scene.source)
    if results:
        save(quantities, scene.published, folder / "figures.csv")
    if scene.plots:
        from .figure import draw

        draw(scene.title, scene.plots, run, results, folder / "figure.svg", scene.published)
    return Outcome(scene.name, scene, run, quantities, run.failed or None)


def check_steps(scene: Scene, run: Run) -> None:
    """The FMU shows its solver's steps, where they are asked for."""
    if run.steps is None and "steps" in (*scene.analyses, *scene.plots):
        raise SceneError(
            f"'steps' in analyses or plots: {scene.file.name} does not show the steps of its solver: leave it out"
        )


def check_published(scene: Scene, quantities: tuple[Quantity, ...]) -> None:
    """Every published figure has a measured one beside it, in a unit that fits."""
    measured = {quantity.name: quantity for quantity in quantities}
    for name, value in scene.published.items():
        if name == "source":
            continue
        if name not in measured:
            raise SceneError(unknown("name in [published]", name, measured))
        if isinstance(value, tuple):
            try:
                measured[name].in_unit(value[1])
            except KeyError:
                unit = measured[name].unit
                raise SceneError(
                    f"published {name} in '{value[1]}' does not fit the measured '{unit}': give it in that"
                ) from None


def published() -> list[str]:
    """The names of the shipped scenes that have figures to stand beside; HarnessError if an FMU is not built."""
    scenes = [scene for scene in map(load, shipped()) if scene.published]
    for scene in scenes:
        check_built(scene.file)
    return [scene.name for scene in scenes]


def main_job(names: Iterable[str], out: Path, report: Callable[[str, float], None]) -> Iterator[Outcome]:
    """The outcome of each scene; one that fails does not lose the others."""
    for name in names:
        check()
        try:
            yield perform(load(name), out, partial(report, name))
        except HarnessError as error:
            check()  # an FMU in Python may have swallowed the interrupt that made it fail
            yield Outcome(name, None, None, (), str(error))


def perform_run(wanted: Specification, out: Path, report: Callable[[float], None]) -> tuple[Trajectory, Path]:
    """Run an FMU of any origin, and write its outputs to out/<name of the file>."""
    from .figure import draw

    folder, source = out / wanted.model, named(str(wanted.fmu))
    with replacing(folder, FILES, source) as fresh:
        done = any_fmu.run(wanted, report)
        found = of_run(done)
        write_motion(fresh / FILES[0], found.time, found.columns, found.units)
        draw(wanted.fmu.name, usual(tuple(found.columns)), done, {}, fresh / "figure.svg")
        record(fresh, [wanted.fmu], found.parameters, wanted, source=source)
    return found, folder
