"""The sizes of a solver's own steps, as the screen, quantities.csv and the page tell them."""

import numpy as np

from .quantity import Quantity


def step_size_quantities(h: np.ndarray, refused: int, collapse: float | None = None) -> tuple[Quantity, ...]:
    """Of the steps h (n,) in s, beside which so many were refused; `collapse` is None where nothing reverses."""
    found = [
        Quantity("steps", len(h) + 1, "", "steps (time points)"),
        Quantity("mean_step", published_mean_step(h), "s", "mean step"),
        Quantity("smallest_step", float(h.min()), "s", "smallest step"),
        Quantity("largest_step", float(h.max()), "s", "largest step"),
        Quantity("refused", refused / (refused + len(h)), "1", "share of refused steps"),
    ]
    if collapse is not None:
        found.append(Quantity("collapse", collapse, "1", "collapse at reversals"))
    return tuple(found)


def published_mean_step(h: np.ndarray) -> float:
    """The mean of the steps h (n,), the last one counted twice, as in the published figures."""
    return float((h.sum() + h[-1]) / (len(h) + 1))
