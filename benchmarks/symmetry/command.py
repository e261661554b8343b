"""symmetry: what a change of time, unit, sign or order changes."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import click

from harness.commands.terminal import POSITIVE, Terminal, json_option
from harness.errors import HarnessError
from harness.process.worker import WorkerPool

from .builds import BACKENDS, NATIVE, ROOT, all_models, build_fmu, find_source
from .changes import KINDS
from .study import DEFAULT, Options, Outcome, run_model

TITLE = "What a change of time, unit, sign or order changes"
SOURCES = (".py", ".fmu")


@click.command()
@click.argument("models", metavar="[MODEL | FILE.py | FMU]...", nargs=-1)
@click.option(
    *("--backend", "backends"),
    multiple=True,
    type=click.Choice(BACKENDS),
    default=[NATIVE],
    show_default=True,
    help="FMUs to build: Python or native (FMI 2.0), or native FMI 3.0; repeatable.",
)
@click.option("--method", "methods", multiple=True, help="Integration method; repeatable. Default: all.")
@click.option("--change", "kinds", multiple=True, type=click.Choice(KINDS), help="Symmetry; repeatable. Default: all.")
@click.option("--by-method", is_flag=True, help="Print one row for each model and method.")
@click.option("--markdown", is_flag=True, help="Print the table in Markdown.")
@click.option("--max-steps", default=DEFAULT.max_steps, show_default=True, help="Steps after which a run is shortened.")
@click.option(
    "--long-run",
    type=POSITIVE,
    default=DEFAULT.long_run,
    show_default=True,
    help="Duration of the long run in s, which is done by the method of the model only.",
)
@click.option(
    "--builds",
    type=click.Path(file_okay=False, path_type=Path),
    default=ROOT / "build" / "symmetry",
    help="Folder that keeps the built FMUs.  Default: build/symmetry of the checkout.",
)
@click.option("--workers", type=click.IntRange(1), default=os.cpu_count() or 1, help="Processes. Default: all cores.")
@json_option
def symmetry(
    models: tuple[str, ...],
    backends: tuple[str, ...],
    methods: tuple[str, ...],
    kinds: tuple[str, ...],
    by_method: bool,
    markdown: bool,
    max_steps: int,
    long_run: float,
    builds: Path,
    workers: int,
    as_json: bool,
) -> None:
    """Run models under a change of the start time, of the units, of all signs, of the order of declarations, of the
    frame of reference, of the largest step, and of angles by whole revolutions.  None of these may change a motion.
    Without arguments, run all models of the project.

    The table has the number of runs that differ and the number of runs.  The list below it has the first difference of
    each run.

    \b
    Examples:
      python -m benchmarks symmetry
      python -m benchmarks symmetry sleds --change units --by-method
      python -m benchmarks symmetry cart.py --backend python --backend native
    """
    sources = [Path(model) if model.endswith(".fmu") else find_source(model) for model in models] or all_models()
    for source in sources:
        if not source.is_file():
            raise HarnessError(f"there is no file {source}: give a model name, a model file or an FMU")
    terminal = Terminal(as_json)
    tasks = [(source, backend) for source in sources for backend in (backends if source.suffix == ".py" else ("fmu",))]
    arguments = partial(build_fmu, builds), kinds or KINDS, methods, Options(max_steps=max_steps, long_run=long_run)
    with terminal.progress(len(tasks)) as report:
        outcomes = [outcome for group in run_tasks(tasks, arguments, workers, report) for outcome in group]
    if missing_methods := {*methods} - {outcome.method for outcome in outcomes}:
        raise HarnessError(
            f"no model has the method {min(missing_methods)}: give a label of solver.method, as in --method dop853"
        )
    differences = [describe(outcome) for outcome in outcomes if outcome.difference]
    cells = list_cells(count_differences(outcomes, by_method))
    blocks = [] if markdown else [make_table(cells)]
    terminal.print_result(as_data(outcomes), f"{TITLE}: runs that differ, of all", *blocks)
    if not as_json:
        rows = make_markdown(cells) if markdown else []  # rich would break long rows
        click.echo("\n".join([*rows, *list_reasons(outcomes), *differences]))
    if differences:
        raise HarnessError(f"{len(differences)} of {len([o for o in outcomes if not o.reason])} runs differ")


def run_tasks(
    tasks: Sequence[tuple[Path, str]], arguments: tuple[Any, ...], workers: int, report: Callable[[str, float], None]
) -> Iterator[list[Outcome]]:
    """Yield the outcomes of each model and backend; a single one runs in this process."""
    if len(tasks) == 1:
        yield run_model(*tasks[0], *arguments)
        return
    with WorkerPool(min(workers, len(tasks))) as pool:
        futures = {pool.submit(run_model, *task, *arguments): task[0].stem for task in tasks}
        while futures:
            report(next(iter(futures.values())), 0.0)  # raises after Ctrl-C
            for future in pool.wait_for_any([*futures]):
                report(futures.pop(future), 1.0)
                yield future.result()


Counts = dict[str, dict[str, tuple[int, int]]]  # runs that differ, and all runs, by row and symmetry


def count_differences(outcomes: Sequence[Outcome], by_method: bool = False) -> Counts:
    """Return the number of runs that differ and of all runs, by model, or by model and method, and by symmetry."""
    rows: Counts = {}
    for outcome in outcomes:
        row = rows.setdefault(f"{outcome.model} {outcome.method}" if by_method else outcome.model, {})
        if not outcome.reason:
            n_differing, runs = row.get(outcome.kind, (0, 0))
            row[outcome.kind] = n_differing + bool(outcome.difference), runs + 1
    return dict(sorted(rows.items()))


def list_cells(rows: Counts) -> list[list[str]]:
    """Return the cells of the table: the heading, a row for each model, and the sums."""
    kinds = [kind for kind in KINDS if any(kind in row for row in rows.values())]
    sums: dict[str, tuple[int, int]] = {}
    for kind in kinds:
        counts = [row[kind] for row in rows.values() if kind in row]
        sums[kind] = sum(n_differing for n_differing, _ in counts), sum(runs for _, runs in counts)
    cells = [
        [name, *("{} of {}".format(*row[kind]) if kind in row else "-" for kind in kinds)]
        for name, row in (*rows.items(), ("all", sums))
    ]
    return [["model", *kinds], *cells]


def make_table(cells: list[list[str]]) -> Any:
    """Return the table for a terminal."""
    from rich.table import Table

    table = Table(*cells[0])
    for row in cells[1:]:
        table.add_row(*row)
    return table


def make_markdown(cells: list[list[str]]) -> list[str]:
    """Return the rows of the table for a page of the documentation."""
    head, *rows = [f"| {' | '.join(row)} |" for row in cells]
    return [head, "|---" * len(cells[0]) + "|", *rows]


def list_reasons(outcomes: Sequence[Outcome]) -> list[str]:
    """Return one sentence for each change that does not apply to a model."""
    reasons: dict[tuple[str, str, str], list[str]] = {}
    for outcome in outcomes:
        if outcome.reason:
            key = outcome.model, outcome.kind, outcome.reason
            run = f"{outcome.method} {outcome.law}".strip()
            runs = reasons.setdefault(key, [])
            if run not in runs:
                runs.append(run)
    return [
        f"{model}: {kind or 'no run'} left out, {reason} ({'; '.join(runs)})"
        for (model, kind, reason), runs in reasons.items()
    ]


def describe(outcome: Outcome) -> str:
    """Return one line with the first difference of a run."""
    run = ", ".join(filter(None, (outcome.model, outcome.method, outcome.law, outcome.backend)))
    return f"{run}; {outcome.text}: {outcome.difference}"


def as_data(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Return the outcomes for JSON."""
    counts = {
        name: {kind: {"differing": n_differing, "runs": runs} for kind, (n_differing, runs) in row.items()}
        for name, row in count_differences(outcomes).items()
    }
    return {"table": counts, "runs": [asdict(outcome) for outcome in outcomes]}
