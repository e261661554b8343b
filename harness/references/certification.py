"""Certified results for any model: its default run by two methods that share no formula, if they agree.

The first method also runs with a thirtieth of the largest step, because both may pass the same short pulse.

A result is written next to the file of the model, under its name, and packaged into the FMU at the next build.  A
second file has the changes of mode.  Shipped models get more accurate results from `python -m benchmarks references`.
"""

from dataclasses import dataclass, replace
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..results.files import column_heading, write_csv_rows
from ..scenes.fmu_files import find_fmu
from ..simulation.embedded_model import EmbeddedModel, load_model_class, method_numbers
from ..simulation.solution import Solution
from .certified_reference import ERROR_LABEL, FOLDER, POINTS, event_time_error, max_relative_difference
from .models import MODELS
from .reference_trajectory import CommunicationGrid, compute_reference
from .segments import ParameterSpan, ParameterValues

# An explicit and a stiff method, with their relative tolerances.  A step across a kink may pass the error estimate of a
# method by chance (error 6e-9 at 1e-13 in one law with |slip|); then the methods disagree, and nothing is certified.
METHODS = {"dop853": 2e-13, "rodas": 1e-12}
LARGEST_STEP = 1.0 / 300.0  # share of the run, in the second run of the first method; a thirtieth of the default
AGREEMENT_TOLERANCE = 1e-9
TIMEOUT = 120.0  # s, for each method


@dataclass(frozen=True)
class CertifiedFile:
    """Certified result in a file: its `path`, and the largest relative `difference` of the runs."""

    path: Path
    difference: float


def certify(file: Path) -> list[CertifiedFile]:
    """Write the certified results of the model in a file whose FMU is in the same folder.

    Raises
    ------
    HarnessError
        If the FMU is not built, does not offer both methods, or the methods disagree, or if the model is a shipped one.
    """
    if file.resolve().parent in (FOLDER, FOLDER / "more"):
        raise HarnessError(
            f"{file} is a shipped model, whose certified results are more accurate: compute them by "
            f"`python -m benchmarks references {file.stem}` in a checkout of the project"
        )
    fmu = file.with_suffix(".fmu")
    if not fmu.is_file():
        raise HarnessError(f"there is no {fmu}: build it with `friction-fmus build {file}`")
    model = load_model_class(fmu)
    return write_references({file.stem: certify_default_run(model, file)}, model, file.parent)


def write_references(references: dict[str, Solution], model: type, folder: Path) -> list[CertifiedFile]:
    """Write references of a model, the class inside its FMU, to a folder, under their names."""
    headings = ["t [s]", *(column_heading(name, unit) for name, unit in list_states(model))]
    return [write_reference(folder / f"{name}.csv", headings, reference) for name, reference in references.items()]


def write_reference(path: Path, headings: list[str], reference: Solution) -> CertifiedFile:
    """Write a reference to a file, and its changes of mode to another."""
    rows = np.column_stack([reference.times, reference.states]).tolist()
    write_csv_rows(path, headings, rows, f"# {reference.method}{ERROR_LABEL}{reference.estimated_error:.1e}\n")
    if reference.modes:
        write_csv_rows(path.with_name(f"{path.stem}-events.csv"), ["t [s]", "mode"], reference.modes)
    return CertifiedFile(path, reference.estimated_error)


def list_states(model: type) -> list[tuple[str, str]]:
    """Return name and unit of each state that the solver integrates, in order."""
    states = [value for cls in model.__mro__ for value in vars(cls).values() if getattr(value, "role", "") == "state"]
    return [(state.name, state.unit) for state in states if not state.rate]


def compute_by_two_methods(model: str, spans: list[ParameterSpan], grid: CommunicationGrid) -> Solution:
    """Return the trajectory on which two methods of an FMU agree, over a single span from 0 s on."""
    file, ((_, _, values),) = find_fmu(model), spans
    model_class: Any = load_model_class(file)
    times = grid.times(())
    reference = solve_by_two_methods(model_class, file, values, times)
    rates = list(model_class.states.values())
    position = next(i for i, rate in enumerate(rates) if rate in model_class.states)
    velocity = list(model_class.states).index(rates[position])
    return replace(reference, states=reference.states[:, [position, velocity]])


