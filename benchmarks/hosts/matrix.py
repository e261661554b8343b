"""Runs of all kinds of FMUs in all hosts, and their table."""

import json
import re
import subprocess
import venv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path

import numpy as np
from rich.table import Table

from harness.errors import HarnessError
from harness.process.subprocess_runner import PROJECT_ROOT, run_module
from harness.process.temporary_directory import temporary_directory
from harness.results.files import write_csv_rows

MODELS = ("smd", "coulomb", "stickslip", "pacejka", "pendulum")
TIMEOUT = 900.0  # s, for the runs of one kind of FMUs
KINDS = {  # options of the build
    "Python": (),
    "native": ("--native", "--platform", "linux64"),
    "Python, Reals only": ("--real-only",),
    "native, Reals only": ("--real-only", "--native", "--platform", "linux64"),
}


@dataclass(frozen=True)
class Host:
    """Host in an environment of its own.

    Attributes
    ----------
    package : str
        Package with its version, as pip takes it.
    script : str
        Script of this folder that runs an FMU.
    first : int
        Communication point of the first value: 1 if the host does not record the start.
    """

    package: str
    script: str
    first: int = 0


HOSTS = (
    Host("gemseo-fmu==3.1.1", "gemseo_fmu_host.py"),
    Host("cofmupy==1.0.0", "cofmupy_host.py", first=1),
    Host("pathsim-fmi==0.1.1", "pathsim_fmi_host.py", first=1),
)


@dataclass(frozen=True)
class HostRun:
    """Run of an FMU in a host: its largest error relative to the largest value, or the text of the failure."""

    host: str
    fmpy: str
    kind: str
    model: str
    error: float
    failure: str = ""


def run_matrix(environments: Path, out: Path, report: Callable[[str, float], None]) -> list[HostRun]:
    """Install the hosts, run all FMUs in them, and write out/hosts.csv."""
    runs: list[HostRun] = []
    with temporary_directory("hosts-") as folder:
        for i, (kind, options) in enumerate(KINDS.items()):
            process = run_module("build_fmus", *MODELS, *options, "--out", str(folder / str(i)))
            if process.returncode:
                raise HarnessError(f"the FMUs ({kind}) could not be built: {process.stderr.strip()}")
        for host in HOSTS:
            python = install(host, environments)
            fmpy = read_version(python, "fmpy")
            for i, kind in enumerate(KINDS):
                results = run_models(python, host, folder / str(i))
                runs += [HostRun(host.package, fmpy, kind, *result) for result in results]
                report(host.package, (i + 1) / len(KINDS))
    out.mkdir(parents=True, exist_ok=True)
    rows = [tuple(vars(run).values()) for run in runs]
    write_csv_rows(out / "hosts.csv", ["host", "fmpy", "kind", "model", "largest error", "failure"], rows)
    return runs


def install(host: Host, environments: Path) -> Path:
    """Return the Python of the environment of a host; create it and install the host if that has not been done."""
    folder = environments / host.package
    python = folder / "bin" / "python"
    if not (folder / "installed").is_file():
        venv.create(folder, with_pip=True, clear=True)
        process = subprocess.run([python, "-m", "pip", "install", "-q", host.package], capture_output=True, text=True)
        if process.returncode:
            raise HarnessError(f"{host.package} could not be installed: {process.stderr.strip().splitlines()[-1]}")
        (folder / "installed").touch()
    return python


def read_version(python: Path, package: str) -> str:
    """Return the version of a package in an environment."""
    code = f"import importlib.metadata; print(importlib.metadata.version({package!r}))"
    return subprocess.run([python, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def run_models(python: Path, host: Host, folder: Path) -> Iterator[tuple[str, float, str]]:
    """Yield the name of each model with its largest error, or with the text of its failure."""
    references = {model: read_certified(model) for model in MODELS}
    requests = [
        (str(folder / f"{model}.fmu"), (time[-1] - time[0]) / (len(time) - 1), time[-1], name)
        for model, (time, _, name) in references.items()
    ]
    command = [str(python), str(Path(__file__).with_name(host.script)), json.dumps(requests)]
    try:
        process = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        raise HarnessError(f"{host.package} does not end within {TIMEOUT:g} s") from None
    replies = [json.loads(line) for line in process.stdout.splitlines() if line.startswith("[[")]
    replies += [([], "no reply")] * (len(MODELS) - len(replies))
    messages = re.split("^---$", process.stderr, flags=re.M)[1:] + [""] * len(MODELS)
    for model, (values, failure), text in zip(MODELS, replies, messages, strict=False):
        yield (model, *judge(values, references[model][1][host.first :], failure, text))


def judge(values: list[float], expected: np.ndarray, failure: str, messages: str) -> tuple[float, str]:
    """Return the largest error relative to the largest expected value, or the text of the failure."""
    lines = messages.strip().splitlines()
    if failure:
        return nan, failure
    count = min(len(values), len(expected))
    if count < len(expected) - 1:  # cofmupy may end a step earlier, by rounding of the time
        return nan, f"{count} of {len(expected)} values, the last one {values[-1]}; {lines[0] if lines else ''}"
    if not all(map(isfinite, values)):
        return nan, f"values that are no numbers; {lines[0] if lines else ''}"
    return float(np.abs(np.array(values[:count]) - expected[:count]).max() / np.abs(expected).max()), ""


def read_certified(model: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Return times (n,) in s, values (n,) and name of the first output in the certified result of a model."""
    lines = (PROJECT_ROOT / "fmus" / f"{model}.csv").read_text().splitlines()
    heading, *rows = [line for line in lines if not line.startswith("#")]
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    return table[:, 0], table[:, 1], heading.split(",")[1].split(" [")[0]


def make_table(runs: list[HostRun]) -> Table:
    """Return the table of errors: a row for each host and kind, a column for each model."""
    table = Table("host", "fmpy", "kind", *MODELS, box=None)
    for host in HOSTS:
        for kind in KINDS:
            row = [run for run in runs if (run.host, run.kind) == (host.package, kind)]
            cells = ["-" if run.failure else f"{run.error:.1e}" for run in row]
            table.add_row(host.package, row[0].fmpy, kind, *cells)
    return table


def failure_lines(runs: list[HostRun]) -> Iterator[str]:
    """Yield the texts of the failures of each host and kind, those of the first model that fails."""
    for host in HOSTS:
        for kind in KINDS:
            failed_runs = [run for run in runs if (run.host, run.kind) == (host.package, kind) and run.failure]
            if failed_runs:
                yield f"{host.package}, {kind}: {failed_runs[0].failure}"
