"""Models under changes of time, unit, sign, order, frame and largest step; their FMUs are built once per test run."""

from contextlib import ExitStack
from functools import cache
from hashlib import sha256

import build_cache
from fmi3_fixtures import build_fmi3_fmus
from models import MODELS
from native_fmus import build_native_fmus

from benchmarks.symmetry.builds import FMI3, NATIVE, PYTHON, all_models, build_fmu, find_source, model_label
from benchmarks.symmetry.changes import FRAME, LARGEST_STEP, MIRROR, ORDER, REVOLUTIONS, TIME, UNITS
from benchmarks.symmetry.command import describe
from benchmarks.symmetry.study import Model, Options, run_model

LABELS = [model_label(path) for path in all_models()]
KINDS = (TIME, UNITS, MIRROR, ORDER, FRAME, LARGEST_STEP, REVOLUTIONS)
FMU_BUILDERS = {
    PYTHON: build_cache.build_once,
    NATIVE: build_native_fmus,
    FMI3: build_fmi3_fmus,
}


def build(source, backend):
    """Return the FMU of a model file; that of other tests for the five models."""
    if source == find_source(source.stem if source.stem in LABELS else str(source)) and source.stem in MODELS:
        return FMU_BUILDERS[backend]() / f"{source.stem}.fmu"

    def make(folder):
        build_fmu(folder, source, backend)

    digest = sha256(source.read_bytes()).hexdigest()[:12]
    (fmu,) = build_cache.keep_build(f"symmetry-{source.stem}-{digest}-{backend}", make).rglob("*.fmu")
    return fmu


def examine(label, backend=PYTHON, kinds=KINDS, methods=(), **options):
    """Return the runs, as (method, law), that were examined by symmetry, and the first differences."""
    outcomes = run_model(find_source(label), backend, build, kinds, methods, Options(**options))
    examined_runs = {}
    for outcome in outcomes:
        if not outcome.reason:
            examined_runs.setdefault(outcome.kind, set()).add((outcome.method, outcome.law))
    return examined_runs, [describe(outcome) for outcome in outcomes if outcome.difference]


@cache
def open_model(label):
    """Return the Python FMUs of a model, open until the process ends."""
    return Model(find_source(label), PYTHON, build, KINDS, Options(), ExitStack())
