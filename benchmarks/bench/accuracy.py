"""Accuracy benchmarks: built FMUs through fmpy against independent references."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from math import ulp
from random import Random
from typing import Any

import numpy as np

from harness.errors import HarnessError
from harness.references.models import CASES, MODELS
from harness.references.ode_problem import OdeProblem
from harness.references.piecewise_linear import mp
from harness.references.reference_trajectory import CommunicationGrid, compute_reference, motion_error
from harness.scenes.fmu_files import find_fmu
from harness.scenes.run_spec import RunSpec
from harness.simulation.embedded_model import EmbeddedModel, load_model_class
from harness.simulation.fmu_info import FmuInfo, read_info
from harness.simulation.step_sequence import RefusedRun, run_steps

from .benchmark import SETTINGS, Baseline, Benchmark

POINTS = 1600
CLOSED_FORM = Baseline("closed form in 120 digits")


def accuracy_benchmarks() -> list[Callable[[], Benchmark]]:
    """Return the accuracy benchmarks."""
    infos = {model: read_info(model) for model in MODELS}
    exact_models = [model for model in MODELS if "exact" in infos[model].methods]
    return [
        *(partial(exact_run_error, model, infos[model]) for model in exact_models),
        *(
            partial(event_time_error, model, infos[model])
            for model in exact_models
            if "friction" in infos[model].enumerations
        ),
        partial(last_event_error, "coulomb", {"f": 1e-7}, 300_000, turning_time),
        partial(last_event_error, "stickslip", {}, 200_000, slip_event_time),
        *(
            partial(default_run_error, "pendulum", infos["pendulum"], "pin_load", load, 1e-9)
            for load in ("weight", "reaction")
        ),
        *(partial(default_run_error, "pacejka", infos["pacejka"], "x_m", 10.0**-n, 1e-7) for n in range(2, 7)),
        *(partial(between_grids, model, infos[model]) for model in MODELS),
        *(partial(stuck_drift, model, infos[model], values) for model, values in SETTINGS["stuck"].items()),
    ]


def run_through_times(spec: RunSpec, times: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities (n,) at the communication points `times` (n,) in s.

    Raises
    ------
    HarnessError
        With the message of the FMU, if the run fails.
    """
    outcome = run_steps(spec, [(t, ahead - t) for t, ahead in pairwise(times)], {})
    if isinstance(outcome, RefusedRun):
        raise HarnessError(f"{spec.model}: {outcome.message}")
    x, v, *_ = outcome.columns.values()
    return x, v


def max_error(model: str, info: FmuInfo, settings: dict[str, float | str]) -> float:
    """Return the largest error of the default experiment, relative to the largest value."""
    values = info.resolve_labels({**info.start_values, **settings})
    reference = compute_reference(model, [(0.0, info.stop, values)], CommunicationGrid(0.0, info.stop, POINTS))
    spec = RunSpec(find_fmu(model), values=values, stop=info.stop)
    return motion_error(reference, *run_through_times(spec, reference.times.tolist()))


def exact_run_error(model: str, info: FmuInfo) -> Benchmark:
    return Benchmark(f"{model}, exact: whole run", max_error(model, info, {}), "1", 1e-13, (CLOSED_FORM,))


def default_run_error(model: str, info: FmuInfo, name: str, value: float | str, target: float) -> Benchmark:
    """Measure the error with the default method and tolerance of the model."""
    baseline = Baseline("scipy Radau at 1e-11" if equations_of(model).is_stiff else "scipy DOP853 at 1e-13")
    return Benchmark(
        f"{model}, default, {name} {value}", max_error(model, info, {name: value}), "1", target, (baseline,)
    )


