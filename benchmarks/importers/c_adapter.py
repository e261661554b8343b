"""Adapter of a C program (host.c), which reads calls and prints values instead of JSON."""

import re
import subprocess
from functools import cache

from harness.process.subprocess_runner import run_subprocess
from harness.process.worker import WorkerDiedError

from ..c_host import find_compiler, load_library
from .request import ImporterReply, ImporterRequest


def run_request(request: ImporterRequest, timeout: float) -> tuple[ImporterReply, str]:
    """Run a request in the C program; return the reply and the output on standard error."""
    library = load_library(request.run.fmu)
    calls = [*(reset_cycle_calls(request) * request.reset_cycles or list_calls(request)), "0 unload"]
    process = run_subprocess(library.command, "".join(f"{call}\n" for call in calls), library.environment, timeout)
    if process.returncode:
        raise WorkerDiedError(process.returncode, process.stderr)
    return parse_reply(request, process.stdout), process.stderr


def parse_reply(request: ImporterRequest, text: str) -> ImporterReply:
    """Parse the output of one request."""
    rows, statuses = parse_output(text.splitlines(), len(request.instances))
    size = len(rows) if request.reset_cycles else request.steps + 1
    return ImporterReply(compiler_version(), rows[:size], rows[size:], sum(statuses[: request.steps]))


def list_calls(request: ImporterRequest) -> list[str]:
    """Return the calls of all runs of a request without reset cycles."""
    all_instances = range(len(request.instances))
    calls = [f"{i} new {name}" for i, name in enumerate(request.instances)]
    calls += list_run_calls(request, request.run.values, request.midrun_changes)
    if request.rerun:
        calls += [f"{i} reset" for i in all_instances] + list_run_calls(request, {}, {})
    return calls + [f"{i} free" for i in all_instances]


def list_run_calls(request: ImporterRequest, values: dict[str, float], midrun_changes: dict[str, float]) -> list[str]:
    """Return the calls of one run."""
    references, all_instances = request.references, range(len(request.instances))
    read = "getr " + " ".join(str(references[name]) for name in request.run.outputs)
    calls = [f"0 setr {references[name]} {value!r}" for name, value in values.items()]
    calls += [f"{i} begin" for i in all_instances] + [f"{i} {read}" for i in all_instances]
    for step in range(request.steps):
        if request.connection:
            source, sink = (references[name] for name in request.connection)
            calls.append(f"0 pass {source} 1 {sink}")
        if step == request.steps // 2:
            calls += [f"0 setr {references[name]} {value!r}" for name, value in midrun_changes.items()]
        calls += [f"{i} step {request.step * step!r} {request.step!r}" for i in all_instances]
        calls += [f"{i} {read}" for i in all_instances]
    return calls


def reset_cycle_calls(request: ImporterRequest) -> list[str]:
    """Return the calls of one cycle: run, save the state halfway, restore and continue, reset and run."""
    times = [request.step * i for i in range(request.steps)]
    steps = [f"0 step {t!r} {request.step!r}" for t in times]
    first_half, second_half = steps[: len(steps) // 2], steps[len(steps) // 2 :]
    read = ["0 getr " + " ".join(str(request.references[name]) for name in request.run.outputs)]
    calls = [*first_half, "0 save", *second_half, *read, "0 restore", *second_half, *read]
    return ["0 new a", "0 begin", *calls, "0 reset", "0 begin", *steps, *read, "0 free"]


def parse_output(lines: list[str], count: int) -> tuple[list[list[float]], list[bool]]:
    """Parse the rows of values of `count` instances, and for each step whether all instances accepted it."""
    words = [line.split() for line in lines]
    values = [[float(word) for word in fields] for kind, *fields in words if kind == "values"]
    statuses = [fields == ["0"] for kind, *fields in words if kind == "status"]
    rows = [[value for part in values[i : i + count] for value in part] for i in range(0, len(values), count)]
    return rows, [all(statuses[i : i + count]) for i in range(0, len(statuses), count)]


@cache
def compiler_version() -> str:
    """Return the version of the compiler."""
    process = subprocess.run([find_compiler(), "--version"], capture_output=True, text=True, check=True)
    return (re.findall(r"\d+(?:\.\d+)+", process.stdout.splitlines()[0]) or ["unknown version"])[-1]
