"""Fit drawn records and print what was found.

    python -m benchmarks.campaigns.fit_campaign --seed 7 --records 400 --log FILE

"Found": all values within five standard errors of the truth, where the record determines them; "partly": it does not
determine all. "Silent": not found, and without a remark. "Inputs": a remark that the inputs are uncertain between their
samples. Coverage: share of the finite 95 % intervals that hold the truth, with its standard error. The exit
status is 1 if a fit with the right law is silent.
"""

import argparse
import json
import os
import sys
from math import isfinite
from pathlib import Path

import numpy as np
from spec_runs import ignore_progress

from harness.errors import HarnessError
from harness.process.subprocess_runner import run_module
from harness.process.temporary_directory import temporary_directory
from harness.records.record import Record
from harness.records.table_files import Table
from harness.scenes.run_spec import RunSpec
from harness.simulation.whole_run import open_simulator
from harness.studies.fit.request import FitRequest, make_task
from harness.studies.fit.study import fit_samples

from .drawn_records import GROUPS, draw_record

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "tests" / "example_models"
SOURCES = {
    "stribeck_sled": EXAMPLES / "fit" / "stribeck_sled.py",
    "belt": EXAMPLES / "fit" / "belt.py",
    "sleds": EXAMPLES / "fit" / "sleds.py",
}


def build_fmus(folder):
    """Build the native FMUs of all groups for this platform and return the folder."""
    models = sorted({group.model for group in GROUPS.values()})
    sources = [str(SOURCES.get(model, model)) for model in models]
    process = run_module("build_fmus", *sources, "--native", "--platform", "linux64", "--out", str(folder))
    if process.returncode:
        raise RuntimeError(process.stderr)
    return folder


def cpu_seconds():
    """Return the processor time of this process and its children."""
    return sum(os.times()[:4])


def fit_drawn_record(group, seed, fmus):
    """Draw a record and fit it; return the record and the fit, or the reason why it was refused."""
    random = np.random.default_rng(seed)
    with open_simulator(RunSpec(fmus / f"{group.record_of or group.model}.fmu")) as simulator:
        record = draw_record(group, simulator, random)
    columns = dict(zip(group.outputs, record.y.T, strict=True)) | record.inputs
    table = Table("record", ("t [s]", *columns), (record.t, *columns.values()))
    observe, inputs = {name: name for name in group.outputs}, {name: name for name in record.inputs}
    fmu = fmus / f"{group.model}.fmu"
    run = RunSpec(fmu, values=record.fixed_values, timeout=10.0)
    request = FitRequest(run, record.free, observe, inputs)
    task = make_task(request)
    try:
        samples = Record("record", table).signals(task.sources)
        return record, fit_samples(task, [samples], ignore_progress)
    except HarnessError as error:
        return record, str(error)


def summarize(record, fit, seconds):
    """Return what matters of a fit as plain data."""
    row = {"noise": record.noise, "truth": record.truth, "seconds": seconds}
    if isinstance(fit, str):
        return row | {"refused": fit}
    estimates = {estimate.name: estimate for estimate in fit.estimates if estimate.name in record.truth}
    return row | {
        "runs": fit.n_runs,
        "searches": fit.n_searches,
        "remarks": list(fit.remarks),
        "values": {name: estimate.value for name, estimate in estimates.items()},
        "errors": {name: estimate.error for name, estimate in estimates.items()},
        "deviation": {
            name: abs(estimate.value - record.truth[name]) / estimate.error if estimate.error else np.inf
            for name, estimate in estimates.items()
        },
        "covered": {
            name: estimate.low <= record.truth[name] <= estimate.high
            for name, estimate in estimates.items()
            if isfinite(estimate.low) and isfinite(estimate.high)
        },
        "half_width": {
            name: (estimate.high - estimate.low) / 2 / abs(record.truth[name]) for name, estimate in estimates.items()
        },
        "combinations": [combination.name for combination in fit.combinations],
        "describes_record": fit.describes_record,
    }


def is_found(row):
    """Return whether all determined values are within five standard errors."""
    return all(not deviation > 5 for deviation in row["deviation"].values()) and row["describes_record"]


