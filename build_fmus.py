"""Build the FMUs: python build_fmus.py [NAME ...] [--out DIR]"""

from hashlib import sha256
from pathlib import Path

import click

from fmus.packaging import BuildError
from fmus.packaging.archive import build
from fmus.packaging.catalogue import names


@click.command()
@click.argument("models", metavar="[NAME]...", nargs=-1)
@click.option("--out", type=click.Path(path_type=Path), default=Path(__file__).parent / "fmus", help="Folder for them.")
def main(models: tuple[str, ...], out: Path) -> None:
    """Build the FMU of every model NAME (without one: of all models); print its size and sha256 digest."""
    known = names()
    for name in models:
        if name not in known:
            raise UnknownName(f"There is no model {name!r}; known are {', '.join(known)}.")
    for name in models or known:
        try:
            content = build(name, out).read_bytes()
        except BuildError as error:
            raise click.ClickException(str(error)) from error
        click.echo(f"{name}.fmu  {len(content) / 1000:4.0f} kB  {sha256(content).hexdigest()[:16]}")


class UnknownName(click.ClickException):
    """A mistake in the command line, told in one sentence without the usage lines."""

    exit_code = 2


if __name__ == "__main__":
    main()
