"""Fixtures and helpers to call a model-exchange instance step by step, as a solver does."""

import fmi3_fixtures
import pytest
from models import MODELS, outputs

M, K, MU_S, MU_D, G, DRIVER = 12.5, 742.5, 0.9, 0.6, 9.81, 0.034  # the sled, SI
HOLD, SLIDE = MU_S * M * G, MU_D * M * G
BREAKAWAY_TIME = HOLD / (K * DRIVER)
DRY = [name for name in MODELS if "mode" in outputs(name)]
DRIVEN = [name for name in MODELS if "x_driver" in outputs(name)]
ERROR = 3


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


def handle_event_at(fmu, t, states):
    """Move to a point, handle an event there, and return its flags."""
    fmu.set_point(t, states)
    fmu.enter_event_mode()
    return fmu.update_discrete_states()


def single_error(fmu):
    """Return the single error message in the log and on standard error, or "" if there is none."""
    messages = [message for message in fmu.messages() if message[0] != 0]
    lines = fmu.worker.read_stderr().splitlines()
    assert len(messages) == len(lines) <= 1
    if not messages:
        return ""
    ((status, category, text),) = messages
    assert (status, category) == (ERROR, "logStatusError")
    assert lines[0].endswith(text)
    return text


FIXTURES = fmi3_fixtures.fmus, launch, launch_moving
