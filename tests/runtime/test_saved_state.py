"""Saving and restoring the FMU state, in memory and serialised, continues bit for bit."""

import random
from itertools import cycle

import pytest
from models import counts, declarations_of, each_case, label, outputs, push
from row_comparison import assert_identical
from worker_client import FmiError


def wander(fmu, name, t, stop):
    """Leave the trajectory: other forces, other steps, a look ahead."""
    force, size = push(name)
    fmu.set({force: size})
    fmu.run([t, t + (stop - t) / 50, t + (stop - t) / 15], [])
    fmu.set({force: -size})
    fmu.get("solver.t_next")


@each_case
def test_a_restored_state_continues_bit_for_bit(launch, worker, fmus, case):
    """At random points and at one of every mode; after a look ahead or not; in this instance, another, and a fresh
    one."""
    name, values, stop = case
    names = outputs(name) + counts(name) + ["solver.t_next"]
    draw = random.Random(label(case))
    times = [0.0, *sorted(draw.uniform(0.0, stop) for _ in range(59)), stop]
    expected = launch(name, values, stop=stop).run(times, names)
    indices = {0, *draw.sample(range(1, 56), 4)}
    if "mode" in names:
        modes = [row[names.index("mode")] for row in expected]
        indices |= {draw.choice([i for i, m in enumerate(modes[:56]) if m == mode]) for mode in set(modes[:56])}

    force, size = push(name)
    other = launch(name, {force: size / 2, outputs(name)[0] + "0": 0.02}, start=-1.0, stop=99.0)
    raw = worker.instantiate(fmus / f"{name}.fmu")
    fmu, t, reads_ahead, others = launch(name, values, stop=stop), 0, False, cycle((other, raw))
    for i in sorted(indices):
        rows = fmu.run(times[t : i + 1], names if reads_ahead else names[:-1])
        state = fmu.save()
        wander(fmu, name, times[i], stop)
        fmu.restore(state)
        assert_identical(fmu.run(times[i:], names), expected[i:], names)
        text = fmu.serialize(state)
        other = next(others)
        other.restore(other.deserialize(text))
        assert_identical(other.run(times[i:], names), expected[i:], names)
        fmu.restore(state)
        assert_identical([row[: len(names) - 1] for row in rows], [row[:-1] for row in expected[t : i + 1]], names[:-1])
        t, reads_ahead = i, not reads_ahead
    raw.free()


@each_case
def test_a_state_includes_parameters_not_yet_effective(launch, case):
    name, values, stop = case
    everything, times = list(declarations_of(name)), [0.0, 0.1 * stop, 0.2 * stop]
    force, size = push(name)
    fmu = launch(name, values, stop=stop)
    fmu.run(times[:2], [])
    fmu.set({force: size / 3})
    state = fmu.save()
    expected = fmu.run(times[1:], everything)
    fmu.set({force: size, "g" if "g" in everything else "k": 3.0})
    fmu.run([times[2], 0.21 * stop], everything)
    fmu.restore(state)
    assert_identical(fmu.run(times[1:], everything), expected, everything)


@each_case
def test_a_restored_state_recovers_from_a_failure_and_restores_a_pending_one(launch, case):
    """The load is so large that the motion overflows."""
    name, values, stop = case
    names, times = outputs(name) + counts(name), [0.0, 0.1 * stop, 0.2 * stop]
    force, _ = push(name)
    fmu = launch(name, values, stop=stop)
    expected = fmu.run(times, names)
    fmu = launch(name, values, stop=stop)
    fmu.run(times[:2], [])
    good = fmu.save()
    fmu.set({force: 1e300, "m": 1e-300})
    bad = fmu.save()
    with pytest.raises(FmiError):
        fmu.step(times[1], 0.1)
    fmu.restore(good)
    assert_identical(fmu.run(times[1:], names), expected[1:], names)
    fmu.restore(bad)
    with pytest.raises(FmiError):
        fmu.step(times[1], 0.1)
