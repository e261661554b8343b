"""Fixtures of model exchange: the FMI 3.0 FMUs, and instances that a test integrates."""

import fmi3_fixtures
import pytest

from tests.model_exchange.model_exchange_client import BREAKAWAY_TIME, DRIVER, DRY, handle_event_at

fmus = fmi3_fixtures.fmus


@pytest.fixture
def launch(worker, fmus):
    """Return launch(name, values), which creates an instance in its first event mode; freed when the test ends."""
    instances = []

    def launch(name, values=None):
        instances.append(worker.exchange(fmus / f"{name}.fmu"))
        return instances[-1].begin(values)

    yield launch
    for instance in instances:
        if worker.alive:
            instance.free()


@pytest.fixture
def launch_moving(launch):
    """Return launch_moving(name): an instance in continuous-time mode, slipping if friction is dry, and a time and
    states for it."""

    def launch_moving(name):
        fmu = launch(name)
        fmu.update_discrete_states()
        fmu.enter_continuous_time()
        if name == "stickslip":
            handle_event_at(fmu, BREAKAWAY_TIME * (1.0 + 1e-12), [0.0, 0.0, DRIVER * BREAKAWAY_TIME * (1.0 + 1e-12)])
            fmu.enter_continuous_time()
            return fmu, 4.4, [0.01, 0.1, DRIVER * 4.4]
        x, _, *driver = fmu.get_states()
        speed = -0.3 if name in DRY else 0.3  # released from x0 > 0 a mass slides backward
        return fmu, 0.1, [0.8 * x, speed, *(DRIVER * 0.1 for _ in driver)]

    return launch_moving
