"""A request carried out by the C runtime of FMUContainer (package fmu-manipulation-toolbox): the instances are embedded
in one FMU, which fmpy calls; what is set and read goes through its own inputs and outputs.  Of its
log what the embedded FMUs say is shown; of itself it tells much, also when all goes well.
"""

import json
import sys
from contextlib import redirect_stdout
from dataclasses import replace
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from shutil import copy

from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer

from ...process.room import room
from ...running.description import description
from . import by_fmpy
from .request import Reply, Request, serve


def play(request: Request) -> Reply:
    with room("container-") as folder:
        fmu = built(request, folder)
        names = {variable.name: variable.valueReference for variable in description(fmu).modelVariables}
        inside = replace(
            request,
            fmu=str(fmu),
            references=names,
            read=[f"{name}_{i}" for i in range(len(request.instances)) for name in request.read],
            instances=request.instances[:1],
            connect=[],
        )
        return replace(by_fmpy.play(inside, ("0.fmu: ", "1.fmu: ")), version=version("fmu-manipulation-toolbox"))


def built(request: Request, folder: Path) -> Path:
    """The container: every value that is set is its input, every one that is read its output."""
    files = [f"{i}.fmu" for i in range(len(request.instances))]
    for file in files:
        copy(request.fmu, folder / file)
    set_there = dict.fromkeys([*request.values, *request.change])
    told = {
        "name": "container.fmu",
        "fmu": files,
        "step_size": request.step,
        "input": [[name, files[0], name] for name in set_there],
        "output": [[file, name, f"{name}_{i}"] for i, file in enumerate(files) for name in request.read],
        "link": [[files[0], request.connect[0], files[1], request.connect[1]]] if request.connect else [],
    }
    (folder / "container.json").write_text(json.dumps(told), encoding="utf-8")
    options = ["-no-auto-input", "-no-auto-output", "-no-auto-link", "-fmu-directory", str(folder)]
    sys.argv[1:] = ["-container", "container.json", *options]
    with redirect_stdout(StringIO()):
        fmucontainer()
    return folder / "container.fmu"


if __name__ == "__main__":
    serve(play)
