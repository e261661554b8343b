"""Judge the results of a simulation tool: `python check.py RESULTS [CASE...]`, in the folder of the suite; needs numpy.

RESULTS has a file CASE_out.csv for each case: the column `time` in s, and the columns of CASE_ref.csv, at its times.
Other rows and columns are ignored; of rows with one time, the last counts. The row of the start may be missing.

motion   the largest error of a state, relative to its largest value, is within the tolerance of the case
events   `mode` is that of the certified events at each time, but for a millionth of the run around an event
rest     while the certified body is at rest, its states do not change

The exit status is 1 if a case fails.
"""

import csv
import json
import sys
from pathlib import Path

import numpy as np

EVENT_TOLERANCE = 1e-6  # of the run, around an event
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
    missing = (rows < 0) | (np.abs(time[rows] - points) > tolerance)
    if missing.any():
        raise ValueError(f"{missing.sum()} of {len(points)} times are missing, the first is {points[missing][0]!r} s")
    return np.asarray(rows)


def check_case(folder: Path, results: Path, name: str, tolerance: float) -> tuple[str, str, str]:
    """Return the verdicts on motion, events and rest; a verdict that begins with a minus sign is a failure."""
    file = results / f"{name}_out.csv"
    if not file.is_file():
        return ("- no result", "", "")
    reference, result = read_columns(folder / name / f"{name}_ref.csv"), read_columns(file)
    states = [column for column in reference if column not in ("time", "mode")]
    if lacking := [column for column in ("time", *states) if column not in result]:
        return (f"- {', '.join(lacking)} missing", "", "")
    if result["time"].min() > reference["time"][0] + 1e-6 * (reference["time"][1] - reference["time"][0]):
        reference = {column: values[1:] for column, values in reference.items()}  # some tools record no start
    time = reference["time"]
    try:
        rows = find_rows(result["time"], time)
    except ValueError as error:
        return (f"- {error}", "", "")
    sizes = {column: np.abs(reference[column]).max() or 1.0 for column in states}
    largest = max(np.max(np.abs(result[column][rows] - reference[column])) / sizes[column] for column in states)
    motion = f"{'' if largest <= tolerance else '- '}{largest:.0e}"
    if "mode" not in reference:
        return (motion, "", "")
    if "mode" not in result:
        return (motion, "- mode missing", "")
    with (folder / name / f"{name}_events.csv").open(newline="", encoding="utf-8") as lines:
        events = np.array([float(row["time"]) for row in csv.DictReader(lines)])
    distance = np.abs(time[:, None] - events[None, :]).min(axis=1) if len(events) else np.full(len(time), np.inf)
    is_wrong = (result["mode"][rows] != reference["mode"]) & (distance > EVENT_TOLERANCE * (time[-1] - time[0]))
    first = time[is_wrong][0] if is_wrong.any() else 0.0
    verdict = f"- {is_wrong.sum()} modes, from {first:.6g} s" if is_wrong.any() else f"{len(events)}"
    at_rest = np.all([reference[column][1:] == reference[column][:-1] for column in states], axis=0)
    changes = [np.abs(np.diff(result[column][rows]))[at_rest] / sizes[column] for column in states]
    creep = max((change.max() for change in changes if change.size), default=0.0)
    rest = "" if not at_rest.any() else f"- moves by {creep:.0e}" if not creep <= REST_TOLERANCE else "at rest"
    return (motion, verdict, rest)


def main(arguments: list[str]) -> int:
    """Print a line for each case, or those named; return the exit status."""
    folder = Path(__file__).resolve().parent
    cases = json.loads((folder / "cases.json").read_text(encoding="utf-8"))
    results, *names = arguments or [""]
    if not Path(results).is_dir() or not cases.keys() >= set(names):
        print(f"Usage: python check.py RESULTS [CASE...]; cases: {', '.join(cases)}", file=sys.stderr)
        return 2
    failed = 0
    print(f"{'case':14} {'verdict':7} {'motion':10} {'events':28} rest")
    for name in names or cases:
        verdicts = check_case(folder, Path(results), name, cases[name]["tolerance"])
        has_failed = any(verdict.startswith("-") for verdict in verdicts)
        failed += has_failed
        motion, events, rest = verdicts
        print(f"{name:14} {'FAILED' if has_failed else 'passed':7} {motion:10} {events:28} {rest}".rstrip())
    print(f"{failed} of {len(names or cases)} cases failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
