"""All studies, each stated once: for `load_result`, result folders and the report.

A new study is a package in `harness/studies` with a class of results, a file in `harness/commands`, and an entry here.
Classes are named by strings, because this module imports no study.
"""

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import SceneError, format_value, unknown_name_message

if TYPE_CHECKING:
    from .result import Result

PICTURE = "figure.svg"


@dataclass(frozen=True)
class Study:
    """A study.

    Attributes
    ----------
    name : str
        Name in summaries, and of the folder of its results.
    command : str
        Name of its command.
    result : str
        Class of its results, as "module:class" below `harness`.
    files : tuple of str
        Files that a result may contain; the first one is compared when a result replaces another.
    title, intro : str
        Title and introduction of its section in the report.
    """

    name: str
    command: str
    result: str
    files: tuple[str, ...]
    title: str
    intro: str

    def result_class(self) -> "type[Result]":
        """Import the class of the results."""
        module, _, name = self.result.partition(":")
        kind: type[Result] = getattr(import_module(f"harness.{module}"), name)
        return kind


STUDIES = (
    Study(
        "run",
        "run",
        "studies.run.result:RunResult",
        ("trajectory.csv", "steps.csv", "events.csv", "quantities.csv", PICTURE),
        "Runs",
        "Scenes, models and FMUs that you ran.",
    ),
    Study(
        "decay",
        "decay",
        "studies.decay.result:DecayResult",
        ("decay.json", "turning-points.csv", "fit.csv", PICTURE),
        "Decay",
        "Damping, dry friction and drag from the whole signal and from its turning points, with 95 % intervals.",
    ),
    Study(
        "curve",
        "curve",
        "studies.curve.result:CurveResult",
        (
            "curve.json",
            "curve.csv",
            "table.csv",
            "table-forward.csv",
            "table-backward.csv",
            "measured.py",
            "measured_table.py",
            PICTURE,
        ),
        "Friction curves",
        "Friction over velocity: constants of the laws with 95 % intervals, and values for models.",
    ),
    Study(
        "fit",
        "fit",
        "studies.fit.result:FitResult",
        ("fit.json", "fit.csv", "validation.csv", PICTURE),
        "Fits",
        "Parameters of FMUs from measured records, with 95 % intervals.",
    ),
    Study(
        "sweep",
        "sweep",
        "studies.sweep.result:SweepResult",
        ("sweep.nc", "sweep.csv", PICTURE),
        "Sweeps",
        "Parameter sweeps.",
    ),
    Study(
        "compare",
        "compare",
        "studies.compare.result:ComparisonResult",
        ("compare.json", PICTURE),
        "Comparisons",
        "Differences between two results or FMUs.",
    ),
    Study(
        "sensitivity",
        "sensitivity",
        "studies.sensitivity.result:SensitivityResult",
        ("sensitivity.csv", "events.csv", PICTURE),
        "Derivatives",
        "Derivatives of outputs by parameters, through stick and slip.",
    ),
    Study(
        "orbit",
        "orbit",
        "studies.orbit.result:OrbitResult",
        ("motions.csv", "points.csv", PICTURE),
        "Periodic motions",
        "Steady sliding and periodic motions, their stability, and the values at which they begin, end or change it.",
    ),
    Study(
        "map",
        "map",
        "studies.motion_map.result:MapResult",
        ("map.csv", "edges.csv", PICTURE),
        "Maps of motions",
        "What motions end in over one or two parameters, with the edges between the regions.",
    ),
    Study(
        "precision",
        "precision",
        "studies.precision.result:PrecisionResult",
        ("points.csv", "model-exchange.csv", "laws.csv", PICTURE),
        "Error against run time",
        "Error against run time and right-hand side evaluations; lower left is better. References are certified. FMU "
        "is the code of the FMU in this process; scipy and cvode solve the same equations.",
    ),
    Study(
        "stability",
        "stability",
        "studies.stability.result:StabilityResult",
        ("stability.csv", PICTURE),
        "Stability",
        "Every case either finishes within its error bound or is rejected with an error message; none hangs.",
    ),
)


def find_study(name: str) -> Study:
    """Return the study of a name; SceneError if there is none."""
    by_name = {study.name: study for study in STUDIES}
    if name not in by_name:
        raise SceneError(unknown_name_message("study", name, by_name))
    return by_name[name]


def study_of_folder(folder: Path) -> Study:
    """Return the study whose main file is in a folder.

    Raises
    ------
    SceneError
        If there is none.
    """
    study = next((study for study in STUDIES if (folder / study.files[0]).is_file()), None)
    if study is None:
        files = ", ".join(dict.fromkeys(study.files[0] for study in STUDIES))
        raise SceneError(f"{format_value(str(folder))} holds no result: name a folder with one of {files}")
    return study
