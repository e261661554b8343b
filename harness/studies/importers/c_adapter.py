"""Requests of one FMU carried out by a C program (running/host.c), for which Python is a library at most.

No player of its own stands between: it would compile the program for each FMU.
"""

import json
import re
import subprocess
from dataclasses import asdict
from functools import cache
from pathlib import Path

from ...process.subprocess_runner import SubprocessTimeoutError, run_subprocess
from ...running.c_host import find_compiler, load_library
from .request import END, ImporterReply, ImporterRequest


def run_requests(text: str, timeout: float) -> subprocess.CompletedProcess[str]:
    """The C program, ended, which has carried out requests, as if it were a player; Hangs after `timeout` s."""
    requests = [ImporterRequest(**json.loads(line)) for line in text.splitlines()]
    library = load_library(Path(requests[0].fmu))
    calls = [
        call for each in requests for call in [*(reset_cycle_calls(each) * each.reset_cycles or runs(each)), "0 end"]
    ]
    asked = "".join(f"{call}\n" for call in [*calls, "0 unload"])
    try:
        return answered(requests, run_subprocess(library.command, asked, library.environment, timeout))
    except SubprocessTimeoutError as late:
        answered(requests, late.process)
        raise


def answered(
    requests: list[ImporterRequest], done: subprocess.CompletedProcess[str]
) -> subprocess.CompletedProcess[str]:
    """The process with its answers in the words of a player."""
    replies = map(reply, requests, done.stdout.split(END)[:-1])
    done.stdout = "\n".join(json.dumps(asdict(each)) for each in replies)
    return done


def reply(request: ImporterRequest, text: str) -> ImporterReply:
    """What it printed."""
    rows, statuses = told(text.splitlines(), len(request.instances))
    size = len(rows) if request.reset_cycles else request.steps + 1
    return ImporterReply(version(), rows[:size], rows[size:], sum(statuses[: request.steps]))


def runs(request: ImporterRequest) -> list[str]:
    """The calls of all runs of a request that has no lives."""
    every = range(len(request.instances))
    calls = [f"{i} new {name}" for i, name in enumerate(request.instances)]
    calls += run(request, request.values, request.midrun_changes)
    if request.rerun:
        calls += [f"{i} reset" for i in every] + run(request, {}, {})
    return calls + [f"{i} free" for i in every]


def run(request: ImporterRequest, values: dict[str, float], midrun_changes: dict[str, float]) -> list[str]:
    """The calls of one run."""
    references, every = request.references, range(len(request.instances))
    read = "getr " + " ".join(str(references[name]) for name in request.outputs)
    calls = [f"0 setr {references[name]} {value!r}" for name, value in values.items()]
    calls += [f"{i} begin" for i in every] + [f"{i} {read}" for i in every]
    for step in range(request.steps):
        if request.connection:
            source, sink = (references[name] for name in request.connection)
            calls.append(f"0 pass {source} 1 {sink}")
        if step == request.steps // 2:
            calls += [f"0 setr {references[name]} {value!r}" for name, value in midrun_changes.items()]
        calls += [f"{i} step {request.step * step!r} {request.step!r}" for i in every]
        calls += [f"{i} {read}" for i in every]
    return calls


def reset_cycle_calls(request: ImporterRequest) -> list[str]:
    """The calls of one life: run, save on the way, restore and run on, reset and run."""
    times = [request.step * i for i in range(request.steps)]
    steps = [f"0 step {t!r} {request.step!r}" for t in times]
    early, late = steps[: len(steps) // 2], steps[len(steps) // 2 :]
    read = ["0 getr " + " ".join(str(request.references[name]) for name in request.outputs)]
    once = [*early, "0 save", *late, *read, "0 restore", *late, *read]
    return ["0 new a", "0 begin", *once, "0 reset", "0 begin", *steps, *read, "0 free"]


def told(lines: list[str], count: int) -> tuple[list[list[float]], list[bool]]:
    """The rows of values of so many instances, and for each step whether all accepted it."""
    words = [line.split() for line in lines]
    values = [[float(word) for word in rest] for kind, *rest in words if kind == "values"]
    statuses = [rest == ["0"] for kind, *rest in words if kind == "status"]
    rows = [[value for part in values[i : i + count] for value in part] for i in range(0, len(values), count)]
    return rows, [all(statuses[i : i + count]) for i in range(0, len(statuses), count)]


@cache
def version() -> str:
    """The version that the compiler tells of itself."""
    told = subprocess.run([find_compiler(), "--version"], capture_output=True, text=True, check=True)
    return (re.findall(r"\d+(?:\.\d+)+", told.stdout.splitlines()[0]) or ["of unknown version"])[-1]
