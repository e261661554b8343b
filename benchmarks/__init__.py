"""Benchmarks of the project: speed and accuracy, other engines, other simulation tools; not part of the package."""

import shlex
import sys


def command_line() -> str:
    """Return the command line of this process, for the provenance of a result."""
    return shlex.join(["python", "-m", "benchmarks", *sys.argv[1:]])
