"""Independent implementations of models, one module each.

A module provides the problems for peer solvers, CASES with certified references, the function `solve_segments`, which
returns the motion for any parameter values, and CLOSED_FORMS if the model has any.
"""

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from ..certified_reference import ReferenceCase

MODEL_MODULES: dict[str, Any] = {file.name: import_module(f"{__name__}.{file.name}") for file in iter_modules(__path__)}
MODELS = tuple(MODEL_MODULES)
CASES: tuple[ReferenceCase, ...] = tuple(case for module in MODEL_MODULES.values() for case in module.CASES)
