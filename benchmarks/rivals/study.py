"""Study that runs all rivals in all scenes, each setting in one process, and writes rivals.csv and figure.svg."""

from collections.abc import Callable, Iterator
from math import nan
from pathlib import Path

from benchmarks import command_line
from harness.errors import install_command
from harness.process.worker import Worker, WorkerError
from harness.results.files import write_csv_rows
from harness.results.folder import replace_folder
from harness.results.provenance import write_provenance
from harness.results.summary import Summary, write_summary
from harness.scenes.fmu_files import find_fmu
from harness.simulation.solution import Solution

from .catalogue import Rival, find_rivals
from .child import RivalCase, RivalReply, run_case
from .comparison import Comparison, Result, format_setting, rivals_table, summary_lines
from .figure import draw
from .measures import measure
from .reference_motions import compute_reference_motion
from .scenes import SCENES

FOLDER, FILE, FIGURE = "rivals", "rivals.csv", "figure.svg"
OWN_MODELS = ("coulomb", "stickslip", "belt", "clutch", "pendulum")
MEASURES = ("error", "creep", "missed", "spurious", "event error [s]", "steps", "processor time [s]")


def run_rivals(names: tuple[str, ...], timeout: float, out: Path, report: Callable[[str, float], None]) -> Comparison:
    """Run the rivals of these names, by default all, and write the results to out/rivals.

    Parameters
    ----------
    names : tuple of str
        Names of rivals. The FMU of this project always runs, because times are relative to its own.
    timeout : float
        Time limit of a run in s.
    out : pathlib.Path
        Folder of results.
    report : callable
        Receives the name of each rival that runs.
    """
    rivals = find_rivals(names)
    source = ", ".join(names)
    with replace_folder(out / FOLDER, (FILE, FIGURE), source) as folder:
        report("references", 0.0)
        references = {name: compute_reference_motion(scene) for name, scene in SCENES.items()}
        results: list[Result] = []
        for rival in rivals:
            report(rival.title, 0.0)
            results += run_rival(rival, references, timeout)
        comparison = Comparison(tuple(rivals), tuple(results))
        save(comparison, folder / FILE)
        draw(comparison, folder / FIGURE)
        write_provenance(
            folder, map(find_fmu, OWN_MODELS), scene=versions(comparison), source=source, command=command_line()
        )
        tables, text = rivals_table(comparison).summarize(), "Error over processor time of each rival, by scene"
        write_summary(folder, Summary("rivals", "Scenes", tuple(summary_lines(comparison)), tables, text))
    return comparison


def run_rival(rival: Rival, references: dict[str, Solution], timeout: float) -> Iterator[Result]:
    """Yield the results of a rival, one for each setting and scene."""
    version = rival.installed_version
    for name, setting in rival.settings.items():
        if version:
            replies = run_in_child([RivalCase(rival.module, scene, setting) for scene in SCENES], timeout)
        else:
            reason = f"{rival.package} is not installed: {install_command('rivals')}"
            replies = [RivalReply(reason)] * len(SCENES)
        for (scene_name, scene), reply in zip(SCENES.items(), replies, strict=True):
            measures = None if reply.gap else measure(scene, references[scene_name], reply)
            yield Result(rival.title, version or "-", name, setting, scene_name, rival.lines, measures, reply.gap)


def run_in_child(cases: list[RivalCase], timeout: float) -> list[RivalReply]:
    """Run cases in one process. After a crash or a timeout, which is a gap, another process continues."""
    replies: list[RivalReply] = []
    with Worker() as worker:
        for case in cases:
            try:
                replies.append(worker.call(run_case, case, timeout=timeout))
            except WorkerError as error:
                replies.append(RivalReply(str(error)))
    return replies


def versions(comparison: Comparison) -> dict[str, str]:
    """Return the version of each package."""
    return {rival.package: rival.installed_version or "not installed" for rival in comparison.rivals}


def save(comparison: Comparison, path: Path) -> None:
    """Write one row for each rival, setting and scene."""
    headings = ["scene", "unit of the error", "rival", "version", "setting", *MEASURES, "relative processor time"]
    write_csv_rows(
        path, [*headings, "lines of code", "gap"], (csv_row(comparison, result) for result in comparison.results)
    )


def csv_row(comparison: Comparison, result: Result) -> list[object]:
    """Return the row of a result; NaN becomes an empty cell."""
    measures = list(vars(result.measures).values()) if result.measures else [nan] * len(MEASURES)
    cells = [None if value != value else value for value in (*measures, comparison.time_ratio(result))]
    setting = format_setting(result.setting, result.options)
    head = [result.scene, SCENES[result.scene].unit, result.rival, result.version, setting]
    return [*head, *cells, result.lines, result.gap]
