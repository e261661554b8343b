"""The FMI 3.0 FMUs in a host without Python: fmi3_host.c, compiled by the system's compiler."""

import fmi3_fixtures
import pytest
from models import MODELS, model_class, outputs
from native_host import FMI3_HOST_SOURCE, host_program, run_life_cycles

LIVES, STEPS = 100, 20
fmus = fmi3_fixtures.fmus


@pytest.mark.parametrize("name", MODELS)
def test_a_hundred_life_cycles_in_a_host_without_python(worker, fmus, name):
    """The final values agree with those of fmpy bit for bit."""
    program, library = [host_program(source=FMI3_HOST_SOURCE)], f"x86_64-linux/{name}.so"
    (co_simulation, model_exchange), stderr = run_life_cycles(program, fmus / f"{name}.fmu", library, LIVES, STEPS)
    stop, (x, v, *_) = model_class(name).stop_time, outputs(name)
    h = stop / STEPS
    times = [i * h for i in range(STEPS)]
    fmu = worker.instantiate(fmus / f"{name}.fmu").begin()
    for t in times:
        fmu.step(t, h)
    assert fmu.get(x, v) == co_simulation
    fmu.free()
    fmu = worker.exchange(fmus / f"{name}.fmu").begin()
    fmu.update_discrete_states()
    fmu.enter_continuous_time()
    for t in times:
        states = [a + h * rate for a, rate in zip(fmu.get_states(), fmu.rates(), strict=True)]
        fmu.set_point(t + h, states)
        fmu.enter_event_mode()
        fmu.update_discrete_states()
        fmu.enter_continuous_time()
    assert fmu.get(x, v) == model_exchange
    fmu.free()

    assert [line for line in stderr if not line.startswith("log")] != []
    assert all("m = -1.0" in line for line in stderr)
    assert len(stderr) == 2  # in the log and on standard error
