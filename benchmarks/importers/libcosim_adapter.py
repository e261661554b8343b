"""Adapter of libcosim (package libcosimpy), which has no reset: a rerun is a new execution."""

from importlib.metadata import version

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from .request import ImporterReply, ImporterRequest

NANO = 1e9  # libcosim counts time in ns


def run_request(request: ImporterRequest) -> ImporterReply:
    log_output_level(CosimLogLevel.ERROR)
    rows, n_accepted = run(request, request.run.values, request.midrun_changes)
    rerun = run(request, {}, {})[0] if request.rerun else []
    return ImporterReply(version("libcosimpy"), rows, rerun, n_accepted)


def run(
    request: ImporterRequest, values: dict[str, float], midrun_changes: dict[str, float]
) -> tuple[list[list[float]], int]:
    """Return the rows of one run, the last one repeated after a rejected step, and the number of accepted steps."""
    references = request.references
    execution = CosimExecution.from_step_size(round(request.step * NANO))
    slaves = [CosimLocalSlave(str(request.run.fmu), name) for name in request.instances]
    indices = [execution.add_local_slave(slave) for slave in slaves]
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    execution.add_observer(observer)
    execution.add_manipulator(manipulator)
    for name, value in values.items():
        execution.real_initial_value(indices[0], references[name], value)
    if request.connection:
        source, sink = (references[name] for name in request.connection)
        execution.connect_real_variables(indices[0], source, indices[1], sink)
    output_references = [references[name] for name in request.run.outputs]

    def row() -> list[float]:
        return [value for index in indices for value in observer.last_real_values(index, output_references)]

    rows, n_accepted = [row()], 0
    for i in range(request.steps):
        if i == request.steps // 2 and midrun_changes:
            names, new = list(midrun_changes), list(midrun_changes.values())
            manipulator.slave_real_values(indices[0], [references[name] for name in names], new)
        n_accepted += execution.step(1)
        rows.append(row())
    return rows, n_accepted
