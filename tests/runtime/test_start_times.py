"""A motion depends neither on the time at which it starts, nor on how long the run already lasts."""

from collections import Counter
from itertools import pairwise
from math import ulp

import pytest
from build_cache import build_once
from models import scalar_class
from native_fmus import require_compiler
from variants import campaign_after, slow_after
from worker_client import FmiError

STARTS = (1.0, 1e6, -1e3)
PLACES = 4  # units in the last place of the time
KINDS = {"python": (), "native": ("--native", "--platform", "linux64")}


@pytest.fixture(params=slow_after(1, KINDS))
def kind(request):
    if request.param == "native":
        require_compiler()
    return request.param


def build_fmu(name, kind):
    return build_once(name, *KINDS[kind]) / f"{name}.fmu"


def follow_events(fmu, start, stop, modes):
    """Return time and modes after every event of a run from internal step to internal step."""
    fmu.begin(start=start, stop=stop)
    _times, rows = fmu.follow(start, stop, ["events.count", "events.t_last", *modes])
    return [after[1:] for before, after in pairwise(rows) if after[0] != before[0]]


@pytest.mark.parametrize("name", campaign_after(2, ["joint", "belt", "clutch", "forced", "sleds", "stacked"]))
def test_events_are_the_same_from_any_start_time(worker, name, kind):
    model = scalar_class(name)
    modes = [*model().contacts]
    first, *others = (
        follow_events(worker.instantiate(build_fmu(name, kind)), start, start + model.stop_time, modes)
        for start in (0.0, *STARTS)
    )
    assert len(first) >= 5
    for start, events in zip(STARTS, others, strict=True):
        assert [row[1:] for row in events] == [row[1:] for row in first]
        last_place = ulp(max(abs(start), abs(start + model.stop_time)))
        assert all(
            abs(t - start - time) <= PLACES * last_place for (t, *_), (time, *_) in zip(events, first, strict=True)
        )


@pytest.mark.slow
def test_every_period_of_a_long_run_has_the_same_events(worker):
    """The motor of the joint comes to rest in every period, however late in the run."""
    require_compiler()
    period, stop = 2.0, 300.0
    events = follow_events(worker.instantiate(build_fmu("joint", "native")), 0.0, stop, ["mode_m", "mode_l"])
    counts = Counter(t // period for t, *_ in events)
    assert {counts[n] for n in range(2, int(stop / period) - 1)} == {8}


def test_events_that_a_late_time_cannot_tell_apart_are_passed_in_order(worker, kind):
    """At 1e15 s, whose neighbours are 1/8 s away, solver.t_next still leads to the stop time."""
    start, stop = 1e15, 1e15 + 8.0
    modes = [*scalar_class("stacked")().contacts]
    late = follow_events(worker.instantiate(build_fmu("stacked", kind)), start, stop, modes)
    assert late
    assert all(start <= t <= stop for t, *_ in late)
    assert [row[0] for row in late] == sorted(row[0] for row in late)


def test_messages_and_statistics_name_the_time_of_the_importer(worker, kind):
    fmu = worker.instantiate(build_fmu("sleds", kind))
    fmu.begin(start=1000.0, stop=1002.0)
    assert fmu.get("events.t_last") == 1000.0
    fmu.step(1000.0, 0.5)
    assert 1000.5 < fmu.get("solver.t_next") <= 1002.0
    with pytest.raises(FmiError):
        fmu.step(1001.0, 0.5)
    message = worker.read_stderr()
    assert "from t = 1001.0 s is refused" in message
    assert "start at the current time, t = 1000.5 s, and end by the stop time, t = 1002.0 s" in message
