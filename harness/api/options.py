"""Options that functions of the Python API share."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ..errors import SceneError, format_value, unknown_name_message

if TYPE_CHECKING:
    from ..scenes.run_spec import RunSpec

Progress = Callable[[float], None]  # takes the finished share, from 0 to 1

INTERFACES = {"CoSimulation": False, "ModelExchange": True}
QUIET: Progress = lambda share: None  # noqa: E731 - a function without effect needs no def


def parse_interface(interface: str | None) -> bool | None:
    """Return whether an interface is model exchange; None if no interface is given."""
    if interface is None:
        return None
    if interface not in INTERFACES:
        raise SceneError(unknown_name_message("interface", interface, INTERFACES))
    return INTERFACES[interface]


def apply_options(
    spec: "RunSpec",
    stop: float | None = None,
    interval: float | None = None,
    outputs: Sequence[str] | None = None,
    method: str | int | None = None,
    rtol: float | None = None,
    interface: str | None = None,
    timeout: float | None = None,
) -> "RunSpec":
    """Return a run with those of the options that are not None."""
    from ..running.fmu_archive import exposes_solver_steps, read_description
    from ..scenes.schema import is_number

    values = dict(spec.values)
    if method is not None:
        values["solver.method"] = method
    tolerance = spec.tolerance
    if rtol is not None and spec.fmu.name and exposes_solver_steps(read_description(spec.fmu, spec.lenient)):
        values["solver.rtol"] = rtol
    elif rtol is not None:
        tolerance = rtol
    for name, number in (("interval", interval), ("timeout", timeout), ("rtol", rtol)):
        if number is not None and not (is_number(number) and number > 0):
            raise SceneError(f"{name} = {format_value(number)} must be a finite number above 0")
    if stop is not None and not is_number(stop):
        raise SceneError(f"stop = {format_value(stop)} must be a finite number of seconds")
    if isinstance(outputs, str):
        outputs = (outputs,)
    exchange = parse_interface(interface)
    return replace(
        spec,
        values=values,
        tolerance=tolerance,
        stop=spec.stop if stop is None else float(stop),
        grid=spec.grid if interval is None else float(interval),
        interval=spec.interval if interval is None else float(interval),
        follow=True if interval is not None else spec.follow,
        outputs=spec.outputs if outputs is None else tuple(outputs),
        exchange=spec.exchange if exchange is None else exchange,
        timeout=spec.timeout if timeout is None else float(timeout),
    )