def print_summary(rows):
    """Print a line for each group and noise."""
    groups = [*dict.fromkeys(row["group"] for row in rows)]
    lines = [(group, [row for row in rows if row["group"] == group]) for group in groups]
    right = [row for row in rows if row["group"] != "wrong law"]
    lines += [
        (kind, [row for row in right if row["noise"].startswith(kind)]) for kind in ("white", "coloured", "quantised")
    ]
    lines.append(("all with the right law", right))
    print(f"{'':23}records refused partly found    silent remarked inputs coverage             CPU median worst s")
    for name, part in lines:
        if not part:
            continue
        fits = [row for row in part if "refused" not in row]
        partial_rows = [row for row in fits if not all(map(isfinite, row["errors"].values()))]
        found_rows = [row for row in fits if is_found(row)]
        silent_rows = [row for row in fits if not is_found(row) and not row["remarks"]]
        remarked_rows = [row for row in fits if row["remarks"]]
        inputs = [row for row in remarked_rows if any(remark.startswith("The inputs") for remark in row["remarks"])]
        seconds = [row["seconds"] for row in part]
        print(
            f"{name:23}{len(part):7} {len(part) - len(fits):7} {len(partial_rows):6} {len(found_rows):4}/{len(fits):<4}"
            f"{len(silent_rows):6} {len(remarked_rows):8} {len(inputs):6} {coverage(fits):23}{np.median(seconds):7.2f} "
            f"{max(seconds):7.2f}"
        )


def coverage(rows):
    """Return the share of intervals that hold the truth; its standard error is that of a ratio of sums over records."""
    counts = np.array([len(row["covered"]) for row in rows])
    held_counts = np.array([sum(row["covered"].values()) for row in rows])
    if not counts.sum():
        return ""
    share = held_counts.sum() / counts.sum()
    error = np.sqrt(np.sum((held_counts - share * counts) ** 2)) / counts.sum()
    return f"{100 * share:5.1f} +- {100 * error:3.1f} % of {counts.sum():4}"


def main():
    """Run a campaign, or summarize the logs of earlier ones."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--records", type=int, default=11, help="number of records, over all groups")
    options.add_argument("--group", action="append", choices=[*GROUPS], help="only this group; repeatable")
    options.add_argument("--log", type=Path, help="file for the results; a campaign continues from there")
    options.add_argument("--fmus", type=Path, help="folder of native FMUs that exist already")
    options.add_argument("--summary", action="store_true", help="only print the summary of the log")
    arguments = options.parse_args()
    rows = json.loads(arguments.log.read_text()) if arguments.log and arguments.log.exists() else []
    if arguments.summary:
        print_summary(rows)
        return
    groups = arguments.group or [*GROUPS]
    with temporary_directory("campaign-") as folder:
        fmus = arguments.fmus or build_fmus(folder)
        finished_records = {(row["group"], row["seed"]) for row in rows}
        for n in range(arguments.records):
            name, number = groups[n % len(groups)], n // len(groups)
            seed = [arguments.seed, [*GROUPS].index(name), number]
            if (name, str(seed)) in finished_records:
                continue
            start = cpu_seconds()
            record, fit = fit_drawn_record(GROUPS[name], seed, fmus)
            row = summarize(record, fit, cpu_seconds() - start)
            rows.append({"group": name, "seed": str(seed)} | row)
            bad = "" if "refused" in row or is_found(row) else "NOT FOUND"
            missed_parameters = [
                parameter for parameter, is_covered in row.get("covered", {}).items() if not is_covered
            ]
            print(name, number, row["noise"], f"{row['seconds']:.1f} s", bad, missed_parameters or "", flush=True)
            if arguments.log:
                arguments.log.write_text(json.dumps(rows))
    print_summary(rows)
    fitted_rows = [row for row in rows if row["group"] != "wrong law" and "refused" not in row]
    sys.exit(any(not is_found(row) and not row["remarks"] for row in fitted_rows))


if __name__ == "__main__":
    main()
