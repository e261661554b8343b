"""Options that functions of the Python API share."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from ..arguments import Progress, check_interval
from ..errors import SceneError
from ..process.progress_bar import show_progress

if TYPE_CHECKING:
    from ..scenes.run_spec import RunSpec

QUIET: Progress = lambda share: None  # noqa: E731 - a function without effect needs no def
P = ParamSpec("P")
R = TypeVar("R")


def with_progress_bar(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function so that it shows its progress, unless its argument `progress` is a function or False."""

    @wraps(function)
    def wrapper(*arguments: P.args, **options: P.kwargs) -> R:
        if options.get("progress") is not None:
            return function(*arguments, **options)
        with show_progress(function.__name__) as report:
            return function(*arguments, **(options | {"progress": report}))  # type: ignore[arg-type]

    return wrapper


def reporter(progress: Progress | bool | None) -> Progress:
    """Return a function that takes the finished share; without effect if there is none."""
    return progress if callable(progress) else QUIET


def check_time_range(time: str | None, rate: float | None, begin: float | None, end: float | None) -> None:
    """Raise SceneError if the options for the times of a record exclude each other."""
    if rate is not None and time is not None:
        raise SceneError("rate replaces the times in the column that `time` names: leave one of them out")
    if begin is not None and end is not None:
        check_interval(begin, end)


def apply_options(
    spec: "RunSpec",
    stop: float | None = None,
    interval: float | None = None,
    outputs: Sequence[str] | None = None,
    method: str | int | None = None,
    rtol: float | None = None,
    interface: str | None = None,
    timeout: float | None = None,
    lenient: bool = False,
) -> "RunSpec":
    """Return a run with those of the options that are not None."""
    from ..simulation.resolve import METHOD, set_rtol

    spec = replace(
        spec,
        values=dict(spec.values) | ({} if method is None else {METHOD: method}),
        stop=spec.stop if stop is None else stop,
        grid=spec.grid if interval is None else interval,
        interval=spec.interval if interval is None else interval,
        follow=True if interval is not None else spec.follow,
        outputs=spec.outputs if outputs is None else tuple(outputs),
        exchange=spec.exchange if interface is None else interface == "ModelExchange",
        timeout=spec.timeout if timeout is None else timeout,
        lenient=spec.lenient or lenient,
    )
    return spec if rtol is None else set_rtol(spec, rtol)
