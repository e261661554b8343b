"""The answer of `decay` and of `fit` as JSON: keys that both have, with the same content."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .estimate import Estimate


@dataclass(frozen=True)
class UsedSamples:
    """The samples of a record that were fitted.

    Attributes
    ----------
    record : str
    t : numpy.ndarray
        Their times (n,) in s.
    n_record : int
        Number of samples in the record.
    averaged : int
        Number of neighbouring samples whose mean was fitted.
    """

    record: str
    t: np.ndarray
    n_record: int
    averaged: int = 1

    def as_json(self) -> dict[str, Any]:
        """Return the samples for JSON output."""
        return {
            "record": self.record,
            "from": float(self.t[0]),
            "until": float(self.t[-1]),
            "samples": len(self.t),
            "of": self.n_record,
            "averaged": self.averaged,
            "time_unit": "s",
        }


@dataclass(frozen=True)
class ColumnResiduals:
    """Residuals of a measured column: root mean square, noise of the record, and range, all in `unit`."""

    record: str
    name: str
    unit: str
    residual: float
    noise: float
    range: float


def answer_as_json(
    samples: Sequence[UsedSamples],
    columns: Sequence[ColumnResiduals],
    estimates: Sequence[Estimate],
    remarks: Sequence[str],
) -> dict[str, Any]:
    """Return the keys that the answers of `decay` and of `fit` share."""
    return {
        "record": ", ".join(each.record for each in samples),
        "records": [each.as_json() for each in samples],
        "columns": [asdict(column) for column in columns],
        "fit": [asdict(estimate) for estimate in estimates],
        "remarks": [*remarks],
    }
