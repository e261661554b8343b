"""Study that compares two FMUs, scenes, result folders or files, and writes the result folder."""

from dataclasses import replace
from pathlib import Path

from ...results.folder import replace_folder
from ...results.provenance import describe_sources, write_provenance
from ...results.registry import find_study
from ...results.summary import write_summary
from ...running.resolve import set_rtol
from ...running.session import ProgressCallback
from ...scenes.run_spec import RunOptions, RunSpec
from . import trajectory_sources
from .difference import compare
from .result import ComparisonResult

STUDY = find_study("compare")


def run_comparison(
    sources: tuple[str, str], options: RunOptions, rtol: float | None, out: Path, report: ProgressCallback
) -> tuple[ComparisonResult, Path]:
    """Compare two sources and write the differences to out/compare/<one>-<two>.

    FMUs are run with the `options` and the relative tolerance `rtol`, scenes with the tolerance as well.
    """

    def adjust(runs: list[RunSpec]) -> list[RunSpec]:
        return runs if rtol is None else [set_rtol(spec, rtol) for spec in runs]

    names = trajectory_sources.display_names(sources)
    folder = out / STUDY.name / "-".join(names).replace("/", "-")
    with replace_folder(folder, STUDY.files, describe_sources(*sources)) as new_folder:
        one, two = (
            replace(side, label=name)
            for side, name in zip(trajectory_sources.load_both(sources, options, report, adjust), names, strict=True)
        )
        result = ComparisonResult(**vars(compare(one, two)))
        result.write(new_folder)
        origin = result.origin() | {"source": describe_sources(*sources)}
        write_provenance(new_folder, **origin, scene=options)
        write_summary(new_folder, result.summary())
    return result, folder
