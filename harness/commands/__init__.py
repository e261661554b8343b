"""The command line: one file a command, all that there are; parse, one call, print."""

from importlib import import_module
from pkgutil import iter_modules

import click

from .run import outcome_as_json
from .terminal import Terminal, result_options


def print_version(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    """Print the versions that every result tells, and end."""
    if wanted:
        from ..results.provenance import package_versions

        click.echo(", ".join(f"{name} {number}" for name, number in package_versions().items()))
        context.exit()


class FullHelpGroup(click.Group):
    """Whose help cuts no sentence short."""

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """Each command, and the first sentence of its help."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, each.get_short_help_str(limit=1000)) for name, each in self.commands.items()])


@click.group(cls=FullHelpGroup, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@result_options
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=print_version, help="Print versions."
)
@click.pass_context
def commands(context: click.Context, terminal: Terminal) -> None:
    """Run the built FMUs, measure what they do, and set it beside what was published.

    Without a command: every published case.  Exit status 0: all well, 1: a run failed, 2: wrong usage,
    130 and 143: ended by Ctrl-C and by SIGTERM, with nothing left half done.

    \b
    Examples:
      python -m harness
      python -m harness run stickslip
      python -m harness run my-scene.toml --out elsewhere
      python -m harness list
    """
    context.default_map = dict.fromkeys(commands.commands, vars(terminal))  # before the command, they hold for it too
    if context.invoked_subcommand is None:
        from ..studies.run import study
        from ..studies.run.table import results_table

        names = study.published_scene_names()
        with terminal.progress(len(names)) as report:
            outcomes = list(study.run_scenes(names, terminal.out, report))
        told = [outcome_as_json(outcome, terminal.out) for outcome in outcomes]
        failed = (outcome.error for outcome in outcomes if outcome.error)
        terminal.print_result(told, results_table(outcomes, everything=False), folder=terminal.out, failed=failed)


for file in iter_modules(__path__):
    for command in vars(import_module(f"{__name__}.{file.name}")).values():
        if isinstance(command, click.Command):
            commands.add_command(command)
