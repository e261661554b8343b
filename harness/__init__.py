"""Run, compare, sweep and identify FMUs of mechanical oscillators with dry friction.

The functions of this module do what the commands of ``friction-fmus`` do, and return their results to Python. Nothing
is printed. An error that a user can cause raises a subclass of `HarnessError`.
"""

import os
import signal
import sys

if sys.orig_argv[1:3] == ["-m", "harness"] or "".join(sys.orig_argv[1:2]).endswith("friction-fmus"):
    # a command: after these imports, `interruptible` handles both signals

    def exit_early(number: int, frame: object) -> None:
        """End a command at a signal with the message and the exit status of `interruptible`."""
        os.write(2, b"Error: interrupted\n" if number == signal.SIGINT else b"Error: terminated\n")
        os._exit(128 + number)

    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, exit_early)

if sys.argv[:1] == ["-m"]:  # python -m harness: no file of the working folder, such as a model math.py, is imported
    PARENT_FOLDER = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    if sys.path[0] != PARENT_FOLDER:
        sys.path += [PARENT_FOLDER, sys.path.pop(0)]

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .api import (
    compare,
    describe,
    fit,
    identify_curve,
    identify_decay,
    load_result,
    map_motions,
    measure,
    orbit,
    read_record,
    sensitivity,
    simulate,
    sweep,
)
from .errors import HarnessError, SceneError

if TYPE_CHECKING:
    from .analyses.curve.identification import CurveIdentification
    from .analyses.decay.identification import DecayIdentification
    from .analyses.fit.parameter_fit import ParameterFit
    from .analyses.motion import MotionMeasures
    from .records.record import Record
    from .simulation.fmu_variables import FmuDescription
    from .simulation.motion import Motion
    from .simulation.signals import ModeChanges, Signals
    from .simulation.trajectory import Trajectory
    from .studies.compare.result import ComparisonResult
    from .studies.compare.study import Comparison
    from .studies.curve.result import CurveResult
    from .studies.decay.result import DecayResult
    from .studies.fit.result import FitResult
    from .studies.motion_map.result import Edge, MapResult
    from .studies.orbit.result import OrbitResult, SpecialPoint
    from .studies.precision.result import PrecisionResult
    from .studies.run.result import RunResult
    from .studies.sensitivity.result import SensitivityEvent, SensitivityResult
    from .studies.stability.result import StabilityResult
    from .studies.sweep.result import SweepResult

    __version__: str
    """Version of the installed project."""

__all__ = [
    "Comparison",
    "ComparisonResult",
    "CurveIdentification",
    "CurveResult",
    "DecayIdentification",
    "DecayResult",
    "Edge",
    "FitResult",
    "FmuDescription",
    "HarnessError",
    "MapResult",
    "ModeChanges",
    "Motion",
    "MotionMeasures",
    "OrbitResult",
    "ParameterFit",
    "PrecisionResult",
    "Record",
    "RunResult",
    "SceneError",
    "SensitivityEvent",
    "SensitivityResult",
    "Signals",
    "SpecialPoint",
    "StabilityResult",
    "SweepResult",
    "Trajectory",
    "__version__",
    "compare",
    "describe",
    "fit",
    "identify_curve",
    "identify_decay",
    "load_result",
    "map_motions",
    "measure",
    "orbit",
    "read_record",
    "sensitivity",
    "simulate",
    "sweep",
]

# Types of results: loaded on first use, because they import numpy, which `--help` does not need.
TYPES = {
    "Comparison": "harness.studies.compare.study",
    "ComparisonResult": "harness.studies.compare.result",
    "CurveIdentification": "harness.analyses.curve.identification",
    "CurveResult": "harness.studies.curve.result",
    "FitResult": "harness.studies.fit.result",
    "FmuDescription": "harness.simulation.fmu_variables",
    "DecayIdentification": "harness.analyses.decay.identification",
    "DecayResult": "harness.studies.decay.result",
    "ModeChanges": "harness.simulation.signals",
    "MotionMeasures": "harness.analyses.motion",
    "Edge": "harness.studies.motion_map.result",
    "MapResult": "harness.studies.motion_map.result",
    "Motion": "harness.simulation.motion",
    "OrbitResult": "harness.studies.orbit.result",
    "SpecialPoint": "harness.studies.orbit.result",
    "ParameterFit": "harness.analyses.fit.parameter_fit",
    "PrecisionResult": "harness.studies.precision.result",
    "Record": "harness.records.record",
    "SensitivityEvent": "harness.studies.sensitivity.result",
    "SensitivityResult": "harness.studies.sensitivity.result",
    "RunResult": "harness.studies.run.result",
    "Signals": "harness.simulation.signals",
    "StabilityResult": "harness.studies.stability.result",
    "SweepResult": "harness.studies.sweep.result",
    "Trajectory": "harness.simulation.trajectory",
}


def __getattr__(name: str) -> Any:
    if name in TYPES:
        return getattr(import_module(TYPES[name]), name)
    if name == "__version__":
        from .results.provenance import HARNESS, package_version

        return package_version(HARNESS)
    raise AttributeError(f"module 'harness' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
