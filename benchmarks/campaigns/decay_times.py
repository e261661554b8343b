"""Processor time of `decay` by count of samples: `python -m benchmarks.campaigns.decay_times [LARGEST]`.

The record has a hundred periods between two rests, viscous damping, dry friction and noise, as a whole experiment has.
Each count is fitted with and without the averaging of dense records, in turn, and the smaller time of two fits counts.
Records of more than 100 000 samples are fitted with averaging only.
"""

import sys
from time import process_time
from unittest.mock import patch

import numpy as np
from decays import decay_record, identify

from harness.analyses.decay import thresholds

PERIODS, REST = 100.0, 6.0  # of 1 s; the rests are as long as some of them
MOST_UNTHINNED = 100_000


def experiment(samples):
    """Return the record of a rest, a release, a decay and a rest."""
    t = np.linspace(0.0, PERIODS + 2 * REST, samples)
    record = decay_record(0.002, 0.0003, omega=2 * np.pi, turn=REST, t=t, noise=1e-5)
    return record._replace(x=np.where(t > PERIODS + REST, 0.02, record.x))


def processor_time(record, densest):
    """Return the processor time in s of a fit that averages records of more than `densest` samples."""
    with patch.object(thresholds, "MAX_DENSE_SAMPLES", densest):
        start = process_time()
        identify(record)
        return process_time() - start


if __name__ == "__main__":
    largest = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    print(f"{'samples':>9} {'now':>7} {'without averaging':>18}")
    for samples in (10**k for k in range(3, 7) if 10**k <= largest):
        record = experiment(samples)
        averaged_times, unaveraged_times = [], []
        for _ in range(2):
            averaged_times.append(processor_time(record, thresholds.MAX_DENSE_SAMPLES))
            if samples <= MOST_UNTHINNED:
                unaveraged_times.append(processor_time(record, samples))
        averaged_text, unaveraged_text = (
            f"{min(times):.1f} s" if times else "-" for times in (averaged_times, unaveraged_times)
        )
        print(f"{samples:9} {averaged_text:>7} {unaveraged_text:>18}", flush=True)
