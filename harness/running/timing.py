"""Run time."""

from collections.abc import Callable
from time import perf_counter


def time_call(call: Callable[[], object]) -> float:
    """Run time in s of one call."""
    begun = perf_counter()
    call()
    return perf_counter() - begun


def time_fastest_call(call: Callable[[], object], times: int) -> float:
    """Run time in s of the fastest of several calls, after one to warm up."""
    call()
    return min(time_call(call) for _ in range(times))
