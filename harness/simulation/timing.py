"""Measurement of run times."""

from collections.abc import Callable
from time import perf_counter


def time_call(call: Callable[[], object]) -> float:
    """Return the run time in s of one call."""
    start = perf_counter()
    call()
    return perf_counter() - start


def time_fastest_call(call: Callable[[], object], times: int) -> float:
    """Return the run time in s of the fastest of `times` calls, after one call to warm up."""
    call()
    return min(time_call(call) for _ in range(times))
