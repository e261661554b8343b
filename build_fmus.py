"""Build FMUs: python build_fmus.py [NAME | FILE.py ...] [--fmi 3] [--native] [--web] [--method M] [--law L] ..."""

import gc
import os
import signal
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    if Path(sys.path[0]) != Path(__file__).parent:  # run by -m: a model may be called math.py
        sys.path += [str(Path(__file__).parent), sys.path.pop(0)]

    def interrupt(number: int, _: object) -> None:
        """Raise KeyboardInterrupt for a signal."""
        raise KeyboardInterrupt(number)

    def run_command() -> int:
        """Run the command and return its exit status. Ctrl-C, SIGTERM and expected errors end it with a sentence."""
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, interrupt)
        try:
            import click  # imported here, where signals are handled

            from build_fmus import main

            try:
                with main.make_context(Path(sys.argv[0]).name, sys.argv[1:]) as context:
                    main.invoke(context)
            except click.ClickException as error:
                error.show()
                return error.exit_code
            except click.exceptions.Exit:  # of --help
                pass
            sys.stdout.flush()
        except KeyboardInterrupt as error:
            number = error.args[0]
            print(f"Error: {'interrupted' if number == signal.SIGINT else 'terminated'}", file=sys.stderr)
            return 128 + number
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # Python flushes standard output, which may be full, again
            if not isinstance(error, BrokenPipeError):
                prefix = f"{error.filename}: " if error.filename else ""
                print(f"Error: {prefix}{error.strerror or error}", file=sys.stderr)
            return 1
        return 0

    gc.disable()  # objects of a build live until its end; collecting garbage takes a tenth of the build time
    sys.exit(run_command())

import logging
import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from hashlib import sha256

import click

from fmus.compiler import BuildError, __version__
from fmus.compiler.equations.model_file import ModelFile
from fmus.compiler.lowering import LAWS, METHODS
from fmus.compiler.model_lookup import find_model, model_names, more_model_names
from fmus.packaging.archive import build

LOG = logging.getLogger("fmus.build")
SCRIPT_FOLDER = Path(__file__).parent
# an installed package builds into the current folder
FMUS = SCRIPT_FOLDER / "fmus" if (SCRIPT_FOLDER / "pyproject.toml").is_file() else Path("fmus")


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("models", metavar="[NAME | FILE.py]...", nargs=-1)
@click.option("--fmi", type=click.Choice(["2", "3"]), default="2", help="FMI version; 3 implies --native.")
@click.option("--native", "is_native", is_flag=True, help="Compile to machine code; the FMU contains no Python.")
@click.option("--more", is_flag=True, help="Build the models of fmus/more.")
@click.option(
    "--web",
    is_flag=True,
    help="Write web/index.html (web/more.html with --more), a page that runs the models in a browser, instead of FMUs.",
)
@click.option(
    "--method",
    "methods",
    multiple=True,
    type=click.Choice(list(METHODS)),
    help="Include only this integration method; repeatable.",
)
@click.option(
    "--law",
    "laws",
    multiple=True,
    type=click.Choice(list(LAWS)),
    help="Include only this friction law; repeatable.",
)
@click.option(
    "--real-only",
    is_flag=True,
    help="Offer Reals only, with one method and one law, for hosts without other types; into the folder real-only.",
)
@click.option(
    "--platform",
    "platforms",
    multiple=True,
    help="Include only this platform, such as linux64; repeatable.",
)
@click.option(
    "--out", type=click.Path(path_type=Path), help="Output folder; by default fmus, or the folder of FILE.py."
)
@click.option(
    "--release",
    type=click.Path(file_okay=False, path_type=Path),
    help="Write one zip file with all FMUs, the live page, references, licences and checksums.",
)
@click.option(
    "--stages",
    type=click.Path(file_okay=False, path_type=Path),
    help="Write the texts of every stage from the equations to C into this folder, instead of FMUs.",
)
@click.version_option(__version__, prog_name="friction-fmus", message="%(prog)s %(version)s")
def main(
    models: tuple[str, ...],
    fmi: str,
    is_native: bool,
    more: bool,
    web: bool,
    methods: tuple[str, ...],
    laws: tuple[str, ...],
    real_only: bool,
    platforms: tuple[str, ...],
    out: Path | None,
    release: Path | None,
    stages: Path | None,
) -> None:
    """Build an FMU for each model NAME or model file FILE.py; without arguments, for the five models
    of fmus.  FMUs of fmus/more are written there.

    The command prints the size of each file and the first digits of its SHA-256 digest.

    \b
    Examples:
      friction-fmus build
      friction-fmus build stickslip --out elsewhere
      friction-fmus build --more
      friction-fmus build cart.py --native --platform linux64
      friction-fmus build pendulum --real-only
      friction-fmus build --release dist
    """
    click.get_current_context().with_resource(temporary_files())
    if web and (is_native or platforms or real_only or fmi == "3"):
        raise CommandLineError("--web writes a page, not FMUs: remove --native, --real-only, --platform and --fmi 3.")
    if release is not None:
        if (
            models
            or more
            or is_native
            or web
            or methods
            or laws
            or real_only
            or platforms
            or out
            or stages
            or fmi == "3"
        ):
            raise CommandLineError("--release builds everything: remove the other options and models.")
        print_summary(release_archive(release))
        return
    if stages is not None and (is_native or web or real_only or platforms or out or fmi == "3"):
        raise CommandLineError(
            "--stages writes texts, not FMUs: remove --native, --web, --real-only, --platform, --out and --fmi 3."
        )
    is_native = is_native or fmi == "3"
    subfolder = Path("real-only" if real_only else "", "native" if is_native else "", "fmi3" if fmi == "3" else "")
    try:
        names = models if models and not more else (*models, *(more_model_names() if more else model_names()))
        sources = {model: find_model(model) for model in names}
    except BuildError as error:
        raise CommandLineError(str(error)) from error
    for source in sources.values():
        same_name = sorted({str(other.path.resolve()) for other in sources.values() if other.name == source.name})
        if (out or web) and len(same_name) > 1:
            raise CommandLineError(f"{' and '.join(same_name)} have the same name: build them into separate folders.")
    if web:
        is_project_model = any(model in model_names() + more_model_names() for model in sources)
        web_folder = out or (FMUS if is_project_model else next(iter(sources.values())).path.parent) / "web"
        with show_progress("writing the page"):
            path = build_page(list(sources.values()), web_folder, methods, laws, more)
        print_summary(path)
        return
    if stages is not None:
        from fmus.packaging.stages import write_stages  # needs the C compiler, an optional package

        for source in sources.values():
            try:
                click.echo(write_stages(source, stages, methods, laws))
            except BuildError as error:
                raise click.ClickException(str(error)) from error
        return
    for model, source in sources.items():
        folder = out or default_folder(model, source) / subfolder
        LOG.debug("the build of %s starts", model)
        try:
            if is_native:
                with show_progress(
                    f"{source.name}: compiling (the first build also compiles the C libraries, half a minute)"
                ):
                    path = build_native(source.path, folder, methods, laws, platforms, fmi, real_only)
            else:
                path = build(source.path, folder, methods, laws, platforms, real_only)
        except BuildError as error:
            raise click.ClickException(str(error)) from error
        print_summary(path)


