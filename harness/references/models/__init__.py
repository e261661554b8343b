"""The models that are written a second time, each in the file of its name: its problems as peers solve them, the cases
that are certified (CASES), its true motion in pieces for any values, and where there are any its closed forms (CLOSED).
"""

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from ..certified_reference import ReferenceCase

MODEL_MODULES: dict[str, Any] = {file.name: import_module(f"{__name__}.{file.name}") for file in iter_modules(__path__)}
MODELS = tuple(MODEL_MODULES)
CASES: tuple[ReferenceCase, ...] = tuple(case for each in MODEL_MODULES.values() for case in each.CASES)
