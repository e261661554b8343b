"""info: variables of a model or an FMU."""

import click

from .terminal import Terminal, json_option, quiet_option


@click.command()
@click.argument("model", metavar="MODEL|FMU")
@quiet_option
@json_option
def info(model: str, quiet: bool, as_json: bool) -> None:
    """List the variables of MODEL: units, start values, ranges, friction laws, methods, defaults, and lookup tables.

    MODEL is the name of a model, or the path of any FMU, FMI 2.0 or 3.0.  The FMU is read, not run.

    \b
    Examples:
      friction-fmus info stickslip
      friction-fmus info other.fmu --json
    """
    from ..results.summary import make_terminal_table
    from ..running.fmu_variables import HEADINGS, describe_fmu
    from ..scenes.fmu_files import find_fmu

    description = describe_fmu(find_fmu(model))
    blocks: list[object] = [*description.sentences()]
    for title, variables in description.groups():
        table = make_terminal_table(title)
        for heading in HEADINGS:
            table.add_column(heading, justify="right" if heading == "start" else "left")
        for variable in variables:
            table.add_row(*variable.cells)
        blocks += ["", table]
    for title, (headings, *rows) in description.points():
        table = make_terminal_table(title)
        for heading in headings:
            table.add_column(heading, justify="right")
        for row in rows:
            table.add_row(*row)
        blocks += ["", table]
    Terminal(quiet, as_json).print_result(description.as_json(), *blocks)
