"""Statistics of internal step sizes for the terminal, files and the report."""

import numpy as np

from .quantity import Quantity


def step_size_quantities(h: np.ndarray, refused: int, collapse: float | None = None) -> tuple[Quantity, ...]:
    """Return the statistics of step sizes.

    Parameters
    ----------
    h : numpy.ndarray
        Accepted step sizes (n,) in s.
    refused : int
        Number of rejected steps.
    collapse : float, optional
        Reduction of the step size at reversals; None without reversals.
    """
    quantities = [
        Quantity("steps", len(h) + 1, "", "steps (time points)"),
        Quantity("mean_step", published_mean_step(h), "s", "mean step"),
        Quantity("smallest_step", float(h.min()), "s", "smallest step"),
        Quantity("largest_step", float(h.max()), "s", "largest step"),
        Quantity("refused", refused / (refused + len(h)), "1", "share of refused steps"),
    ]
    if collapse is not None:
        quantities.append(Quantity("collapse", collapse, "1", "collapse at reversals"))
    return tuple(quantities)


def published_mean_step(h: np.ndarray) -> float:
    """Return the mean step of h (n,) with the last one counted twice, as in the published values."""
    return float((h.sum() + h[-1]) / (len(h) + 1))
