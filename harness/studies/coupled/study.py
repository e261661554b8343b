"""A coupled scene from its file to its archive, its runs and their error against the communication step."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from shutil import copy

import numpy as np

from ...errors import HarnessError
from ...process.child import ask
from ...process.room import room
from ...results.files import write as write_csv
from ...results.folder import replacing
from ...results.provenance import named, record
from ...running.description import description
from ...scenes.coupled.scene import MODELS, Coupled, load
from ...scenes.fmus import fmu_of
from ...truths.monolith import bodies, solve
from .convergence import Convergence

FOLDER = "coupled"
PATIENCE = 300.0  # s, for one run
EXTRA = "python -m pip install 'friction-fmus[coupled]'"


def perform(source: str, out: Path, report: Callable[[float], None]) -> tuple[Convergence, Path]:
    """Write the archive of a coupled scene, run it at each communication step, compare, write out/coupled/<name>."""
    try:
        from . import archive
    except ImportError as error:
        raise HarnessError(f"a coupled scene needs {error.name}: {EXTRA}") from None
    from .figure import draw

    defaults = {model: starts(fmu_of(model)) for model in MODELS}
    scene = load(source, {model: values["k"] for model, values in defaults.items()})
    for part in scene.parts:
        unknown = sorted(set(part.values) - set(defaults[part.model]))
        if unknown:
            raise HarnessError(f"scene {scene.name}: part {part.name} ({part.model}) has no parameter {unknown[0]}")
    files = (f"{scene.name}.ssp", "trajectory.csv", "error.csv", "figure.png")
    folder = out / FOLDER / scene.name
    with replacing(folder, files, named(source)) as fresh, room("ssp-") as plain:
        archive.write(scene, plain / files[0])
        copy(plain / files[0], fresh)
        found = study(scene, plain / files[0], defaults, report)
        names = [f"{part.name}.x" for part in scene.parts]
        heads = [f"{name} [m]" for name in (*names, *(f"{name} reference" for name in names))]
        write_csv(fresh / "trajectory.csv", ["t [s]", *heads], [found.time, *found.x.T, *found.truth.T])
        columns = [np.array(found.steps), np.array(found.errors)]
        write_csv(fresh / "error.csv", ["communication step [s]", "largest error [m]"], columns)
        draw(found, fresh / "figure.png")
        record(fresh, {part.fmu for part in scene.parts}, scene=scene, source=named(source))
    return found, folder


def study(
    scene: Coupled, archive: Path, defaults: dict[str, dict[str, float]], report: Callable[[float], None]
) -> Convergence:
    """Run the archive at each communication step, beside the reference."""
    system, start = bodies(scene, defaults)
    errors = []
    for i, step in enumerate(scene.steps):
        count = round(scene.stop / step)
        time = np.arange(count + 1) * step
        x = np.array(ecos(archive, step, count, [f"{part.name}::x" for part in scene.parts]))
        truth = solve(system, start, time)
        errors.append(float(np.abs(x - truth).max()))
        report((i + 1) / len(scene.steps))
    return Convergence(scene, time, x, truth, scene.steps, tuple(errors))


def starts(fmu: Path) -> dict[str, float]:
    """The start values of an FMU's real parameters."""
    return {
        variable.name: float(variable.start)
        for variable in description(fmu).modelVariables
        if variable.causality == "parameter" and variable.type == "Real"
    }


def ecos(archive: Path, step: float, count: int, read: list[str]) -> list[list[float]]:
    """The rows that Ecos gives; HarnessError with its last words if it gives none."""
    request = json.dumps({"archive": str(archive), "step": step, "count": count, "read": read})
    command = [sys.executable, "-m", f"{__package__}.ecos"]
    done = ask(command, request, patience=PATIENCE)
    if done.returncode or not done.stdout:
        last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
        hint = f"; {EXTRA}" if "ModuleNotFoundError" in last else ""
        raise HarnessError(f"Ecos could not run {archive.name}: {last}{hint}")
    return json.loads(done.stdout)
