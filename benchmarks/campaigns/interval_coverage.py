"""Coverage of the 95 % intervals of identified decays: `python -m benchmarks.campaigns.interval_coverage [RECORDS]`.

RECORDS are simulated for each law, for masses and pendulums, with white noise and quantised samples, and for velocities
and accelerations. Then the records that are wrong by more than five standard errors without a remark are listed; there
must be none, or the exit status is 1. The coverage of n records has a standard deviation of sqrt(0.95 0.05/n). Ctrl-C
prints the results so far.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from itertools import product

import numpy as np
from decays import LAWS, identify, random_record

from harness import HarnessError

QUANTITIES = ("position", "velocity", "acceleration")
NAMES = ("omega", "zeta", "r", "b", "rest")
SAMPLES = 600
FAR = 5.0  # standard errors
POSITIONS = tuple(product(LAWS, (False, True), (False, True), (0,)))
RATES = tuple(product(LAWS, (False, True), (False,), (1, 2)))
CASES = POSITIONS + RATES


def check_record(number):
    """Fit the record of this number; return which intervals cover the true values, and a description of any failure."""
    law, sine, is_quantised, order = CASES[number % len(CASES)]
    record, truth, _ = random_record(number, law, sine, is_quantised, SAMPLES, order)
    try:
        fit = identify(record, pendulum=sine)
    except HarnessError as refusal:
        return [], str(refusal)
    by_name = {estimate.name: estimate for estimate in fit.estimates}
    off = max(abs(by_name[name].value - truth[name]) / by_name[name].error for name in NAMES)
    wrong = f"off by {off:.1f} errors" if off > FAR and not fit.remarks else ""
    return [by_name[name].low <= truth[name] <= by_name[name].high for name in NAMES], wrong


def table_lines(rows):
    """Yield the table of the checked records, in the order of their numbers."""
    yield f"{'law':12} {'kind':9} {'quantity':13} {'noise':10} {'records':>7} " + " ".join(
        f"{name:>6}" for name in (*NAMES, "all")
    )
    for i, (law, sine, is_quantised, order) in enumerate(CASES):
        coverage = [coverage for coverage, _ in rows[i :: len(CASES)] if coverage]
        kind, noise = "pendulum" if sine else "mass", "quantised" if is_quantised else "white"
        shares = np.mean(coverage, axis=0) if coverage else np.full(len(NAMES), np.nan)
        yield f"{'+'.join(law):12} {kind:9} {QUANTITIES[order]:13} {noise:10} {len(coverage):7} " + " ".join(
            f"{share:6.3f}" for share in (*shares, shares.mean())
        )
    coverage = [coverage for coverage, _ in rows if coverage]
    yield f"{'all':47} {len(coverage):7} " + " ".join(
        f"{share:6.3f}" for share in (*np.mean(coverage, 0), np.mean(coverage))
    )
    yield from (f"record {number}: {text}" for number, (_, text) in enumerate(rows) if text)


if __name__ == "__main__":
    rows = []
    with suppress(KeyboardInterrupt), ProcessPoolExecutor(2) as pool:
        for row in pool.map(check_record, range(int((sys.argv[1:] or [100])[0]) * len(CASES)), chunksize=8):
            rows.append(row)
    print(*table_lines(rows), sep="\n")
    sys.exit(any(text.startswith("off by") for _, text in rows))
