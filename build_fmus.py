"""Build FMUs: python build_fmus.py [NAME | FILE.py ...] [--fmi 3] [--native] [--web] [--method M] [--law L] ..."""

import gc
import sys
from pathlib import Path

if Path(sys.path[0]) != Path(__file__).parent:  # by -m: a model where one is may be called math.py, or fmus.py
    sys.path += [str(Path(__file__).parent), sys.path.pop(0)]

from contextlib import AbstractContextManager
from hashlib import sha256
from typing import Any

import click

from fmus.packaging import BuildError, __version__
from fmus.packaging.archive import build
from fmus.packaging.equations.model_file import ModelFile
from fmus.packaging.import_time import measure_import_time
from fmus.packaging.lowering import LAWS, METHODS
from fmus.packaging.model_lookup import find_model, model_names

HERE = Path(__file__).parent
SCENES = HERE / "harness" / "scenes"
FMUS = HERE / "fmus" if (HERE / "pyproject.toml").is_file() else Path("fmus")  # installed: in the current folder


@click.command()
@click.argument("models", metavar="[NAME | FILE.py]...", nargs=-1)
@click.option("--fmi", type=click.Choice(["2", "3"]), default="2", help="Version; 3 is --native.")
@click.option("--native", "compiled", is_flag=True, help="Compiled to machine code: no Python in the FMU.")
@click.option("--web", is_flag=True, help="No FMUs but one page, web/index.html, that runs them in a browser.")
@click.option("--method", "methods", multiple=True, type=click.Choice(list(METHODS)), help="Offer this; repeatable.")
@click.option("--law", "laws", multiple=True, type=click.Choice(list(LAWS)), help="Offer this law; repeatable.")
@click.option("--platform", "platforms", multiple=True, help="For this only, as linux64; repeatable.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder; fmus, or beside FILE.py, without.")
@click.option(
    "--release",
    type=click.Path(file_okay=False, path_type=Path),
    help="Write one zip with the FMUs of every kind, the live page, references, licences and checksums.",
)
@click.version_option(__version__, prog_name="friction-fmus", message="%(prog)s %(version)s")
def main(
    models: tuple[str, ...],
    fmi: str,
    compiled: bool,
    web: bool,
    methods: tuple[str, ...],
    laws: tuple[str, ...],
    platforms: tuple[str, ...],
    out: Path | None,
    release: Path | None,
) -> None:
    """Build the FMU of every model NAME, and of the model in every FILE.py (without any: of all models).

    Prints the size, the time that Python takes to import it, and the sha256 digest.
    """
    gc.disable()  # what a build makes stays to its end; to look through it again and again is a tenth of its time
    if web and (compiled or platforms or fmi == "3"):
        raise CommandLineError("--web makes a page and no FMU: leave out --native, --platform and --fmi 3.")
    if release is not None:
        if models or compiled or web or methods or laws or platforms or out or fmi == "3":
            raise CommandLineError("--release builds everything: leave out the other options and models.")
        print_summary(release_archive(release))
        return
    compiled, kind = compiled or fmi == "3", "native/fmi3" if fmi == "3" else "native" if compiled else ""
    try:
        wanted = {model: find_model(model) for model in models or model_names()}
    except BuildError as error:
        raise CommandLineError(str(error)) from error
    for source in wanted.values():
        alike = sorted({str(other.path.resolve()) for other in wanted.values() if other.name == source.name})
        if (out or web) and len(alike) > 1:
            raise CommandLineError(f"{' and '.join(alike)} have one name: build them into folders of their own.")
    if web:
        ours = any(model in model_names() for model in wanted)
        place = out or (FMUS if ours else next(iter(wanted.values())).path.parent) / "web"
        with show_progress("writing the page"):
            path = build_page(list(wanted.values()), place, methods, laws)
        print_summary(path)
        return
    for model, source in wanted.items():
        folder = out or (FMUS if model in model_names() else source.path.parent) / kind
        try:
            if compiled:
                with show_progress(f"{source.name}: compiling; the first time with the C libraries, half a minute"):
                    path = build_native(source.path, folder, methods, laws, platforms, fmi)
                weight = ""
            else:
                path = build(source.path, folder, methods, laws, platforms)
                weight = f"  {1000 * measure_import_time(path):3.0f} ms"
        except BuildError as error:
            raise click.ClickException(str(error)) from error
        print_summary(path, weight)


def show_progress(what: str) -> AbstractContextManager[Any]:
    """Say at the terminal, as long as it takes, what is being done."""
    from rich.console import Console

    return Console(stderr=True).status(what)


def print_summary(path: Path, weight: str = "") -> None:
    """One line about a file that was built."""
    content = path.read_bytes()
    click.echo(f"{path.name}  {len(content) / 1000:4.0f} kB{weight}  {sha256(content).hexdigest()[:16]}")


def build_native(
    model: Path, folder: Path, methods: tuple[str, ...], laws: tuple[str, ...], platforms: tuple[str, ...], fmi: str
) -> Path:
    """The native FMU; what builds it needs more than the others do."""
    from fmus.packaging.native import build

    return build(model, folder, methods, laws, platforms, fmi)


def release_archive(folder: Path) -> Path:
    """Build the release archive."""
    from fmus.packaging.release import build_release

    try:
        with show_progress("building everything") as status:
            return build_release(folder, SCENES.glob("*.toml"), lambda file: status.update(f"building {file}"))
    except BuildError as error:
        raise click.ClickException(str(error)) from error


def build_page(models: list[ModelFile], folder: Path, methods: tuple[str, ...], laws: tuple[str, ...]) -> Path:
    """The page that runs them."""
    from fmus.packaging.web import build

    try:
        return build(models, folder, methods, laws, SCENES.glob("*.toml"))
    except BuildError as error:
        raise click.ClickException(str(error)) from error


class CommandLineError(click.ClickException):
    """A mistake in the command line, told in one sentence without the usage lines."""

    exit_code = 2


if __name__ == "__main__":
    main()