def certify_default_run(model: Any, file: Path) -> Solution:
    """Return the default run of a model by two methods, in this process.

    Raises
    ------
    HarnessError
        If the FMU does not offer both methods, or they disagree on the motion or on the changes of mode.
    """
    reference = solve_by_two_methods(model, file)
    if reference.events is None:
        raise HarnessError(
            f"{file.name}: {reference.method} find different changes of mode, so the result is not certified: a load "
            "equals the holding force up to rounding; change a start value or a parameter a little"
        )
    return reference


def solve_by_two_methods(
    model: Any, file: Path, values: ParameterValues | None = None, times: list[float] | None = None
) -> Solution:
    """Return a run of a model by two methods, in this process.

    The events are None if the runs find different ones: a load equals the holding force up to rounding, which decides
    whether the contact sticks.

    Parameters
    ----------
    model : type
        Class of the model inside its FMU.
    file : pathlib.Path
        File of the model or of its FMU, for messages.
    values : mapping, optional
        Parameter values other than the defaults.
    times : list of float, optional
        Output times in s; by default the points that a default run and its certified result share.

    Raises
    ------
    HarnessError
        If the FMU does not offer both methods, or they disagree on the motion, or with a thirtieth of the largest step.
    """
    if missing_methods := METHODS.keys() - method_numbers(model):
        methods = ", ".join(sorted(missing_methods))
        raise HarnessError(f"{file.with_suffix('.fmu')} does not offer {methods}: build it without --method")
    times = np.linspace(0.0, model.stop_time, POINTS).tolist() if times is None else times
    tolerance = METHODS["dop853"]
    runs = [EmbeddedModel.create(model, values or {}, method, rtol) for method, rtol in METHODS.items()]
    runs.append(EmbeddedModel.create(model, values or {}, "dop853", tolerance, h_max=LARGEST_STEP * times[-1]))
    solution, other, fine = (run.solve(times, TIMEOUT) for run in runs)
    methods = " and ".join(METHODS)
    difference, fine_difference = (max_relative_difference(solution, comparison) for comparison in (other, fine))
    if not difference <= AGREEMENT_TOLERANCE:
        raise HarnessError(
            f"{file.name}: {methods} differ by {difference:.1e}, more than {AGREEMENT_TOLERANCE:g}, so the result is "
            "not certified: shorten the default run, or smooth a discontinuous law"
        )
    if not fine_difference <= AGREEMENT_TOLERANCE:
        raise HarnessError(
            f"{file.name}: dop853 with a thirtieth of the largest step differs by {fine_difference:.1e}, more than "
            f"{AGREEMENT_TOLERANCE:g}, so the result is not certified: longer steps pass a short change of a load, a "
            "limit or a condition; let it depend on a state whose rate is a parameter, or shorten the default run"
        )
    reference = replace(solution, method=methods, estimated_error=max(difference, fine_difference))
    events = solution.events or []
    has_same_events = all(not isnan(event_time_error(events, comparison.events or [])) for comparison in (other, fine))
    if not has_same_events or len({run.run.events.count for run in runs}) > 1:
        return replace(reference, events=None, start_mode=None)
    return replace(reference, events=events)


def solve_reference(model: str, spans: list[ParameterSpan], grid: CommunicationGrid) -> Solution:
    """Return the reference of a model, or the result of two methods of a user model."""
    solve = compute_reference if model in MODELS else compute_by_two_methods
    return solve(model, spans, grid)


def find_modes(model: str) -> list[str]:
    """Return the modes of a model; HarnessError if it has no position with a speed."""
    model_class: Any = load_model_class(find_fmu(model))
    if not {*model_class.states} & {*model_class.states.values()}:
        raise HarnessError(f"{model}: no state is the rate of another one; the cases need a position and a speed")
    return list(model_class.contacts)
