"""Command line: one file for each command. A command parses its options, calls one function and prints the result."""

from importlib import import_module
from pkgutil import iter_modules

import click

from .run import outcome_as_json
from .terminal import Terminal, result_options, write_options


def print_version(context: click.Context, option: click.Parameter, requested: bool) -> None:
    """Print the package versions that provenance.json records, then exit."""
    if requested:
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
        from ..studies.run import study
        from ..studies.run.table import conclude, explain_chatter, results_table

        names = study.compared_scene_names()
        with terminal.progress(len(names)) as report:
            outcomes = list(study.run_scenes(names, terminal.out, report))
        rows = [outcome_as_json(outcome, terminal.out) for outcome in outcomes]
        failed = (outcome.error for outcome in outcomes if outcome.error)
        blocks = [results_table(outcomes, everything=False), "", *filter(None, [explain_chatter(outcomes)])]
        terminal.print_result(rows, *blocks, folder=terminal.out, failed=failed, conclusion=conclude(outcomes))


commands.checks = ("precision", "stability", "references")
for file in iter_modules(__path__):
    for command in vars(import_module(f"{__name__}.{file.name}")).values():
        if isinstance(command, click.Command):
            commands.add_command(command)
