"""compare: differences between two results or FMUs."""

from functools import partial
from pathlib import Path
from typing import Any

import click

from .terminal import (
    NONNEGATIVE,
    SectionedCommand,
    Terminal,
    refuse_ignored_options,
    refuse_options,
    result_options,
    run_options,
)


@click.command(cls=SectionedCommand)
@click.argument("first", metavar="A")
@click.argument("second", metavar="B")
@run_options
@click.option("--within", type=NONNEGATIVE, help="Allowed difference, relative to the largest value.")
@click.option("--atol", type=NONNEGATIVE, help="Allowed difference in addition, in the unit of the variable.")
@result_options
@click.pass_context
def compare(
    context: click.Context,
    first: str,
    second: str,
    within: float | None,
    atol: float | None,
    run: dict[str, Any],
    terminal: Terminal,
) -> None:
    """Compare A and B, variable by variable.  Each is an FMU (FMI 2.0 or 3.0), a scene, a result folder, or a file:
    CSV of fmpy, .csv or .mat of OpenModelica or Dymola, or any table whose first column is time.

    Both sides share one time grid: FMUs and scenes are run at the times of the other side, and two FMUs with the
    fixed internal step that one of them declares.  Between samples, a variable is interpolated with its rate if the
    rate was recorded, otherwise monotonically; a variable of an integer type keeps its last value.  With --within or
    --atol, exit status 1 means that a difference exceeds the tolerance, events do not match, or a run failed.

    \b
    Examples:
      friction-fmus compare results/stickslip results/stickslip-threshold
      friction-fmus compare fmus/coulomb.fmu other.fmu --stop 2
      friction-fmus compare results/smd measured.csv --within 1e-3 --atol 1e-6
    """
    with terminal.progress(1) as report:  # the imports take most of a second
        from ..api import compare as compare_sides
        from ..results.provenance import describe_sources
        from ..results.result import save_result
        from ..scenes.fmu_files import find_fmu
        from ..simulation.resolve import FMU_SUFFIXES
        from ..simulation.trajectory import Trajectory
        from ..studies.compare.study import RUN_SUFFIXES, display_names

        suffixes = [Path(source).suffix for source in (first, second)]
        if all(Path(source).exists() for source in (first, second)) and not {*suffixes} & {*RUN_SUFFIXES}:
            refuse_options(context, "on stored results and files", "stop")
        fmus = [find_fmu(source) for source in (first, second) if Path(source).suffix in FMU_SUFFIXES]
        refuse_ignored_options(context, fmus)
        sides = [Path(source) if Path(source).is_file() else source for source in (first, second)]
        compute = partial(compare_sides, *sides, **run, progress=partial(report, "compare"))
        folder = terminal.out / "compare" / "-".join(display_names((first, second))).replace("/", "-")
        source = describe_sources(first, second)
        comparison = save_result(folder, compute, "compare", source, scene=run)
    runs = [side for side in (comparison.one, comparison.two) if isinstance(side, Trajectory)]
    failures = [run.failure for run in runs if run.failure]
    if within is not None or atol is not None:
        failures += comparison.violations(within or 0.0, atol or 0.0)
    terminal.print_result(comparison.as_json(), *comparison.blocks(), folder=folder, failures=failures)
