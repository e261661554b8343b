"""Run time."""

from collections.abc import Callable
from time import perf_counter


def timed(call: Callable[[], object]) -> float:
    """Run time in s of one call."""
    begun = perf_counter()
    call()
    return perf_counter() - begun
