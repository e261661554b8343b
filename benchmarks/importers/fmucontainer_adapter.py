"""Adapter of the C runtime of FMUContainer (package fmu-manipulation-toolbox).

The instances are embedded in a container FMU, which fmpy runs; values pass through inputs and outputs of the container.
Only log messages of the embedded FMUs are printed, because the container itself is verbose.
"""

import json
import sys
from contextlib import redirect_stdout
from dataclasses import replace
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from shutil import copy
from typing import Any

from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer

from harness.process.temporary_directory import temporary_directory
from harness.simulation.fmu_archive import PROCESS_RESOURCES, read_description
from harness.simulation.mtime_cache import cached_by_mtime

from . import fmpy_adapter
from .request import ImporterReply, ImporterRequest


def run_request(request: ImporterRequest) -> ImporterReply:
    path, files = request.run.fmu, tuple(f"{i}.fmu" for i in range(len(request.instances)))
    reals = [variable for variable in read_description(path).modelVariables if variable.type == "Real"]
    settable = [
        variable.name for variable in reals if variable.causality == "input" or variable.variability == "tunable"
    ]
    # equal for most requests, so that the container is cached
    inputs = dict.fromkeys([*settable, *request.run.values, *request.midrun_changes])
    container: dict[str, Any] = {
        "name": "container.fmu",
        "fmu": files,
        "step_size": request.step,
        "input": [[name, files[0], name] for name in inputs],
        "output": [[file, name, f"{name}_of_{i}"] for i, file in enumerate(files) for name in request.run.outputs],
        "link": [[files[0], request.connection[0], files[1], request.connection[1]]] if request.connection else [],
    }
    fmu = build_container(path, files, json.dumps(container))
    inner_request = replace(
        request,
        run=replace(request.run, fmu=fmu, outputs=tuple(name for _, _, name in container["output"])),
        references={variable.name: variable.valueReference for variable in read_description(fmu).modelVariables},
        instances=request.instances[:1],
        connection=[],
    )
    return replace(
        fmpy_adapter.run_request(inner_request, ("0.fmu: ", "1.fmu: ")), version=version("fmu-manipulation-toolbox")
    )


@cached_by_mtime
def build_container(fmu: Path, files: tuple[str, ...], container: str) -> Path:
    """Build a container of copies of an FMU from its description in JSON."""
    folder = PROCESS_RESOURCES.enter_context(temporary_directory("container-"))
    for file in files:
        copy(fmu, folder / file)
    (folder / "container.json").write_text(container, encoding="utf-8")
    options = ["-no-auto-input", "-no-auto-output", "-no-auto-link", "-fmu-directory", str(folder)]
    sys.argv[1:] = ["-container", "container.json", *options]
    with redirect_stdout(StringIO()):
        fmucontainer()
    return folder / "container.fmu"
