"""Decays of measured records: `python -m benchmarks.measured_decays FOLDER` prints a table of the records in a folder.

Each record, a CSV file with headings and units, is identified as a whole, in halves and in thirds.  The last column
lists the losses for which the intervals of two windows do not overlap.
"""

import sys
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np

from harness import HarnessError, identify_decay
from harness.results.quantity import format_interval

NAMES = ("omega", "zeta", "r", "b")
LOSSES = NAMES[1:]


def table_row(path: Path) -> list[str]:
    """Return the row of a record: values, or the sentence that refuses it, and windows that disagree."""
    try:
        complete_fit = identify_decay(path)
    except HarnessError as refusal:
        return [path.stem, str(refusal)]
    disagreements: set[str] = set()
    for count in (2, 3):
        edges = np.linspace(complete_fit.t[0], complete_fit.t[-1], count + 1)
        fits = []
        for begin, end in pairwise(edges):
            try:
                fits.append(identify_decay(path, begin=begin, end=end))
            except HarnessError:
                disagreements.add(f"refused from {begin:.3g} to {end:.3g} s")
        for fit, other in combinations(fits, 2):
            disagreements |= {
                name for name in LOSSES if max(fit[name].low, other[name].low) > min(fit[name].high, other[name].high)
            }
    values = [
        format_interval(complete_fit[name].value, complete_fit[name].low, complete_fit[name].high) for name in NAMES
    ]
    return [path.stem, *values, ", ".join(sorted(disagreements)) or "none"]


if __name__ == "__main__":
    print("| record | " + " | ".join(NAMES) + " | windows that disagree |")
    print("|---" * (len(NAMES) + 2) + "|")
    for path in sorted(Path(sys.argv[1]).glob("*.csv")):
        print("| " + " | ".join(table_row(path)) + " |", flush=True)
