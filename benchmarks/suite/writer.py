"""Writes the suite: a folder for each case, its index cases.json, and check.py.

CASE/fmi2/MODEL.fmu, CASE/fmi3/MODEL.fmu    native FMUs, co-simulation and model exchange; they contain the files below
                        as related files of the layered standard FMI-LS-REF
CASE/CASE_ref.opt       start, stop, communication step and tolerance, as in the FMI cross-check
CASE/CASE_start.csv     start values other than those of the FMU: name, value
CASE/CASE_in.csv        input, with two rows at a jump; only of some cases
CASE/CASE_ref.csv       certified states and mode, and the other outputs, after the events of each time
CASE/CASE_events.csv    certified events: time, contact, mode before and after
CASE/README.md          what the case catches
"""

import csv
import json
import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from xml.etree.ElementTree import SubElement, fromstring, register_namespace
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np

from fmus.compiler.text_output import xml_bytes
from fmus.packaging.certified_result import NAMESPACE, RESULT_FOLDER
from harness import simulate
from harness.errors import HarnessError
from harness.process.subprocess_runner import run_module
from harness.references.certified_reference import relative_errors
from harness.simulation.solution import Solution

from .cases import SuiteCase, modes_at

RELATIVE_TOLERANCE = 1e-10  # requested from the solver, of the FMU or of the tool
OUTPUT_TOLERANCE = 1e-12  # of the run whose outputs are written
AGREEMENT = 0.1  # of the tolerance of a case, to which the states of this run agree with the certified ones
ROLES = {  # in FMI-LS-REF, by the ends of the names
    "ref.opt": ("experiment/validation", "Start, stop, communication step and tolerance"),
    "start.csv": ("parameter", "Start values other than those of the FMU"),
    "in.csv": ("experiment/validation", "Input; a time that occurs twice is a jump"),
    "ref.csv": ("result", "Certified states and mode, and the other outputs"),
    "events.csv": ("result", "Certified events"),
}


def write_suite(
    cases: Sequence[SuiteCase], folder: Path, platforms: Sequence[str], report: Callable[[float], None]
) -> None:
    """Build the FMUs of the cases, and write all files to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    build = folder / "fmus"
    models = [str(file) for file in dict.fromkeys(case.model_file for case in cases)]
    options = [word for platform in platforms for word in ("--platform", platform)]
    for number, version in enumerate(("2", "3"), 1):
        process = run_module(
            "build_fmus", *models, "--native", "--fmi", version, *options, "--out", str(build / f"fmi{version}")
        )
        if process.returncode:
            raise HarnessError(f"the FMUs cannot be built: {(process.stderr.splitlines() or ['?'])[-1]}")
        report(0.4 * number)
    for number, case in enumerate(cases, 1):
        write_case(case, folder / case.name, build)
        report(0.8 + 0.2 * number / len(cases))
    shutil.rmtree(build)
    index = {
        case.name: {
            "model": case.model,
            "states": list(case.states),
            "tolerance": case.tolerance,
            "catches": case.catches,
        }
        for case in cases
    }
    (folder / "cases.json").write_text(json.dumps(index, indent=2) + "\n", encoding="utf-8")
    shutil.copy(Path(__file__).with_name("check.py"), folder)


def write_case(case: SuiteCase, folder: Path, fmus: Path) -> None:
    """Write the files of a case; `fmus` has the folders fmi2 and fmi3."""
    file = f"{case.model}.fmu"
    folder.mkdir(parents=True, exist_ok=True)
    solution = case.solve(fmus / "fmi2" / file)
    modes = modes_at(solution, solution.times)
    columns = {"time": solution.times, **dict(zip(case.states, solution.states.T, strict=True))}
    columns |= {} if modes is None else {"mode": modes}
    columns |= other_outputs(case, fmus / "fmi2" / file, solution)
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    write_rows(folder / f"{case.name}_ref.csv", list(columns), rows)
    if modes is not None:
        events = solution.events or []
        before = [solution.start_mode, *(mode for _, mode in events)]
        changes = [(t, "mode", old, new) for (t, new), old in zip(events, before, strict=False)]
        write_rows(folder / f"{case.name}_events.csv", ["time", "contact", "from", "to"], changes)
    write_rows(folder / f"{case.name}_start.csv", ["name", "value"], case.values.items())
    if case.changes:
        write_rows(folder / f"{case.name}_in.csv", ["time", "F_ext"], input_rows(case))
    start, stop = float(solution.times[0]), float(solution.times[-1])
    step = (stop - start) / (len(np.unique(solution.times)) - 1)
    options = {"StartTime": start, "StopTime": stop, "StepSize": step, "RelTol": RELATIVE_TOLERANCE}
    write_rows(folder / f"{case.name}_ref.opt", [], options.items())
    (folder / "README.md").write_text(f"# {case.name}\n\n{case.catches}\n", encoding="utf-8")
    related_files = [path for ending in ROLES if (path := folder / f"{case.name}_{ending}").is_file()]
    for version in ("fmi2", "fmi3"):
        (folder / version).mkdir(exist_ok=True)
        embed_files(case, fmus / version / file, folder / version / file, related_files)


def embed_files(case: SuiteCase, source: Path, target: Path, related_files: Sequence[Path]) -> None:
    """Copy an FMU, and add the files of a case beside the certified result of its default run."""
    manifest = f"{RESULT_FOLDER}/fmi-ls-manifest.xml"
    register_namespace("fmi-ls", NAMESPACE)
    with ZipFile(source) as old:
        content = {item: old.read(item) for item in old.infolist() if item.filename != manifest}
        root = fromstring(old.read(manifest))
    for path in related_files:
        ending = path.name.removeprefix(f"{case.name}_")
        role, text = ROLES[ending]
        SubElement(root, "Related", {"source": path.name, "role": role, "type": "text/csv", "description": text})
    with ZipFile(target, "w", ZIP_DEFLATED) as new:
        for item, data in content.items():
            new.writestr(item, data)
        for path in related_files:
            new.write(path, f"{RESULT_FOLDER}/{path.name}")
        new.writestr(manifest, xml_bytes(root))


def other_outputs(case: SuiteCase, fmu: Path, solution: Solution) -> dict[str, np.ndarray]:
    """Return the outputs (n,) that are neither states nor modes, from a run whose states agree with the certified ones.

    Raises
    ------
    HarnessError
        If they do not agree.
    """
    inputs = None
    if case.changes:
        time, force = zip(*input_rows(case), strict=True)
        inputs = {"time": time, "F_ext": force}
    start = float(solution.times[0])
    run = simulate(fmu, case.values, start=start, times=solution.times, inputs=inputs, rtol=OUTPUT_TOLERANCE)
    states = np.column_stack([run[name] for name in case.states])
    error = relative_errors(states, solution.states).max()
    if not error <= AGREEMENT * case.tolerance:
        raise HarnessError(f"{case.name}: the FMU differs from the certified states by {error:.1e}")
    return {name: run[name] for name in run.columns if name not in case.states and not name.startswith("mode")}


def input_rows(case: SuiteCase) -> list[tuple[float, float]]:
    """Return the times in s and the values of the input, with two rows at a jump."""
    rows: list[tuple[float, float]] = []
    for t, value in case.changes.items():
        rows += [(t, rows[-1][1])] if rows else []
        rows.append((t, value))
    assert case.stop is not None
    return [*rows, (case.stop, rows[-1][1])]


def write_rows(file: Path, headings: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a CSV file, whose numbers are read as the same doubles."""
    with file.open("w", newline="", encoding="utf-8") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerows([headings] if headings else [])
        writer.writerows(rows)
