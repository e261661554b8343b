"""Derivatives of the outputs of runs of one FMU of this project that differ in values of Reals only."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import HarnessError
from ..scenes.run_spec import RunSpec
from .fmu_archive import is_own, read_leniently, unpack_once
from .fmu_instance import CALL_FAILURES, FmuInstance
from .native_equivalent import check_has_events
from .variational import VariationalRun, has_derivatives, state_variables

RTOL = 1e-7  # of derivatives that a search for a minimum uses
MAX_PREPARED = 16  # runs
MAX_STEPS = 1000  # more are those of stiff equations or of sampled inputs, whose derivatives cost less by differences


class DerivativeRuns:
    """Runs with derivatives through events, in one instance for model exchange.

    Parameters
    ----------
    spec : RunSpec
        Settings that all runs share: the FMU, the outputs, and values of variables of any type.

    Attributes
    ----------
    n_runs : int
        Number of runs up to now.
    """

    def __init__(self, spec: RunSpec) -> None:
        folder = unpack_once(spec.fmu)
        self.folder, self.n_runs, self.is_slow = Path(folder), 0, False
        self.instance: FmuInstance | None = None
        self.prepared_runs: dict[int, tuple[RunSpec, VariationalRun]] = {}
        description = read_leniently(folder)
        variables = {variable.name: variable for variable in description.modelVariables}
        outputs = [*(unknown.variable for unknown in description.outputs), *state_variables(description)]
        exist = is_own(description) and description.modelExchange is not None and has_derivatives(self.folder)
        if exist and {output.name for output in outputs}.issuperset(spec.outputs):
            try:
                check_has_events(spec.fmu, variables, spec.values)
                self.instance = FmuInstance(description, folder, exchange=True, name=spec.model)
            except HarnessError:  # a law without events, or an FMU that cannot be loaded
                return

    def differentiate(
        self, spec: RunSpec, names: Sequence[str], values: Mapping[str, float]
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the outputs (times, outputs) of a run, and their derivatives (times, names, outputs).

        None if one does not exist, as after a graze, or the FMU has none. At the time of an event that is also one of
        the run, they are those of one side.
        """
        if self.instance is None or self.is_slow:
            return None
        self.n_runs += 1
        run = self.prepare(spec, names, values)
        try:
            solution = run.solve()
        except (HarnessError, *CALL_FAILURES):
            self.is_slow = run.run.n_steps >= MAX_STEPS
            return None
        slopes = np.where(np.isnan(solution.left), solution.right, solution.left)
        is_complete = all(item.is_moment for item in solution.undefined_derivatives) and np.isfinite(slopes).all()
        return (solution.values, slopes) if is_complete else None

    def prepare(self, spec: RunSpec, names: Sequence[str], values: Mapping[str, float]) -> VariationalRun:
        """Return a run with other values; what it needs is prepared once for each specification."""
        if id(spec) not in self.prepared_runs:
            if len(self.prepared_runs) >= MAX_PREPARED:
                self.prepared_runs.clear()
            assert self.instance is not None
            run = VariationalRun(self.instance, self.folder, replace(spec, tolerance=RTOL), names, MAX_STEPS)
            self.prepared_runs[id(spec)] = spec, run  # the specification is kept, because it is known by its address
        run = self.prepared_runs[id(spec)][1]
        run.change_values(values)
        return run

    def close(self) -> None:
        """Free the instance."""
        if self.instance:
            self.instance.close()
