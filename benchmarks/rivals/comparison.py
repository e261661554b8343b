"""Results of all rivals, their table and its summary."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from math import nan

from harness.results.summary import ResultColumn, ResultTable

from .catalogue import OWN_RIVAL, Rival
from .measures import Measures
from .scenes import SCENES, Scene, Setting


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
            is_baseline = (other.rival, other.setting, other.scene) == (OWN_RIVAL.title, "default", result.scene)
            if is_baseline and other.measures and result.measures:
                return result.measures.seconds / other.measures.seconds
        return nan


def format_setting(name: str, options: Setting) -> str:
    """Return the name of a setting with its options."""
    values = ", ".join(f"{option} = {value}" for option, value in options.items())
    return f"{name}: {values}" if values else name


EXACT = 1e-9  # in the unit of the error


def rivals_table(comparison: Comparison) -> ResultTable:
    """Return the table, the most accurate rival of each scene first."""
    rows = [(scene, result) for scene in SCENES.values() for result in comparison.of_scene(scene)]
    columns = [ResultColumn("rival, setting", "{0[1].rival}, {0[1].setting}", is_text=True)]
    for i, name in enumerate(("error", "creep", "lost/extra", "late", "steps", "time", "lines")):
        columns.append(ResultColumn(name, partial(format_measure, comparison, i)))
    return ResultTable(rows, columns, group=lambda row: (f"{row[0].title} [{row[0].unit}]",))


def format_measure(comparison: Comparison, number: int, row: tuple[Scene, Result]) -> str:
    """Return one of the cells of a result."""
    return cells(comparison, row[1])[number]


def cells(comparison: Comparison, result: Result) -> list[str]:
    """Return the cells of a result."""
    measures = result.measures
    assert measures
    event_error = "-" if measures.event_error != measures.event_error else f"{measures.event_error:.0e}"
    ratio = comparison.time_ratio(result)
    return [
        f"{measures.error:.1e}",
        f"{measures.creep:.0e}",
        f"{measures.missed}/{measures.spurious}",
        event_error,
        f"{measures.steps}",
        "-" if ratio != ratio else f"{ratio:.2g}",
        f"{result.lines}",
    ]


def summary_lines(comparison: Comparison) -> Iterator[str]:
    """Yield sentences on exact rivals, settings, purposes and gaps."""
    exact = exact_rivals(comparison)
    if exact:
        yield f"Exact to {EXACT:g} in every scene, without missed or spurious events: {'; '.join(exact)}."
    yield (
        "error: the largest in the run, against references that share no code with the FMUs; creep: median slip in m/s "
        "or rad/s where the body sticks; lost/extra: events that the run misses or invents; late: largest error of the "
        f"times of the others, in s; time: processor time, relative to {OWN_RIVAL.title} at its defaults; lines: lines "
        f"of code that a user writes for all scenes, for {OWN_RIVAL.title} with its models."
    )
    for rival in comparison.rivals:
        settings = "; ".join(format_setting(name, options) for name, options in rival.settings.items())
        yield f"{rival.title} {rival.installed_version or '(not installed)'}: {settings}. Made for {rival.purpose}."
    yield from gap_lines(comparison)


def exact_rivals(comparison: Comparison) -> list[str]:
    """Return the rivals and settings that are exact in every scene, the FMU last."""
    groups: dict[str, list[Result]] = {}
    for result in comparison.results:
        groups.setdefault(f"{result.rival} ({result.setting})", []).append(result)
    exact = [name for name, results in groups.items() if all(map(is_exact, results))]
    return sorted(exact, key=lambda name: name.startswith(OWN_RIVAL.title))


def is_exact(result: Result) -> bool:
    """Return whether a result is exact, with all events."""
    measures = result.measures
    return measures is not None and measures.error <= EXACT and not measures.missed and not measures.spurious


def gap_lines(comparison: Comparison) -> Iterator[str]:
    """Yield one line for each rival, setting and reason of gaps."""
    gaps: dict[tuple[str, str], dict[str, list[str]]] = {}
    for result in comparison.results:
        if result.gap:
            settings = gaps.setdefault((result.rival, result.gap), {})
            settings.setdefault(result.setting, []).append(SCENES[result.scene].name)
    for (rival, gap), settings in gaps.items():
        settings_text = "; ".join(f"{setting}: {', '.join(scenes)}" for setting, scenes in settings.items())
        yield f"No result of {rival} ({settings_text}): {gap}."
