"""Judge the results of a simulation tool: `python check.py RESULTS [CASE...]`, in the folder of the suite; needs numpy.

RESULTS has a file CASE_out.csv for each case: the column `time` in s, and the columns of CASE_ref.csv, at its times.
Other rows and columns are ignored; of rows with one time, the last counts. The row of the start may be missing.

motion   the largest error of a state, relative to its largest value, is within the tolerance of the case
outputs  that of each other output that RESULTS has is within ten times the tolerance, since some outputs magnify the
         errors of states, but for a millionth of the run around an event or a jump of the input
events   `mode` is that of the certified events at each time, but for a millionth of the run around an event
rest     while the certified body is at rest, its states do not change

The exit status is 1 if a case fails.
"""

import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

EVENT_TOLERANCE = 1e-6  # of the run, around an event
OUTPUT_FACTOR = 10.0  # by which errors of outputs other than states may exceed the tolerance
REST_TOLERANCE = 1e-12  # of the largest value of a state


def read_columns(file: Path) -> dict[str, np.ndarray]:
    """Return the columns (n,) of a CSV file by name without unit."""
    with file.open(newline="", encoding="utf-8") as lines:
        headings, *rows = csv.reader(lines)
    names = [heading.strip().strip('"').partition(" ")[0] for heading in headings]
    return dict(zip(names, np.array(rows, dtype=float).reshape(len(rows), len(names)).T, strict=True))


def find_rows(time: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the last row of each point (n,) in s; ValueError if one is missing."""
    tolerance = 1e-6 * (points[1] - points[0])
    rows = np.searchsorted(time, points + tolerance, side="right") - 1
    is_missing = (rows < 0) | (np.abs(time[rows] - points) > tolerance)
    if is_missing.any():
        raise ValueError(
            f"{is_missing.sum()} of {len(points)} times are missing, the first is {points[is_missing][0]!r} s"
        )
    return np.asarray(rows)


def read_times(file: Path) -> np.ndarray:
    """Return the column `time` (n,) of a CSV file in s; empty without the file or without rows."""
    if not file.is_file():
        return np.empty(0)
    with file.open(newline="", encoding="utf-8") as lines:
        return np.array([float(row["time"]) for row in csv.DictReader(lines)])


def is_apart(points: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return whether each point (n,) in s is apart from all times."""
    distance = np.abs(points[:, None] - times[None, :]).min(axis=1, initial=np.inf)
    return np.asarray(distance > EVENT_TOLERANCE * (points[-1] - points[0]))


def check_case(folder: Path, results: Path, name: str, case: dict[str, Any]) -> dict[str, str]:
    """Return the verdicts by their names; one that begins with a minus sign is a failure."""
    file = results / f"{name}_out.csv"
    if not file.is_file():
        return {"motion": "- no result"}
    reference, result = read_columns(folder / name / f"{name}_ref.csv"), read_columns(file)
    states, tolerance = case["states"], case["tolerance"]
    if missing_columns := [column for column in ("time", *states) if column not in result]:
        return {"motion": f"- {', '.join(missing_columns)} missing"}
    if result["time"].min() > reference["time"][0] + 1e-6 * (reference["time"][1] - reference["time"][0]):
        reference = {column: values[1:] for column, values in reference.items()}  # some tools record no start
    time = reference["time"]
    try:
        rows = find_rows(result["time"], time)
    except ValueError as error:
        return {"motion": f"- {error}"}
    sizes = {column: np.abs(values).max() or 1.0 for column, values in reference.items()}
    errors = {
        column: np.abs(result[column][rows] - reference[column]) / sizes[column]
        for column in reference
        if column in result
    }
    largest = max(errors[column].max() for column in states)
    verdicts = {"motion": f"{'' if largest <= tolerance else '- '}{largest:.0e}"}
    events, inputs = (read_times(folder / name / f"{name}_{kind}.csv") for kind in ("events", "in"))
    is_between = is_apart(time, events)
    is_continuous = is_between & is_apart(time, inputs)
    others = [column for column in errors if column not in ("time", "mode", *states)]
    wrong = [column for column in others if not errors[column][is_continuous].max() <= OUTPUT_FACTOR * tolerance]
    verdicts["outputs"] = f"- {', '.join(wrong)}" if wrong else f"{len(others)}"
    if "mode" not in reference:
        return verdicts
    if "mode" not in result:
        return verdicts | {"events": "- mode missing"}
    is_wrong = (result["mode"][rows] != reference["mode"]) & is_between
    first = time[is_wrong][0] if is_wrong.any() else 0.0
    verdicts["events"] = f"- {is_wrong.sum()} modes, from {first:.6g} s" if is_wrong.any() else f"{len(events)}"
    at_rest = np.all([reference[column][1:] == reference[column][:-1] for column in states], axis=0)
    changes = [np.abs(np.diff(result[column][rows]))[at_rest] / sizes[column] for column in states]
    creep = max((change.max() for change in changes if change.size), default=0.0)
    if at_rest.any():
        verdicts["rest"] = "at rest" if creep <= REST_TOLERANCE else f"- moves by {creep:.0e}"
    return verdicts


def main(arguments: list[str]) -> int:
    """Print a line for each case, or those named; return the exit status."""
    folder = Path(__file__).resolve().parent
    cases = json.loads((folder / "cases.json").read_text(encoding="utf-8"))
    results, *names = arguments or [""]
    if not Path(results).is_dir() or not cases.keys() >= set(names):
        print(f"Usage: python check.py RESULTS [CASE...]; cases: {', '.join(cases)}", file=sys.stderr)
        return 2
    n_failed = 0
    print(f"{'case':14} {'verdict':7} {'motion':10} {'outputs':10} {'events':28} rest")
    for name in names or cases:
        verdicts = check_case(folder, Path(results), name, cases[name])
        has_failed = any(verdict.startswith("-") for verdict in verdicts.values())
        n_failed += has_failed
        motion, outputs, events, rest = (verdicts.get(key, "") for key in ("motion", "outputs", "events", "rest"))
        verdict = "FAILED" if has_failed else "passed"
        print(f"{name:14} {verdict:7} {motion:10} {outputs:10} {events:28} {rest}".rstrip())
    print(f"{n_failed} of {len(names or cases)} cases failed")
    return int(n_failed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
