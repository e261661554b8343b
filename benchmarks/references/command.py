"""references: certified results of the shipped models."""

import click

from harness.commands.terminal import Terminal, json_option


@click.command()
@click.argument("models", metavar="MODEL...", nargs=-1, required=True)
@json_option
def references(models: tuple[str, ...], as_json: bool) -> None:
    """Compute the certified results of each shipped MODEL, for each friction law, and write them next to its file.

    A model without an icon gets one, and a model of fmus/more without a second formulation is named.

    They come from closed forms, power series and independent solvers; this takes some minutes.  Run it in the folder of
    the project, with the FMU of the model in fmus or fmus/more.  `friction-fmus references` certifies any other model.

    \b
    Example:
      python -m benchmarks references stickslip
    """
    from .certification import certify_shipped, missing_parts

    results = [result for model in models for result in certify_shipped(model)]
    output = [f"{result.path}, relative difference {result.difference:.1e}" for result in results]
    output += [sentence for model in models for sentence in missing_parts(model)]
    Terminal(as_json).print_result(results, *output)
