"""A certified result for any model: the default run of its FMU by two methods that share no formula, where they agree.

Laws that are written a second time have better ones: making.py.  A result lies beside the file of the model, under its
name, and goes into the FMU when that is built next; its changes of mode lie beside it.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HarnessError
from ..results.files import column_heading, write_csv_rows
from ..running.embedded_model import EmbeddedModel, load_model_class, method_numbers
from ..scenes.fmu_files import find_fmu
from .certified_reference import ERROR_LABEL, FOLDER, POINTS, CertifiedReference, max_relative_difference
from .models import CASES
from .reference_trajectory import CommunicationGrid, ReferenceTrajectory, require_reference_packages
from .segments import ParameterSpan, ParameterValues

METHODS = {"dop853": 1e-13, "rodas": 1e-12}  # an explicit one and one for stiff laws, with their relative tolerances
AGREEMENT_TOLERANCE = 1e-9
TIMEOUT = 120.0  # s, for each


@dataclass(frozen=True)
class CertifiedFile:
    """The file that was written, and the largest relative difference of the two routes."""

    path: Path
    difference: float


def certify(file: Path) -> list[CertifiedFile]:
    """Write the results of the model in a file, whose FMU lies beside it; HarnessError where none can be certified."""
    fmu = file.with_suffix(".fmu")
    if not fmu.is_file():
        raise HarnessError(f"there is no {fmu}: build it with `python build_fmus.py {file}`")
    model = load_model_class(fmu)
    found = generate_all(file) or {file.stem: certify_default_run(model, file)}
    heads = ["t [s]", *(column_heading(name, unit) for name, unit in states(model))]
    return [write_reference(file.with_name(f"{name}.csv"), heads, reference) for name, reference in found.items()]


def generate_all(file: Path) -> dict[str, CertifiedReference]:
    """Name and result of all that is written a second time about a model."""
    ours = {case.reference_source: case for case in CASES if FOLDER / f"{case.model}.py" == file.resolve()}
    if not ours:
        return {}
    require_reference_packages()
    from .generation import generate_reference

    return {str(name): generate_reference(case) for name, case in ours.items()}


def write_reference(path: Path, heads: list[str], found: CertifiedReference) -> CertifiedFile:
    """The files of a result."""
    rows = np.column_stack([found.times, found.motion]).tolist()
    write_csv_rows(path, heads, rows, f"# {found.method}{ERROR_LABEL}{found.estimated_error:.1e}\n")
    if found.modes:
        write_csv_rows(path.with_name(f"{path.stem}-events.csv"), ["t [s]", "mode"], found.modes)
    return CertifiedFile(path, found.estimated_error)


def states(model: type) -> list[tuple[str, str]]:
    """Name and unit of each state that a solver integrates, in order."""
    declared = [one for cls in model.__mro__ for one in vars(cls).values() if getattr(one, "role", "") == "state"]
    return [(one.name, one.unit) for one in declared if not one.rate]


def compute_by_two_methods(model: str, spans: list[ParameterSpan], grid: CommunicationGrid) -> ReferenceTrajectory:
    """What two methods of an FMU agree about, over a single span from 0 s on."""
    file, ((_, _, values),) = find_fmu(model), spans
    carried: Any = load_model_class(file)
    times = grid.times(())
    found = certify_default_run(carried, file, values, times)
    position = next(place for place, rate in enumerate(carried.states.values()) if rate in carried.states)
    speed = list(carried.states).index(list(carried.states.values())[position])
    return ReferenceTrajectory(found.times, found.motion[:, position], found.motion[:, speed], tuple(found.events))


def certify_default_run(
    model: Any, file: Path, values: ParameterValues | None = None, times: list[float] | None = None
) -> CertifiedReference:
    """A run of the model in a file, inside its FMU, by two methods; HarnessError where they do not agree.

    Without more it is the default run, at the common points.
    """
    if missing := METHODS.keys() - method_numbers(model):
        methods = ", ".join(sorted(missing))
        raise HarnessError(f"{file.with_suffix('.fmu')} does not offer {methods}: build it with all of its methods")
    times = np.linspace(0.0, model.stop_time, POINTS).tolist() if times is None else times
    first, second = (EmbeddedModel.create(model, values or {}, method, rtol) for method, rtol in METHODS.items())
    answers = [run.solve(times, TIMEOUT) for run in (first, second)]
    how, apart = " and ".join(METHODS), max_relative_difference(*answers)
    if not apart <= AGREEMENT_TOLERANCE:
        raise HarnessError(
            f"{file.name}: {how} differ by {apart:.1e}, more than "
            f"{AGREEMENT_TOLERANCE:g}, and nothing is certified: shorten the "
            "default run, or smooth a law that jumps"
        )
    modes = first.find_modes(times[-1]) if answers[0].events is not None else []
    return CertifiedReference(np.array(times), answers[0].states, modes, how, apart)
