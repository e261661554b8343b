"""How often the 95 % intervals of an identified decay hold the truth: `python tests/intervals.py [RECORDS]`.

One row for each law, of masses and of pendulums, with white noise and with quantised samples; then the records that
are wrong by more than five standard errors without a remark, of which there must be none.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from decays import random_record

from harness.analyses.decay.figures import Known
from harness.analyses.decay.fit import identify
from harness.analyses.decay.law import LAWS
from harness.errors import HarnessError

NAMES = ("omega", "zeta", "r", "b", "rest")
SAMPLES = 600
FAR = 5.0  # standard errors
CASES = tuple(product(LAWS, (False, True), (False, True)))


def judged(case):
    """Of the record of a seed and a case: which intervals hold the truth, and whether it is wrong without a word."""
    seed, (law, sine, quantised) = case
    record, truth, _ = random_record(seed, law, sine, quantised, SAMPLES)
    try:
        found = identify(record, Known(pendulum=sine))
    except HarnessError as refusal:
        return [], str(refusal)
    each = {one.name: one for one in found.estimates}
    off = max(abs(each[name].value - truth[name]) / each[name].error for name in NAMES)
    wrong = f"off by {off:.1f} errors" if off > FAR and not found.remarks else ""
    return [each[name].low <= truth[name] <= each[name].high for name in NAMES], wrong


def coverage(records, workers=1):
    """For each case: the shares of `records` records whose intervals hold the truth, by name; and what went wrong."""
    with ProcessPoolExecutor(workers) as pool:
        for case in CASES:
            rows = list(pool.map(judged, ((seed, case) for seed in range(records)), chunksize=4))
            shares = np.mean([held for held, _ in rows if held], axis=0)
            yield case, shares, [f"seed {seed}: {text}" for seed, (_, text) in enumerate(rows) if text]


if __name__ == "__main__":
    print(f"{'law':12} {'kind':9} {'noise':10}", *(f"{name:>6}" for name in (*NAMES, "all")))
    table = []
    for (law, sine, quantised), shares, wrong in coverage(int((sys.argv[1:] or [1000])[0]), 2):
        kind, noise = "pendulum" if sine else "mass", "quantised" if quantised else "white"
        row = (f"{share:6.3f}" for share in (*shares, shares.mean()))
        print(f"{'+'.join(law):12} {kind:9} {noise:10}", *row, *wrong, flush=True)
        table.append(shares)
    print(f"{'all':33}", *(f"{share:6.3f}" for share in (*np.mean(table, axis=0), np.mean(table))))
