"""Cache of what is read from files, as long as the files are not changed."""

from collections.abc import Callable, Hashable
from functools import cache, wraps
from pathlib import Path
from typing import TypeVar

Result = TypeVar("Result")


def cached_by_mtime(make: Callable[..., Result]) -> Callable[..., Result]:
    """Decorate make(fmu, ...) with a cache keyed by path, modification time and arguments. The file must exist."""

    @cache
    def cached_result(fmu: Path, mtime: int, *arguments: Hashable) -> Result:
        return make(fmu, *arguments)

    @wraps(make)
    def lookup(fmu: Path, *arguments: Hashable) -> Result:
        return cached_result(fmu.absolute(), fmu.stat().st_mtime_ns, *arguments)

    return lookup