def default_folder(model: str, source: ModelFile) -> Path:
    """Return the folder of the FMUs of a model: that of the project, or that of its file."""
    if model in more_model_names():
        return FMUS / "more"
    return FMUS if model in model_names() else source.path.parent


def show_progress(text: str) -> AbstractContextManager[Any]:
    """Show a status message at the terminal while the block runs."""
    from rich.console import Console

    return Console(stderr=True).status(text)


def print_summary(path: Path) -> None:
    """Print name, size and digest of a file that was built."""
    content = path.read_bytes()
    click.echo(f"{path.name}  {len(content) / 1000:4.0f} kB  {sha256(content).hexdigest()[:16]}")


def build_native(
    model: Path,
    folder: Path,
    methods: tuple[str, ...],
    laws: tuple[str, ...],
    platforms: tuple[str, ...],
    fmi: str,
    real_only: bool,
) -> Path:
    """Build the native FMU; the import is in the function because it needs optional packages."""
    from fmus.packaging.native.native_fmu import build

    return build(model, folder, methods, laws, platforms, fmi, real_only)


def release_archive(folder: Path) -> Path:
    """Build the release archive."""
    from fmus.page.release import build_release

    try:
        with show_progress("building everything") as status:
            return build_release(folder, lambda file: status.update(f"building {file}"))
    except BuildError as error:
        raise click.ClickException(str(error)) from error


def build_page(
    models: list[ModelFile], folder: Path, methods: tuple[str, ...], laws: tuple[str, ...], more: bool
) -> Path:
    """Build the web page that runs the models; the page of fmus/more has a file name of its own."""
    from fmus.page import FILE, MORE_FILE, build

    try:
        return build(models, folder, methods, laws, MORE_FILE if more else FILE)
    except BuildError as error:
        raise click.ClickException(str(error)) from error


class CommandLineError(click.ClickException):
    """An invalid command line; click prints the message without the usage lines."""

    exit_code = 2


@contextmanager
def temporary_files() -> Iterator[None]:
    """Create all temporary files of a build in one directory, which is removed on exit.

    The C compiler caches its own parts in the home directory or, if there is none, in the temporary directory.
    """
    os.environ.setdefault("HOME", tempfile.gettempdir())
    with tempfile.TemporaryDirectory(prefix="fmu-build-") as directory:
        former_folder, tempfile.tempdir = tempfile.tempdir, directory
        try:
            yield
        finally:
            tempfile.tempdir = former_folder
