"""What is made of an FMU once, as long as its file is not changed: studies ask for it again and again."""

from collections.abc import Callable, Hashable
from functools import cache, wraps
from pathlib import Path
from typing import TypeVar

Result = TypeVar("Result")


def cached_by_mtime(make: Callable[..., Result]) -> Callable[..., Result]:
    """make(fmu, ...) of a file that is there, remembered by its path, the time of its last change, and the rest."""

    @cache
    def known(fmu: Path, changed: int, *more: Hashable) -> Result:
        return make(fmu, *more)

    @wraps(make)
    def asked(fmu: Path, *more: Hashable) -> Result:
        return known(fmu.absolute(), fmu.stat().st_mtime_ns, *more)

    return asked
