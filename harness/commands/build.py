"""build: build_fmus.py as a command."""

import click

PASS_ALL_OPTIONS = {"ignore_unknown_options": True, "help_option_names": []}


@click.command("build", context_settings=PASS_ALL_OPTIONS, add_help_option=False)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED, metavar="[NAME | FILE.py]... [OPTIONS]")
@click.pass_context
def build(context: click.Context, arguments: tuple[str, ...]) -> None:
    """Build FMUs: the same as build_fmus.py; build --help lists its options.

    \b
    Examples:
      friction-fmus build
      friction-fmus build cart.py --native
    """
    from build_fmus import main  # imports the code generator, which the other commands do not need

    main.main([*arguments], prog_name=context.command_path, standalone_mode=False)
