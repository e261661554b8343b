"""Entry point of `python -m harness`. Errors that a user can cause end with one sentence and an exit status."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import COMMAND_LINE, HarnessError
from .process.interrupt import interruptible

if TYPE_CHECKING:  # imported below, where signals are handled
    import click

SCRIPT = "friction-fmus"
COMMAND_NAME = SCRIPT if Path(sys.argv[0]).stem == SCRIPT else "python -m harness"
COMPLETION = "_FRICTION_FMUS_COMPLETE"  # the environment variable that click's shell completion sets


def main() -> None:
    """Run the command line."""

    def load_commands() -> "click.Command":
        from click.shell_completion import shell_complete

        from .commands import commands

        if instruction := os.environ.get(COMPLETION):
            sys.exit(shell_complete(commands, {}, SCRIPT, COMPLETION, instruction))
        return commands

    run_command(load_commands, COMMAND_NAME)


def run_command(load: "Callable[[], click.Command]", name: str) -> None:
    """Run a command with the arguments of this process, and exit with its status.

    click's own main() is not used because it handles Ctrl-C differently.

    Parameters
    ----------
    load : callable
        Imports and returns the command. Signals during the import are handled.
    name : str
        Name by which the user called the command.
    """
    with exit_on_error(), interruptible():
        command = load()
        from .commands.terminal import prepare_process

        prepare_process()
        run_arguments(command, name, sys.argv[1:])


def run_arguments(command: "click.Command", name: str, arguments: list[str]) -> None:
    """Run a command with these arguments; `name` is the one by which the user called it."""
    COMMAND_LINE.set(True)
    try:
        with command.make_context(name, arguments) as context:
            command.invoke(context)
    finally:
        sys.stdout.flush()


@contextmanager
def exit_on_error() -> Iterator[None]:
    """Print an error that a user can cause in one sentence, and exit with its status."""
    try:
        with exit_on_usage_error():
            yield
    except HarnessError as error:
        fail(str(error), error.status)
    except MemoryError:
        fail("out of memory")
    except OSError as error:  # an unexpected file error, or standard output is full or closed
        # otherwise the interpreter flushes standard output again at exit and prints a second error
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        prefix = f"{error.filename}: " if error.filename else ""
        fail(f"{prefix}{error.strerror or error}", quiet=isinstance(error, BrokenPipeError))


@contextmanager
def exit_on_usage_error() -> Iterator[None]:
    """Print an error of the command line and exit; click is imported by then, or raises nothing."""
    try:
        yield
    except Exception as error:
        click = sys.modules.get("click")
        if click and isinstance(error, click.ClickException):
            error.show()
        elif not (click and isinstance(error, click.exceptions.Exit)):
            raise
        sys.exit(error.exit_code)


def fail(message: str, status: int = 1, quiet: bool = False) -> None:
    """Print an error message to standard error and exit."""
    if not quiet:
        print(f"Error: {message}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
