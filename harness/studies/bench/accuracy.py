"""The benchmark's errors: built FMUs through fmpy against answers by a second route (truth.py)."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from math import ulp
from random import Random
from typing import Any

import numpy as np

from ...errors import HarnessError
from ...references.models import CASES, MODELS
from ...references.ode_problem import OdeProblem
from ...references.piecewise_linear import mp
from ...references.reference_trajectory import CommunicationGrid, compute_reference
from ...running.embedded_model import EmbeddedModel, load_model_class
from ...running.fmu_session import CompletedRun, FmuInfo, InitialValues, read_info, run_steps
from ...scenes.fmu_files import find_fmu
from .benchmark import SETTINGS, Baseline, Benchmark

POINTS = 1600
CLOSED = Baseline("closed form in 120 digits")


def accuracy_benchmarks() -> list[Callable[[], Benchmark]]:
    """What to measure, in the order of the design's table."""
    cards = {model: read_info(model) for model in MODELS}
    closed = [model for model in MODELS if "exact" in cards[model].methods]
    return [
        *(partial(exact_run_error, model, cards[model]) for model in closed),
        *(
            partial(event_time_error, model, cards[model])
            for model in closed
            if "friction" in cards[model].enumerations
        ),
        partial(last_event_error, "coulomb", {"f": 1e-7}, 300_000, swings),
        partial(last_event_error, "stickslip", {}, 200_000, slips),
        *(
            partial(default_run_error, "pendulum", cards["pendulum"], "pin_load", load, 1e-9)
            for load in ("weight", "reaction")
        ),
        *(partial(default_run_error, "pacejka", cards["pacejka"], "x_m", 10.0**-n, 1e-6) for n in range(2, 7)),
        *(partial(between_grids, model, cards[model]) for model in MODELS),
        *(partial(stuck_drift, model, cards[model], values) for model, values in SETTINGS["stuck"].items()),
    ]


def moved(setting: InitialValues, times: list[float]) -> CompletedRun:
    """The motion through the times; HarnessError with the FMU's sentence if it is refused."""
    ending = run_steps(setting, [(t, ahead - t) for t, ahead in pairwise(times)], {})
    if not isinstance(ending, CompletedRun):
        raise HarnessError(f"{setting.model}: {ending.message}")
    return ending


def error(model: str, its: FmuInfo, chosen: dict[str, float | str]) -> float:
    """The largest error of the default experiment, as a share of the largest value."""
    values = its.resolve_labels({**its.start_values, **chosen})
    answer = compute_reference(model, [(0.0, its.stop, values)], CommunicationGrid(0.0, its.stop, POINTS))
    motion = moved(InitialValues(model, values, stop=its.stop), answer.times.tolist())
    return answer.error(motion.x, motion.v)


def exact_run_error(model: str, its: FmuInfo) -> Benchmark:
    return Benchmark(f"{model}, exact: whole run", error(model, its, {}), "1", 1e-13, (CLOSED,))


def default_run_error(model: str, its: FmuInfo, name: str, value: float | str, reach: float) -> Benchmark:
    """A model with its own method and tolerance."""
    beside = Baseline("scipy Radau at 1e-11" if problem(model).is_stiff else "scipy DOP853 at 1e-13")
    return Benchmark(f"{model}, default, {name} {value}", error(model, its, {name: value}), "1", reach, (beside,))


def event_time_error(model: str, its: FmuInfo) -> Benchmark:
    """The largest error of the time of an event, relative to it."""
    answer = compute_reference(model, [(0.0, its.stop, its.start_values)], CommunicationGrid(0.0, its.stop, 1))
    found = EmbeddedModel.create(load_model_class(find_fmu(model)), {}, "exact", 0.0).find_mode_changes(its.stop)
    if [mode for _, mode in found] != [mode for _, mode in answer.events]:
        raise HarnessError(f"{model}: the modes after its events are not the true ones")
    off = max(abs(t / true - 1) for (t, _), (true, _) in zip(found, answer.events, strict=True))
    return Benchmark(f"{model}, exact: times of {len(found)} events", off, "1", 1e-14, (CLOSED,))


def last_event_error(model: str, values: dict[str, float], number: int, law: Callable[[Any, int], Any]) -> Benchmark:
    """How far off the time of the last of many events is, in units of its last place."""
    inside = EmbeddedModel.create(load_model_class(find_fmu(model)), values, "exact", 0.0)
    true, next_one = (law(inside.model, n) for n in (number, number + 1))
    stop = float((true + next_one) / 2)
    inside.compute_states([stop * i / 10 for i in range(10)] + [stop])
    inside.model.solver.report(inside.model.events)
    events = inside.model.events
    if events.count != number:
        raise HarnessError(f"{model}: {events.count} events, not {number}")
    off = float(abs(events.t_last - true)) / ulp(events.t_last)
    what = f"{model}, exact: the last of {number} events, units in the last place"
    return Benchmark(what, off, "1", 4.0, (CLOSED,))


def swings(model: Any, number: int) -> Any:
    """When a mass on a spring turns for the n-th time: after as many half periods."""
    return number * mp.pi * mp.sqrt(mp.mpf(model.m) / mp.mpf(model.k))


def slips(model: Any, number: int) -> Any:
    """When the sled breaks away (odd) or sticks (even) for the n-th time.

    It sticks while the stretch of its spring grows from 2 d - h to h, which friction holds, and slips about d.
    """
    k, u, w = mp.mpf(model.k), mp.mpf(model.v_driver), mp.sqrt(mp.mpf(model.k) / mp.mpf(model.m))
    h, d = (mp.mpf(mu) * mp.mpf(model.m) * mp.mpf(model.g) / k for mu in (model.mu_s, model.mu_d))
    slip, stick = 2 * (mp.pi - mp.atan2(w * (h - d), u)) / w, 2 * (h - d) / u
    return h / u + (number - 1) // 2 * (slip + stick) + (0 if number % 2 else slip)


def between_grids(model: str, its: FmuInfo) -> Benchmark:
    """The largest difference at shared times between an even grid and a random one, as a share of the largest."""
    even = [its.stop * i / 200 for i in range(201)]
    draw = Random(model)
    both = sorted({*even, *(draw.uniform(0.0, its.stop) for _ in range(777))})
    setting = InitialValues(model, its.start_values, stop=its.stop)
    one, other = moved(setting, even), moved(setting, both)
    shared = np.searchsorted(both, even)
    parts = ((one.x, other.x), (one.v, other.v))
    off = max(float(np.abs(a - b[shared]).max() / np.abs(a).max()) for a, b in parts)
    return Benchmark(f"{model}, default: difference between two grids", off, "1", 1e-12, (Baseline("each other"),))


def stuck_drift(model: str, its: FmuInfo, chosen: dict[str, float]) -> Benchmark:
    """How far a stuck body gets."""
    setting = InitialValues(model, {**its.start_values, **chosen}, stop=1e6)
    x = moved(setting, [1e4 * i for i in range(101)]).x
    off = float(np.abs(x - x[0]).max())
    return Benchmark(f"{model}, stuck for 1e6 s: displacement", off, problem(model).unit, 0.0, ())


def problem(model: str) -> OdeProblem:
    """The equations of a model, as they are written a second time."""
    return next(case.problem for case in CASES if case.model == model)
