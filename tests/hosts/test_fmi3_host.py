"""The FMI 3.0 FMUs in a host written in C, without Python: fmi3_host.c, by the system's compiler."""

import fmi3_hosts
import pytest
from models import MODELS, model_class, outputs
from native_host import SOURCE3, host, lives

LIVES, STEPS = 100, 20
fmus, worker, _workers = fmi3_hosts.FIXTURES


@pytest.mark.parametrize("name", MODELS)
def test_a_hundred_lives_in_a_host_that_is_not_python(worker, fmus, name):
    """Its last values are those that fmpy gets, to the last bit."""
    program, library = [host(source=SOURCE3)], f"x86_64-linux/{name}.so"
    (solving, solved), said = lives(program, fmus / f"{name}.fmu", library, LIVES, STEPS)
    stop, (x, v, *_) = model_class(name).stop_time, outputs(name)
    h = stop / STEPS
    times = [i * h for i in range(STEPS)]
    fmu = worker.instantiate(fmus / f"{name}.fmu").begin()
    for t in times:
        fmu.step(t, h)
    assert fmu.get(x, v) == solving
    fmu.free()
    fmu = worker.exchange(fmus / f"{name}.fmu").begin()
    fmu.update()
    fmu.go_on()
    for t in times:
        states = [a + h * rate for a, rate in zip(fmu.where(), fmu.rates(), strict=True)]
        fmu.place(t + h, states)
        fmu.event()
        fmu.update()
        fmu.go_on()
    assert fmu.get(x, v) == solved
    fmu.free()

    assert [line for line in said if not line.startswith("log")] != []
    assert all("m = -1.0" in line for line in said)
    assert len(said) == 2  # in the log and on standard error
