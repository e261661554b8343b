"""Study that runs a model, a scene or an FMU once."""

from dataclasses import replace

from ...errors import HarnessError, RunError
from ...scenes.run_spec import RunSpec
from ...scenes.scene import Scene, change_run
from ...simulation import runner
from ...simulation.session import ProgressCallback
from .result import RunResult, analyse


def run_once(spec: RunSpec, scene: Scene | None, report: ProgressCallback) -> RunResult:
    """Run an FMU as specified; the scene, if any, names what to measure and to plot.

    Raises
    ------
    RunError
        If the run ends early.
    HarnessError
        If there is nothing to show.
    """
    run = RunResult(**vars(runner.run(spec, report)), scene=scene and change_run(scene, spec))
    stop = spec.stop if run.failure else float(run.time[-1])
    run = replace(run, spec=replace(run.spec, start=float(run.time[0]), stop=stop))
    if run.failure:
        raise RunError(run.failure, run)
    return omit_analyses(run, run.scene) if run.scene and run.scene != scene else run


def omit_analyses(run: RunResult, scene: Scene) -> RunResult:
    """Return a run of a changed scene without the analyses for which it does not suffice, with a note on each."""
    names, notes = list[str](), [run.note]
    for name in scene.analyses:
        try:
            analyse(name, run, scene)
        except HarnessError as error:
            notes.append(str(error))
        else:
            names.append(name)
    return replace(run, scene=replace(scene, analyses=tuple(names)), note="; ".join(filter(None, notes)))
