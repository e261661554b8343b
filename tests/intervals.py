"""How often the 95 % intervals of an identified decay hold the truth: `python tests/intervals.py [RECORDS]`."""

import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from harness.identify.fit import Known, identify
from harness.identify.record import Record
from harness.identify.swing import Swing, motion

TRUTH = {"omega": 12.566, "zeta": 0.012, "r": 0.003, "rest": 0.02}
SAMPLES, SPAN, NOISE = 300, 3.0, 1e-3  # s, m; the first swing is 0.1 m


def record(seed):
    """A noisy record of a known decay, unevenly sampled, that begins anywhere in its first half cycle."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0.0, SPAN, SAMPLES))
    x, _ = motion(Swing(TRUTH["zeta"], TRUTH["r"]), TRUTH["omega"], rng.uniform(0.05, 0.24), 0.1, t)
    return Record(f"seed {seed}", t, x + TRUTH["rest"] + NOISE * rng.standard_normal(SAMPLES), None, "m")


def hits(seed):
    """Whether each interval of the whole-signal fit, and each of the turning points, holds the truth."""
    found = identify(record(seed), Known(), terms=("zeta", "r"))
    return [
        {each.name: each.low <= TRUTH[each.name] <= each.high for each in estimates}
        for estimates in (found.best.estimates, found.by_turns)
    ]


def coverage(records, workers=1):
    """Share of the records whose interval holds the truth, by value; by whole-signal fit and by turning points."""
    with ProcessPoolExecutor(workers) as pool:
        rows = list(pool.map(hits, range(records), chunksize=8))
    return [{name: float(np.mean([row[way][name] for row in rows])) for name in rows[0][way]} for way in (0, 1)]


if __name__ == "__main__":
    whole, turning = coverage(int((sys.argv[1:] or [1000])[0]), 2)
    print("whole signal", whole)
    print("turning points", turning)
