"""python -m harness: the commands, and how they end.  What a user can cause ends in one sentence and a status."""

import os
import sys
from pathlib import Path

if Path(sys.path[0]) != Path(__file__).parents[1]:  # a model in the folder that one is in may be called math.py
    sys.path += [str(Path(__file__).parents[1]), sys.path.pop(0)]

import click
from click.shell_completion import shell_complete

from .errors import HarnessError
from .process.interrupt import interruptible

SCRIPT = "friction-fmus"
COMMAND_NAME = SCRIPT if Path(sys.argv[0]).stem == SCRIPT else "python -m harness"
COMPLETION = "_FRICTION_FMUS_COMPLETE"  # the environment variable that click's shell completion sets


def main() -> None:
    """Run the command line; not by click's own main, which has its own end for an interrupt."""
    try:
        with interruptible():
            from .commands import commands
            from .commands.terminal import prepare_process

            if instruction := os.environ.get(COMPLETION):
                sys.exit(shell_complete(commands, {}, SCRIPT, COMPLETION, instruction))
            prepare_process()
            try:
                with commands.make_context(COMMAND_NAME, sys.argv[1:]) as context:
                    commands.invoke(context)
            finally:
                sys.stdout.flush()
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except click.exceptions.Exit as end:
        sys.exit(end.exit_code)
    except HarnessError as error:
        fail(str(error), error.status)
    except MemoryError:
        fail("there is not enough memory")
    except OSError as error:  # of a file that nobody foresaw, or of standard output: full, or its reader gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # or the interpreter would try, and complain, once more
        where = f"{error.filename}: " if error.filename else ""
        fail(f"{where}{error.strerror or error}", quiet=isinstance(error, BrokenPipeError))


def fail(sentence: str, status: int = 1, quiet: bool = False) -> None:
    """End with a sentence on standard error."""
    if not quiet:
        print(f"Error: {sentence}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
