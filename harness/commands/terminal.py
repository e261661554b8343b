"""Options, progress bar and output (tables or JSON) that the commands share.

Slow imports are local to functions, so that help and short commands start at once.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import wraps
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from .. import arguments
from ..arguments import INTERFACES, MODEL_EXCHANGE, WORKERS, Rule
from ..errors import HarnessError, format_value
from ..process.interrupt import check_interrupt
from ..process.temporary_directory import temporary_root

Command = Callable[..., Any]


SECTIONS = {  # of the help of a command: options that several commands share, each in the same order everywhere
    "Input table": (
        *("time", "column", "velocity", "position", "force", "current", "constant", "points", "quantity", "unit"),
        *("headings", "rate", "begin", "end"),
    ),
    "Run": ("stop", "rtol", "interface", "lenient", "timeout"),
    "Output": ("name", "out", "as_json"),
}


def write_options(command: click.Command, context: click.Context, formatter: click.HelpFormatter) -> None:
    """Write the options of a command to its help, in sections."""
    options = [item for item in command.get_params(context) if isinstance(item, click.Option)]
    records = {option.name: option.get_help_record(context) for option in options}
    section_names = {name for names in SECTIONS.values() for name in names}
    for title, names in {"Options": [name for name in records if name not in section_names], **SECTIONS}.items():
        if rows := [row for name in names if (row := records.get(name))]:
            with formatter.section(title):
                formatter.write_dl(rows)


class SectionedCommand(click.Command):
    """Command whose help has a section for each kind of options."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        write_options(self, ctx, formatter)


def out_option(text: str) -> Callable[..., Any]:
    """Return the option --out with a help text."""
    folder = click.Path(file_okay=False, path_type=Path)
    return click.option("--out", type=folder, default=Path("results"), show_default=True, help=text)


default_out_option = out_option("Folder for the results, with one subfolder per scene.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print only the result, as JSON.")


EXACT = "exact"  # method of FMUs of this project


