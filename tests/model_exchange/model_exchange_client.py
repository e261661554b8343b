"""Helpers to call a model-exchange instance step by step, as a solver does."""

from models import MODELS, outputs

M, K, MU_S, MU_D, G, DRIVER = 12.5, 742.5, 0.9, 0.6, 9.81, 0.034  # the sled, SI
HOLD, SLIDE = MU_S * M * G, MU_D * M * G
BREAKAWAY_TIME = HOLD / (K * DRIVER)
DRY = [name for name in MODELS if "mode" in outputs(name)]
DRIVEN_MODELS = [name for name in MODELS if "x_driver" in outputs(name)]
ERROR = 3


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
