"""Command line: one file for each command. A command parses its options, calls one function and prints the result."""

from importlib import import_module
from pkgutil import iter_modules

import click

from ..errors import HarnessError
from .run import run_and_save, run_as_json
from .terminal import Terminal, result_options, write_options


def print_version(context: click.Context, option: click.Parameter, is_requested: bool) -> None:
    """Print the package versions that provenance.json records, then exit."""
    if is_requested:
        from ..results.provenance import package_versions

        click.echo(", ".join(f"{name} {number}" for name, number in package_versions().items()))
        context.exit()


class SectionedGroup(click.Group):
    """Command group whose help prints the first sentence of each command in full.

    Attributes
    ----------
    checks : tuple of str
        Commands that the help lists in a section of their own.
    """

    checks: tuple[str, ...] = ()

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        write_options(self, ctx, formatter)
        rows = [(name, item.get_short_help_str(limit=1000)) for name, item in self.commands.items()]
        checks = [row for row in rows if row[0] in self.checks]
        for title, part in (("Commands", [row for row in rows if row not in checks]), ("Checks of models", checks)):
            if part:
                with formatter.section(title):
                    formatter.write_dl(part)


@click.group(cls=SectionedGroup, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@result_options
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=print_version, help="Print versions."
)
@click.pass_context
def commands(context: click.Context, terminal: Terminal) -> None:
    """Run FMUs with dry friction, measure them, and compare the results with published and other known values.

    Without a command, it runs all cases with known values.  Exit status: 0 success, 1 a run or check failed, 2 wrong
    usage, 130 interrupted by Ctrl-C, 143 terminated by SIGTERM.  An interrupted command leaves no incomplete results.

    \b
    Examples:
      friction-fmus
      friction-fmus run stickslip
      friction-fmus run my-scene.toml --out elsewhere
      friction-fmus info
    """
    # options before the command apply to the command as well
    context.default_map = dict.fromkeys(commands.commands, vars(terminal))
    if context.invoked_subcommand is None:
        run_published_scenes(terminal)


def run_published_scenes(terminal: Terminal) -> None:
    """Run all built-in scenes with known values; one that fails does not stop the others."""
    from rich.text import Text

    from ..process.interrupt import check_interrupt
    from ..scenes.fmu_files import check_built
    from ..scenes.scene import load_scene, shipped_scenes
    from ..studies.run.result import conclude, explain_chatter, tabulate_quantities

    scenes = [scene for scene in map(load_scene, shipped_scenes()) if scene.known]
    for scene in scenes:
        check_built(scene.run.fmu)
    runs, rows, failures = [], [], list[str]()
    with terminal.progress(len(scenes)) as report:
        for scene in scenes:
            check_interrupt()
            try:
                result, folder = run_and_save(scene.name, terminal.out, report)
                runs.append(result)
                rows.append(run_as_json(result, folder))
                failures += filter(None, [result.failure])
            except HarnessError as error:
                check_interrupt()  # a Python FMU may have swallowed an interrupt
                failures.append(str(error))
                rows.append({"scene": scene.name, "quantities": [], "error": str(error), "comparison": None})
    text, agrees = conclude(runs)
    blocks = [tabulate_quantities(runs, everything=False), *(f"{row['scene']}: failed" for row in rows if row["error"])]
    blocks += ["", *filter(None, [explain_chatter(runs)])]
    conclusion = Text(text, style="green" if agrees else "red") if text else ""
    terminal.print_result(rows, *blocks, folder=terminal.out, failures=failures, conclusion=conclusion)


commands.checks = ("precision", "stability", "references")
for file in iter_modules(__path__):
    for command in vars(import_module(f"{__name__}.{file.name}")).values():
        if isinstance(command, click.Command):
            commands.add_command(command)
