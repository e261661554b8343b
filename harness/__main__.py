"""python -m harness: the commands, and how they end.  What a user can cause ends in one sentence and a status."""

import os
import sys

from .errors import HarnessError
from .interrupt import interruptible


def main() -> None:
    """Run the command line."""
    try:
        with interruptible():
            from .commands import commands
            from .terminal import prepare

            prepare()
            try:
                commands()
            finally:
                sys.stdout.flush()
    except HarnessError as error:
        fail(str(error), error.status)
    except MemoryError:
        fail("there is not enough memory")
    except OSError as error:  # of a file that nobody foresaw, or of standard output: full, or its reader gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # or the interpreter would try, and complain, once more
        where = f"{error.filename}: " if error.filename else ""
        fail(f"{where}{error.strerror}", quiet=isinstance(error, BrokenPipeError))


def fail(sentence: str, status: int = 1, quiet: bool = False) -> None:
    """End with a sentence on standard error."""
    if not quiet:
        print(f"Error: {sentence}", file=sys.stderr)
    sys.exit(status)


if __name__ == "__main__":
    main()
