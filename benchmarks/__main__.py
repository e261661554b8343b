"""Entry point of `python -m benchmarks`."""

import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__" and Path(sys.path[0]) != Path(__file__).parents[1]:  # a model here may be named math.py
    sys.path += [str(Path(__file__).parents[1]), sys.path.pop(0)]

from harness.__main__ import run_command

if __name__ == "__main__":

    def load_command() -> Any:
        from benchmarks.__main__ import main  # imported here, where run_command handles signals

        return main

    run_command(load_command, "python -m benchmarks")
    sys.exit()

import click

from benchmarks.bench.command import bench
from benchmarks.external.command import external
from benchmarks.hosts.command import hosts
from benchmarks.importers.command import importers
from benchmarks.literature.command import literature
from benchmarks.references.command import references
from benchmarks.rivals.command import rivals
from benchmarks.suite.command import suite
from benchmarks.symmetry.command import symmetry
from harness.commands import SectionedGroup


@click.group(cls=SectionedGroup, context_settings={"help_option_names": ["-h", "--help"]})
def main() -> None:
    """Measure this project: speed and accuracy, symmetry, the same scenes in other engines, the FMUs in other tools,
    problems from the literature; and compute its certified results.

    These commands need a checkout of the project and are not a part of the installed package.

    \b
    Examples:
      python -m benchmarks bench
      python -m benchmarks rivals scipy mujoco
    """


for command in (bench, external, hosts, importers, literature, references, rivals, suite, symmetry):
    main.add_command(command)
