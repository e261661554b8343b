"""Trials of external FMUs: the commands in a terminal of their own, the judgement of their results, and the table."""

import csv
import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import inf, nan
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from rich.table import Table

from harness import load_result
from harness.errors import HarnessError, first_line
from harness.process.subprocess_runner import PROJECT_ROOT
from harness.results.files import write_csv_rows
from harness.simulation.fmu_archive import read_description
from harness.simulation.trajectory import Trajectory

COMMANDS = ("run", "exchange", "compare", "sweep", "fit")
RIGHT, INEXACT, REFUSED, SLOW, FAULT = "right", "inexact", "refused", "slow", "FAULT"
DEFAULT_STOP = 10.0  # s after the start, of FMUs that declare none
COMPARE_RTOL = 1e-5  # ten times the tolerance of `compare`: a solver in the FMU has errors in both importers
SWEEP_RTOL = 1e-9  # the first run of a sweep is the same run
SOLVER_RTOL = 1e-3  # fmpy's CVode has its own tolerance
FIT_RTOL = 1e-3
CONTROL_SEQUENCES = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]|\r")
BAR = re.compile(r"[━╸╺]+")
REFUSALS = (1, 2)  # exit status of a command that refuses or reports a failure


@dataclass(frozen=True)
class Reply:
    """What a command did in its terminal: exit status, time in s, time of the first visible text, and the text."""

    status: int
    seconds: float
    first_text: float
    text: str
    is_killed: bool = False

    @property
    def message(self) -> str:
        """Return the last error of the command in one line; empty if there is none."""
        _, separator, message = self.text.rpartition("Error: ")
        return " ".join(message.split()) if separator else ""

    @property
    def failed_outcome(self) -> tuple[str, str]:
        """Return outcome and text of a command that ended neither by success nor by a message."""
        if self.is_killed:
            return SLOW, f"not finished after {self.seconds:.0f} s"
        return FAULT, " ".join(self.text[-300:].split())

    @property
    def is_orderly(self) -> bool:
        """Return whether the command ended by success or by a message, and not by a crash or a traceback."""
        return (self.status == 0 or (self.status in REFUSALS and bool(self.message))) and "Traceback" not in self.text


@dataclass(frozen=True)
class Trial:
    """Trial of one command with one FMU."""

    fmu: str
    fmi: str
    command: str
    outcome: str
    text: str
    first_text: float = nan
    seconds: float = nan


def run_in_terminal(arguments: list[str], timeout: float) -> Reply:
    """Run a command of the harness in a pseudo-terminal."""
    master, slave = pty.openpty()
    environment = os.environ | {"COLUMNS": "400", "TERM": "xterm", "PYTHONPATH": str(PROJECT_ROOT)}
    begin, first_text, data, is_killed = monotonic(), inf, b"", False
    command = [sys.executable, "-m", "harness", *arguments]
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=slave, stderr=slave, env=environment, start_new_session=True
    ) as process:
        os.close(slave)
        while True:
            remaining_time = begin + timeout - monotonic()
            if remaining_time <= 0 and not is_killed:
                os.killpg(process.pid, signal.SIGKILL)
                is_killed = True
            ready, _, _ = select.select([master], [], [], max(remaining_time, 1.0))
            chunk = b""
            with suppress(OSError):  # the terminal is closed
                chunk = os.read(master, 65536) if ready else b""
            if ready and not chunk:
                break
            data += chunk
            if first_text == inf and CONTROL_SEQUENCES.sub("", data.decode(errors="replace")).strip():
                first_text = monotonic() - begin
    os.close(master)
    lines = CONTROL_SEQUENCES.sub("\n", data.decode(errors="replace")).splitlines()
    text = "\n".join(line.strip() for line in lines if line.strip() and not BAR.search(line))
    return Reply(process.returncode, monotonic() - begin, first_text, text, is_killed)


