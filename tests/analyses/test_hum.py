"""Hum is subtracted from a record, so that values and intervals are those of the record without it."""

import re

import numpy as np
import pytest
from decays import decay_record, identify, remarks_text, values
from variants import slow_after

T = np.linspace(0.0, 12.0, 4801)
LAW = {"zeta": 0.005, "r": 2e-4, "t": T, "noise": 1e-4}  # about 2 Hz, with a first amplitude of 0.1
TRUTH = {"omega": 12.566, "zeta": 0.005, "r": 2e-4, "b": 0.0}


def with_hum(record, size, frequency=50.0):
    """Return the record with a hum and its third harmonic."""
    phase = 2 * np.pi * frequency * record.t + 1.0
    return record._replace(x=record.x + size * (np.sin(phase) + 0.3 * np.sin(3 * phase)))


def widths(fit):
    return np.array([fit[name].high - fit[name].low for name in TRUTH])


@pytest.mark.parametrize(
    ("size", "times"), slow_after(1, [(1e-4, "even"), (0.03, "even"), (1e-4, "uneven"), (1e-3, "uneven")])
)
def test_values_and_intervals_are_those_without_hum(size, times):
    record = decay_record(**LAW)
    if times == "uneven":
        keep = np.sort(np.random.default_rng(3).choice(len(T), 3400, replace=False))
        record = record._replace(t=record.t[keep], x=record.x[keep])
    clean, fit = identify(record), identify(with_hum(record, size))
    assert all(abs(fit[name].value - clean[name].value) < 0.1 * clean[name].error for name in ("omega", "zeta", "r"))
    assert widths(fit) == pytest.approx(widths(clean), rel=0.1)
    text = remarks_text(fit)
    lines = {
        frequency: float(amplitude) for amplitude, frequency in re.findall(r"amplitude of (\S+) m at (\S+) Hz", text)
    }
    assert lines == pytest.approx({"50": size, "150": 0.3 * size}, rel=0.1)
    assert "correlated" not in text


def test_hum_of_a_velocity_of_a_pendulum_is_subtracted():
    record = decay_record(**(LAW | {"a": 1.0, "r": 2e-3}), sine=True, order=1)
    fit = identify(with_hum(record, 0.05), pendulum=True)
    assert fit["r"].low <= 2e-3 <= fit["r"].high
    assert "0.05 rad/s" in remarks_text(fit)


@pytest.mark.slow
def test_the_start_time_does_not_matter():
    record = with_hum(decay_record(**LAW), 1e-3)
    fits = [identify(record._replace(t=record.t + start)) for start in (0.0, 4096.0)]
    first, later = (values(fit.estimates) for fit in fits)
    assert later == pytest.approx(first, rel=1e-5)


@pytest.mark.parametrize("motion", slow_after(1, ["noise", "distorted", "ringing"]))
def test_a_residual_that_belongs_to_the_motion_is_no_hum(motion):
    """A distorted motion has harmonics; a ringing fades."""
    record = decay_record(**LAW)
    added = {
        "noise": 0.0,
        "distorted": 0.01 * record.x**3 / 0.1**2,
        "ringing": 1e-3 * np.exp(-T / 2) * np.sin(2 * np.pi * 31.0 * T),
    }
    assert "Hum" not in remarks_text(identify(record._replace(x=record.x + added[motion])))


def test_hum_of_a_dense_record_has_its_own_frequency():
    """Not that of the averages over samples, to which the law is fitted."""
    record = decay_record(**(LAW | {"t": np.arange(0.0, 30.0, 0.001)}))
    fit = identify(with_hum(record, 2e-3, 60.0))
    text = remarks_text(fit)
    assert "are averaged over" in text
    assert "at 60 Hz" in text
    assert "correlated" not in text
    assert fit["r"].low <= 2e-4 <= fit["r"].high