def event_time_error(model: str, info: FmuInfo) -> Benchmark:
    """Measure the largest relative error of event times."""
    reference = compute_reference(model, [(0.0, info.stop, info.start_values)], CommunicationGrid(0.0, info.stop, 1))
    expected = reference.events or []
    embedded_model = EmbeddedModel.create(load_model_class(find_fmu(model)), {}, "exact", 0.0)
    events = embedded_model.find_mode_changes(info.stop)
    if [mode for _, mode in events] != [mode for _, mode in expected]:
        raise HarnessError(f"{model}: the modes after events are wrong")
    largest_error = max(abs(t / t_reference - 1) for (t, _), (t_reference, _) in zip(events, expected, strict=True))
    return Benchmark(f"{model}, exact: times of {len(events)} events", largest_error, "1", 1e-14, (CLOSED_FORM,))


def last_event_error(model: str, values: dict[str, float], number: int, law: Callable[[Any, int], Any]) -> Benchmark:
    """Measure the error of the time of the last of many events, in units in the last place."""
    embedded_model = EmbeddedModel.create(load_model_class(find_fmu(model)), values, "exact", 0.0)
    t_reference, next_time = (law(embedded_model.model, n) for n in (number, number + 1))
    stop = float((t_reference + next_time) / 2)
    embedded_model.compute_states([stop * i / 10 for i in range(10)] + [stop])
    events = embedded_model.run.events
    embedded_model.run.solver.report(events)
    if events.count != number:
        raise HarnessError(f"{model}: {events.count} events, not {number}")
    largest_error = float(abs(events.t_last - t_reference)) / ulp(events.t_last)
    name = f"{model}, exact: the last of {number} events, units in the last place"
    return Benchmark(name, largest_error, "1", 4.0, (CLOSED_FORM,))


def turning_time(model: Any, number: int) -> Any:
    """Return the time of the n-th turning point of a mass on a spring: n half periods."""
    return number * mp.pi * mp.sqrt(mp.mpf(model.m) / mp.mpf(model.k))


def slip_event_time(model: Any, number: int) -> Any:
    """Return the time of the n-th event of the sled: break-away if n is odd, stop if n is even.

    While the sled sticks, the elongation of its spring grows from 2 d - h to h, the limit of static friction; while it
    slips, the elongation oscillates about d.
    """
    k, u, w = mp.mpf(model.k), mp.mpf(model.v_driver), mp.sqrt(mp.mpf(model.k) / mp.mpf(model.m))
    h, d = (mp.mpf(mu) * mp.mpf(model.m) * mp.mpf(model.g) / k for mu in (model.mu_s, model.mu_d))
    slip, stick = 2 * (mp.pi - mp.atan2(w * (h - d), u)) / w, 2 * (h - d) / u
    return h / u + (number - 1) // 2 * (slip + stick) + (0 if number % 2 else slip)


def between_grids(model: str, info: FmuInfo) -> Benchmark:
    """Measure the largest relative difference at common times between runs on a uniform and on a random grid."""
    uniform = [info.stop * i / 200 for i in range(201)]
    random = Random(model)
    merged_times = sorted({*uniform, *(random.uniform(0.0, info.stop) for _ in range(777))})
    spec = RunSpec(find_fmu(model), values=info.start_values, stop=info.stop)
    uniform_run, merged_run = run_through_times(spec, uniform), run_through_times(spec, merged_times)
    indices = np.searchsorted(merged_times, uniform)
    parts = zip(uniform_run, merged_run, strict=True)
    largest_error = max(float(np.abs(a - b[indices]).max() / np.abs(a).max()) for a, b in parts)
    return Benchmark(
        f"{model}, default: difference between two grids", largest_error, "1", 1e-12, (Baseline("each other"),)
    )


def stuck_drift(model: str, info: FmuInfo, settings: dict[str, float]) -> Benchmark:
    """Measure the displacement of a stuck body."""
    spec = RunSpec(find_fmu(model), values={**info.start_values, **settings}, stop=1e6)
    x, _ = run_through_times(spec, [1e4 * i for i in range(101)])
    displacement = float(np.abs(x - x[0]).max())
    return Benchmark(f"{model}, stuck for 1e6 s: displacement", displacement, equations_of(model).unit, 0.0, ())


def equations_of(model: str) -> OdeProblem:
    """Return the reference equations of a model."""
    return next(case.problem for case in CASES if case.model == model)