def run_trials(fmus: list[Path], out: Path, timeout: float, report: Callable[[str, float], None]) -> list[Trial]:
    """Run all commands with all FMUs and write out/external.csv; results are in one subfolder for each FMU."""
    trials: list[Trial] = []
    headings = ["fmu", "FMI", "command", "outcome", "text", "first text [s]", "time [s]"]
    out.mkdir(parents=True, exist_ok=True)
    for fmu in fmus:
        for trial in try_fmu(fmu.absolute(), out.absolute() / fmu.stem, timeout):
            trials.append(trial)
            report(fmu.stem, (COMMANDS.index(trial.command) + 1) / len(COMMANDS))
        write_csv_rows(out / "external.csv", headings, [tuple(vars(trial).values()) for trial in trials])
    return trials


def try_fmu(fmu: Path, folder: Path, timeout: float) -> Iterator[Trial]:
    """Yield the trials of an FMU."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        description = read_description(fmu, lenient=True)
    except HarnessError as error:
        yield Trial(fmu.stem, "?", "run", REFUSED, first_line(error))
        return
    fmi = description.fmiVersion
    experiment = description.defaultExperiment
    start = float((experiment and experiment.startTime) or 0.0)
    stop = "" if experiment and experiment.stopTime else str(start + DEFAULT_STOP)
    options = [*(["--stop", stop] if stop else []), "--out", str(folder)]
    reply = run_in_terminal(["run", str(fmu), *options], timeout)
    if "--lenient" in reply.message:
        options.append("--lenient")
        reply = run_in_terminal(["run", str(fmu), *options], timeout)
    remark = "with --lenient: " if "--lenient" in options else ""
    if not (folder / fmu.stem).is_dir():
        yield Trial(fmu.stem, fmi, "run", *judge_run(reply, remark + reply.message), *times_of(reply))
        return
    result = load_result(folder / fmu.stem)
    assert isinstance(result, Trajectory)
    yield Trial(fmu.stem, fmi, "run", *judge_run(reply, remark + (reply.message or result.note)), *times_of(reply))

    def compare(name: str, first: Path, *more: str) -> tuple[Reply, float]:
        """Compare the FMU with a result; return the reply and the largest relative difference, nan without one."""
        target = folder / name
        arguments = [*options, "--out", str(target), *more]
        reply = run_in_terminal(["compare", str(first), str(fmu), *arguments], timeout)
        file = next(iter(target.glob("compare/*/compare.json")), target / "none")
        variables = read_json(file).get("variables", [])
        return reply, max((variable["relative"] for variable in variables), default=nan)

    if description.coSimulation and description.modelExchange:
        reply, difference = compare("exchange", folder / fmu.stem, "--interface", "ModelExchange")
        verdict = judge_difference(reply, difference, SOLVER_RTOL, "co-simulation", INEXACT)  # it may have a large step
        yield Trial(fmu.stem, fmi, "exchange", *verdict, *times_of(reply))
    varied_parameter = simulate_by_fmpy(fmu, stop, folder, timeout)
    if (folder / "reference.csv").is_file():
        reply, difference = compare("compare", folder / "reference.csv")
        tolerance = COMPARE_RTOL if description.coSimulation else SOLVER_RTOL
        verdict = judge_difference(reply, difference, tolerance, "fmpy", FAULT)  # at the same steps
        yield Trial(fmu.stem, fmi, "compare", *verdict, *times_of(reply))
    if varied_parameter:
        name, value, other = varied_parameter
        reply = run_in_terminal(
            ["sweep", str(fmu), "--vary", f"{name}={value!r},{other!r}", "--measures", "final", *options], timeout
        )
        yield Trial(
            fmu.stem, fmi, "sweep", *judge_sweep(reply, folder, result, f"{name}={value:g},{other:g}"), *times_of(reply)
        )
        record = folder / ("record.csv" if (folder / "record.csv").is_file() else "reference.csv")
        if record.is_file():
            reply = run_in_terminal(
                [
                    "fit",
                    str(fmu),
                    str(record),
                    "--free",
                    name if value else f"{name}=-1:1",
                    "--out",
                    str(folder),
                ],
                timeout,
            )
            yield Trial(fmu.stem, fmi, "fit", *judge_fit(reply, folder, name, other, record), *times_of(reply))


def times_of(reply: Reply) -> tuple[float, float]:
    """Return the times of a trial."""
    return reply.first_text, reply.seconds


def read_json(file: Path) -> dict[str, Any]:
    """Return the content of a JSON file; empty if it does not exist."""
    return json.loads(file.read_text()) if file.is_file() else {}


def simulate_by_fmpy(fmu: Path, stop: str, folder: Path, timeout: float) -> list[Any]:
    """Write reference.csv and record.csv; return the varied parameter with both values, empty if there is none."""
    script = Path(__file__).with_name("fmpy_reference.py")
    with suppress(subprocess.TimeoutExpired):
        process = subprocess.run(
            [sys.executable, str(script), str(fmu), stop, str(folder)],
            capture_output=True,
            text=True,
            timeout=timeout,
            cwd=folder,
        )
        lines = [line for line in process.stdout.splitlines() if line.startswith("[")]
        return json.loads(lines[-1]) if lines else []
    return []


def judge_run(reply: Reply, note: str) -> tuple[str, str]:
    """Return outcome and text of a run."""
    if not reply.is_orderly:
        return reply.failed_outcome
    if reply.status:
        return REFUSED, note
    return (INEXACT if "error unknown" in note or "error about" in note else RIGHT), note


def judge_difference(reply: Reply, difference: float, tolerance: float, other: str, beyond: str) -> tuple[str, str]:
    """Return outcome and text of a comparison with the values of another program or interface.

    `beyond` is the outcome of a difference that is not allowed.
    """
    if not reply.is_orderly:
        return reply.failed_outcome
    if difference != difference:
        return REFUSED, reply.message or "no common variable"
    return (RIGHT if difference <= tolerance else beyond), f"largest difference from {other} {difference:.1e}"


def judge_sweep(reply: Reply, folder: Path, result: Trajectory, values: str) -> tuple[str, str]:
    """Return outcome and text of a sweep, whose first point is the run itself."""
    if not reply.is_orderly:
        return reply.failed_outcome
    table = next(iter(folder.glob("sweep/*/sweep.csv")), None)
    if reply.status or table is None:
        return REFUSED, f"{values}: {reply.message}"
    with table.open(encoding="utf-8", newline="") as lines:
        headings, row, *_ = csv.reader(lines)
    cells = {heading.partition(" [")[0]: cell for heading, cell in zip(headings, row, strict=True)}
    differences = []
    for name in result:
        column, value = f"final_{name}", result[name][-1]
        if column in cells and isinstance(value, np.floating):
            differences.append(abs(float(cells[column]) - value) / (abs(value) or 1.0))
    if not differences:
        return REFUSED, f"{values}: no Real output among {', '.join(headings)}"
    largest = max(differences)
    outcome = RIGHT if largest <= SWEEP_RTOL else FAULT
    return outcome, f"{values}: largest difference from run {largest:.1e}"


def judge_fit(reply: Reply, folder: Path, name: str, expected: float, record: Path) -> tuple[str, str]:
    """Return outcome and text of a fit of a record that fmpy simulated with another value of the parameter."""
    if not reply.is_orderly:
        return reply.failed_outcome
    file = next(iter(folder.glob("fit/*/fit.json")), folder / "none")
    result = read_json(file)
    if reply.status or not result:
        return REFUSED, f"{name}: {reply.message}"
    [row] = [row for row in result["fit"] if row["name"] == name]
    if name in result["undetermined"] or row["text"]:
        return (FAULT if record.stem == "record" else RIGHT), f"{name} is not determined"
    text = f"{name} = {row['value']:.7g}, simulated with {expected:.7g}"
    close = row["value"] is not None and abs(row["value"] - expected) <= FIT_RTOL * abs(expected)
    return (RIGHT if close else FAULT), text


def make_table(trials: list[Trial]) -> Table:
    """Return the table of the outcomes: a row for each FMU, a column for each command."""
    table = Table("FMU", "FMI", *COMMANDS, "first text [s]", box=None)
    for fmu in dict.fromkeys(trial.fmu for trial in trials):
        row = {trial.command: trial for trial in trials if trial.fmu == fmu}
        latest = max((trial.first_text for trial in row.values() if trial.first_text == trial.first_text), default=nan)
        cells = [row[command].outcome if command in row else "-" for command in COMMANDS]
        table.add_row(fmu, next(iter(row.values())).fmi, *cells, f"{latest:.1f}")
    return table
