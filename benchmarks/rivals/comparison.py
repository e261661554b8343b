"""The results of all rivals."""

from dataclasses import dataclass
from math import nan

from .catalogue import OWN, Rival
from .measures import Measures
from .scenes import Scene, Setting


@dataclass(frozen=True)
class Result:
    """One rival with one setting in one scene.

    Attributes
    ----------
    rival, version, setting : str
        Title of the rival, version of its package, and name of the setting.
    options : dict
        Values of its options.
    scene : str
        Name of the scene.
    lines : int
        Lines of code that a user writes for all scenes.
    measures : Measures or None
        Measures of the run; None for a gap.
    gap : str
        Reason why there is no result.
    """

    rival: str
    version: str
    setting: str
    options: Setting
    scene: str
    lines: int
    measures: Measures | None
    gap: str = ""


@dataclass(frozen=True)
class Comparison:
    """All results, and the rivals in their order."""

    rivals: tuple[Rival, ...]
    results: tuple[Result, ...]

    def of_scene(self, scene: Scene) -> list[Result]:
        """Return the results of a scene, the most accurate first."""
        results = [result for result in self.results if result.scene == scene.name and result.measures]
        return sorted(results, key=lambda result: result.measures.error if result.measures else nan)

    def time_ratio(self, result: Result) -> float:
        """Return the processor time relative to that of the FMU at its defaults in the same scene."""
        for other in self.results:
            is_baseline = (other.rival, other.setting, other.scene) == (OWN.title, "default", result.scene)
            if is_baseline and other.measures and result.measures:
                return result.measures.seconds / other.measures.seconds
        return nan


def format_setting(name: str, options: Setting) -> str:
    """Return the name of a setting with its options."""
    values = ", ".join(f"{option} = {value}" for option, value in options.items())
    return f"{name}: {values}" if values else name