def result_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of all commands with results; the command receives them as `terminal`."""

    @wraps(command)
    def wrapper(out: Path, as_json: bool, **options: Any) -> Any:
        context = click.get_current_context()
        for argument in context.command.params:
            if isinstance(argument, click.Argument) and options.get(argument.name or "") == "":
                raise click.UsageError(f"{argument.make_metavar(context).strip('[]')} is empty: give a name or a path")
        return command(terminal=Terminal(as_json, out), **options)

    return default_out_option(json_option(wrapper))


class RuleType(click.FloatRange):
    """Type of an option whose value follows a rule of the Python API; the help shows its range."""

    def __init__(self, rule: Rule) -> None:
        super().__init__()
        self.rule, self.name = rule, "integer range" if rule.parse is int else "number"

    def _describe_range(self) -> str:
        """Return the range of the rule, which click appends to the help of the option."""
        return self.rule.span

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        try:
            return self.rule.convert(self.rule.parse(value) if isinstance(value, str) else value)
        except (OverflowError, TypeError, ValueError):
            self.fail(f"{format_value(value)} is not {self.rule.text}", param, ctx)


FINITE, POSITIVE, NONNEGATIVE = map(RuleType, (arguments.FINITE, arguments.POSITIVE, arguments.NONNEGATIVE))
HEADINGS_OPTION = click.option("--headings", metavar="NAMES", help="Headings, if the file has none: 't [s],x [mm]'.")
TIME_OPTION = click.option(
    "--time",
    help="Heading of the times, with their unit if the file lacks it: 'Zeit [ms]', or 'n [0.01s]' for sample numbers.",
)
RATE_OPTION = click.option(
    "--rate", type=POSITIVE, metavar="HZ", help="Sampling rate in Hz, which replaces the times in the file."
)
BEGIN_OPTION = click.option("--begin", type=FINITE, help="Ignore samples before this time in s.")
END_OPTION = click.option("--end", type=FINITE, help="Ignore samples after this time in s.")
SET_OPTION = click.option(
    *("--set", "values"),
    multiple=True,
    metavar="NAME=VALUE,...",
    help="Parameters and start values; those of a scene are replaced. Repeatable.",
)
WORKERS_OPTION = click.option(
    "--workers", type=RuleType(WORKERS), default=lambda: os.cpu_count() or 1, help="Number of processes."
)
PERIOD_OPTION = click.option(
    "--period",
    type=POSITIVE,
    help="Period in s of the inputs of a scene, or of forces that depend on a clock.",
)
SECTION_OPTION = click.option(
    "--section",
    help="What motions return to: the mode of a contact where it ends to stick, or an output where it rises through 0.",
)
STOP_OPTION = click.option("--stop", type=FINITE, help="Stop time in s. Default: that of the FMU.")
RUN_OPTIONS = (
    STOP_OPTION,
    click.option(
        "--rtol",
        type=POSITIVE,
        help="Relative tolerance: of the solver of an FMU of this project; of the result of any other FMU.  [default: "
        "that of the FMU; 1e-6 for any other]",
    ),
    click.option(
        "--interface",
        type=click.Choice(INTERFACES, case_sensitive=False),
        metavar="|".join(INTERFACES),
        help="Interface to use if the FMU offers both.  [default: CoSimulation]",
    ),
    click.option("--lenient", is_flag=True, help="Run the FMU even if it violates the FMI standard."),
    click.option(
        "--timeout",
        type=POSITIVE,
        help="Seconds allowed for one FMI call, or for 1/4096 of a run of an FMU of this project.  [default: 60.0]",
    ),
)
RUN_NAMES = ("stop", "rtol", "interface", "lenient", "timeout")


def is_given(context: click.Context, option: str) -> bool:
    """Return whether an option is given on the command line."""
    return context.get_parameter_source(option) is ParameterSource.COMMANDLINE


def refuse_options(context: click.Context, reason: str, *options: str) -> None:
    """Raise UsageError if one of the options, which have no effect here, is given on the command line."""
    for parameter in context.command.params:
        if parameter.name in options and is_given(context, parameter.name):
            raise click.UsageError(f"{parameter.opts[0]} has no effect {reason}")


def refuse_ignored_options(
    context: click.Context,
    fmus: Iterable[Path],
    timeout_is_ignored: bool = False,
) -> None:
    """Raise UsageError for an option on the command line that has no effect on any of the FMUs.

    Parameters
    ----------
    context : click.Context
        Context of the command.
    fmus : iterable of pathlib.Path
        FMUs that are run with the options of the command line; scenes have their own options.
    timeout_is_ignored : bool
        Whether the command limits no time of FMUs of this project.
    """
    from ..simulation.fmu_archive import exposes_solver_steps, read_description
    from ..simulation.model_data import read_model_data

    files, uses_exchange = list(fmus), context.params["interface"] == MODEL_EXCHANGE
    if not files:
        options = ("rtol", "interface", "lenient", "timeout")
        refuse_options(
            context,
            "with a scene, which sets it in its file; give the FMU of the model instead, as in fmus/stickslip.fmu",
            *options,
        )
    elif (is_given(context, "rtol") or is_given(context, "timeout")) and not uses_exchange:
        descriptions = [read_description(file, context.params["lenient"]) for file in files]
        if all(map(exposes_solver_steps, descriptions)):
            reason = f"on {files[0].name}, which runs at the steps of its own solver"
            refuse_options(context, reason, *["timeout"] * timeout_is_ignored)
            methods = [read_model_data(file).fixed_choices.get("solver.method", ("", 0))[0] for file in files]
            assignments = context.params.get("values", ())
            if all(uses_closed_form(*pair, assignments) for pair in zip(descriptions, methods, strict=True)):
                remedy = "" if all(methods) else ": set solver.method as well"
                reason = f"on {files[0].name} with the method {EXACT}, a closed form{remedy}"
                refuse_options(context, reason, "rtol")


def uses_closed_form(description: Any, fixed_method: str, assignments: Iterable[str]) -> bool:
    """Return whether an FMU of this project is run by its closed form, which has no tolerance."""
    if fixed_method:
        return fixed_method == EXACT
    from ..scenes.assignments import parse_assignments

    method = next(variable for variable in description.modelVariables if variable.name == "solver.method")
    labels = {str(item.value): item.name for item in method.declaredType.items}
    number = str(parse_assignments("--set", assignments).get("solver.method", method.start))
    return labels.get(number.removesuffix(".0"), number) == EXACT


def run_options(command: Command) -> Command:
    """Add the options of commands that run FMUs; the command receives those that are given, by the name of Python."""

    @wraps(command)
    def wrapper(**options: Any) -> Any:
        run_settings = {name: value for name in RUN_NAMES if (value := options.pop(name)) not in (None, False)}
        return command(run=run_settings, **options)

    result: Command = wrapper
    for option in reversed(RUN_OPTIONS):
        result = option(result)
    return result


def prepare_process() -> None:
    """Prepare this process for a command.

    Unencodable characters are replaced, closed standard streams become empty ones, every library uses the same
    temporary folder, and BLAS uses one thread: several threads change the order of summation and mostly wait.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for name in ("stdin", "stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "r+", encoding="utf-8"))  # noqa: SIM115 - open until the process exits
        elif isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    tempfile.tempdir = os.environ["TMPDIR"] = str(temporary_root())


@contextmanager
def progress(is_shown: bool, total: int) -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar on standard error; yield a callback that receives the scene and its finished share.

    A share of an external FMU has a note: the accuracy that the run has reached.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(file=sys.stderr)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    if not (is_shown and console.is_terminal):  # a disabled bar writes an empty line before rich 14.2
        yield lambda name, share: check_interrupt()
        return
    with (
        os.fdopen(os.dup(sys.stderr.fileno()), "w", errors="replace") as console.file,  # runs redirect standard error
        Progress(*columns, console=console, transient=True, redirect_stderr=False) as bar,
    ):
        task = bar.add_task("reading", total=total)
        started_scenes: list[str] = []

        def report(name: str, share: float) -> None:
            check_interrupt()
            if name not in started_scenes:
                started_scenes.append(name)
            description = ": ".join(filter(None, (name, getattr(share, "note", ""))))
            bar.update(task, description=description, completed=len(started_scenes) - 1 + share)

        yield report


def print_json(result: Any) -> None:
    """Print a result as JSON."""
    from ..results.files import to_json

    click.echo(to_json(result))


@dataclass(frozen=True)
class Terminal:
    """Output of a command: only JSON if `as_json`; `out` is the folder for results."""

    as_json: bool
    out: Path = Path()

    def progress(self, total: int) -> AbstractContextManager[Callable[[str, float], None]]:
        return progress(not self.as_json, total)

    def print_result(
        self,
        result: Any,
        *blocks: Any,
        folder: Path | None = None,
        failures: Iterable[str] = (),
        conclusion: Any = None,
    ) -> None:
        """Print the result as JSON, or as tables and sentences.

        Parameters
        ----------
        result
            Data for JSON output.
        *blocks
            Tables and sentences to print otherwise.
        folder
            Folder of the result; printed after them, with a note if an earlier result was replaced.
        failures
            Error messages.
        conclusion
            Sentence to print last, unless there are error messages.

        Raises
        ------
        HarnessError
            If `failures` is not empty.
        """
        from rich.console import Console

        if self.as_json:
            print_json(result)
        else:
            console = Console(markup=False, highlight=False)  # brackets in units and names are not markup
            for block in blocks:
                console.print(block.for_terminal(console.width) if hasattr(block, "for_terminal") else block)
            if folder:
                from ..results.provenance import replacement_note

                console.print("\n".join(filter(None, (replacement_note(folder), f"Results in {folder}"))))
        messages = [*failures]
        if conclusion and not (messages or self.as_json):
            console.print(conclusion)
        if messages:
            raise HarnessError("\n".join(messages))
