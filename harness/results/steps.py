"""The sizes of a solver's own steps, as the screen, figures.csv and the page tell them."""

from dataclasses import dataclass

import numpy as np

from .quantity import Quantity


@dataclass(frozen=True)
class StepSizes:
    """Number of time points, sizes in s, refused share of all tried; `collapse` is None where nothing reverses."""

    count: int
    mean: float
    smallest: float
    largest: float
    refused: float
    collapse: float | None

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        found = [
            Quantity("steps", self.count, "", "steps (time points)"),
            Quantity("mean_step", self.mean, "s", "mean step"),
            Quantity("smallest_step", self.smallest, "s", "smallest step"),
            Quantity("largest_step", self.largest, "s", "largest step"),
            Quantity("refused", self.refused, "1", "share of refused steps"),
        ]
        if self.collapse is not None:
            found.append(Quantity("collapse", self.collapse, "1", "collapse at reversals"))
        return tuple(found)


def sizes(h: np.ndarray, refused: int, collapse: float | None = None) -> StepSizes:
    """The sizes of the steps h (n,) in s, beside which so many were refused."""
    share = refused / (refused + len(h))
    return StepSizes(len(h) + 1, published_mean(h), float(h.min()), float(h.max()), share, collapse)


def published_mean(h: np.ndarray) -> float:
    """The mean of the steps h (n,), the last one counted twice, as in the published figures."""
    return float((h.sum() + h[-1]) / (len(h) + 1))
