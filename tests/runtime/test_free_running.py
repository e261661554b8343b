"""The solver steps freely: communication points, looks ahead and repeated settings do not change the solution."""

import random
from math import cos, inf, nextafter, sin

import pytest
from internal_steps import compute_step, prepared_run
from models import (
    CASES,
    DOP853,
    EXACT,
    FEW_CASES,
    SIGN,
    THRESHOLD,
    counts,
    declarations_of,
    each_case,
    label,
    model_class,
    outputs,
    parameters,
    push,
    tunable,
)
from row_comparison import assert_close, assert_identical

CHATTER = 1e-6  # m/s: at smaller speeds the threshold law treats the mass as stuck
SLED = [case for case in FEW_CASES if "x_driver" in outputs(case[0])]


@pytest.fixture(scope="module")
def cache():
    """Cache of the results of `following`."""
    return {}


@pytest.fixture
def following(launch, cache):
    """Return following(case): the ends of all internal steps, with counters and step sizes."""

    def following(case):
        name, values, stop = case
        if label(case) not in cache:
            cache[label(case)] = launch(name, values, stop=stop).follow(0.0, stop, ["solver.steps", "solver.h"])
        return cache[label(case)]

    return following


GRIDS = [*((case, False) for case in CASES), *((case, True) for case in FEW_CASES)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "has_pushes"), GRIDS, ids=lambda part: str(part) if isinstance(part, bool) else label(part)
)
def test_any_two_communication_grids_agree(launch, following, case, has_pushes):
    name, values, stop = case
    names, draw = outputs(name) + counts(name), random.Random(label(case))
    common_times = [0.0, *sorted(draw.uniform(0.0, stop) for _ in range(25)), stop]
    force, size = push(name)
    changes = {common_times[i]: {force: sign * size} for i, sign in ((6, 1), (11, -1), (17, 0))} if has_pushes else {}

    def solve(*extra):
        times = sorted({*common_times, *extra})
        fmu = launch(name, values, stop=stop)
        rows = fmu.run_with_changes(times, names, changes)
        fmu.free()
        return [row for t, row in zip(times, rows, strict=True) if t in set(common_times)]

    expected = solve()
    internal, _ = following(case)
    straddling = [t + d for t in internal[1:-1:5] for d in (-1e-9, 1e-9)] + [
        nextafter(t, stop) for t in internal[1:-1:7]
    ]
    times_between = [stop * i / 97 for i in range(97)] + [draw.uniform(0.0, stop) for _ in range(200)]
    for extra in (internal, [*straddling, *times_between]):
        assert_close(solve(*extra), expected, names, 1e-12)
    if not has_pushes:
        assert_close(launch(name, values, stop=stop).run([0.0, stop], names)[-1:], expected[-1:], names, 1e-12)


@each_case
def test_reading_changes_nothing_at_any_time(worker, fmus, case):
    name, values, stop = case
    names = outputs(name) + counts(name)
    times = [stop * i / 150 for i in range(151)]
    silent, curious = (worker.instantiate(fmus / f"{name}.fmu") for _ in range(2))
    expected = silent.begin(values, stop=stop).run(times, names)
    everything = list(declarations_of(name))
    curious.get(*everything)
    curious.set(values)
    curious.get(*everything)
    curious.setup(0.0, stop, None)
    curious.get(*everything)
    curious.init()
    rows = [row[: len(names)] for row in curious.run(times, [*names, *reversed(everything), "solver.t_next"])]
    assert_identical(rows, expected, names)
    silent.free()
    curious.free()


@each_case
def test_a_change_at_the_end_of_an_internal_step_discards_the_lookahead(launch, following, case):
    name, values, stop = case
    names = outputs(name) + counts(name)
    internal, _ = following(case)
    t, (force, size) = internal[len(internal) // 3], push(name)
    runs = []
    for reads_ahead in (False, True):
        fmu = launch(name, values, stop=stop)
        fmu.run([0.0, t][: 1 + (t > 0.0)], [])
        if reads_ahead:
            fmu.get("solver.t_next")
        fmu.set({force: size})
        runs.append(fmu.run([t, t + 0.001, t + 0.05 * (stop - t)], names))
    assert_identical(runs[1], runs[0], names)


@each_case
def test_the_effective_step_size_is_finite_and_unaffected_by_lookahead_and_setting(launch, case):
    name, values, stop = case
    force, size = push(name)
    for share in (0.0, 0.3, 0.7):
        fmu, t = launch(name, values), share * stop
        fmu.run([0.0, t][: 1 + (t > 0.0)], [])
        step_size = fmu.get("solver.h")
        assert 0.0 <= step_size < inf
        assert (step_size > 0.0) == (t > 0.0)
        fmu.set({force: size})
        step_sizes = [fmu.get("solver.h"), fmu.get("solver.t_next", "solver.h")[1], fmu.get("solver.h")]
        assert step_sizes == [step_size] * 3


@each_case
def test_a_step_too_short_to_change_the_time_changes_nothing(launch, case):
    """At the ends of internal steps, which the closed form reaches with a compensation of rounding errors."""
    name, values, stop = case
    names, fmu, t = [*outputs(name), *counts(name), "solver.t_next"], launch(name, values, stop=stop), 0.0
    for _ in range(30):
        end = min(fmu.get("solver.t_next"), stop)
        if not t < end:
            break
        fmu.step(t, end - t)
        t, before = end, fmu.get(*names)
        fmu.step(t, 1e-30)
        assert_identical([fmu.get(*names)], [before], names)


@each_case
def test_setting_a_value_to_itself_changes_nothing(launch, case):
    name, values, stop = case
    names = outputs(name) + counts(name)
    times = [stop * i / 60 for i in range(61)]
    expected = launch(name, values, stop=stop).run(times, names)
    fmu = launch(name, values, stop=stop)
    current_values = dict(zip(tunable(name), fmu.get(*tunable(name)), strict=True))
    assert_identical(fmu.run_with_changes(times, names, dict.fromkeys(times[1:-1], current_values)), expected, names)


@each_case
def test_following_t_next_shows_every_internal_step(following, case):
    times, rows = following(case)
    assert times[-1] == case[-1]
    assert [steps for steps, _ in rows] == list(range(len(times)))
    assert all(h == b - a for a, b, (_, h) in zip(times[:-1], times[1:], rows[1:], strict=True))


@pytest.mark.parametrize("case", [c for c in FEW_CASES if c[1].get("friction") == 1], ids=label)
def test_a_step_ending_within_rounding_of_an_event_ends_at_it(launch, case):
    name, values, stop = case
    fmu, t, ulp = launch(name, values, stop=stop), 0.0, 0
    while t < stop:
        ahead, count = fmu.get("solver.t_next", "events.count")
        fmu.step(t, ahead + ulp * (nextafter(ahead, stop) - ahead) - t)
        now, speed = fmu.get("events.count", outputs(name)[1])
        assert now == count or speed == 0.0
        t, ulp = ahead, (0, 1, -1)[now % 3] if ahead < 0.9 * stop else 0
    assert count >= 3


@pytest.mark.parametrize("case", [c for c in FEW_CASES if c[1].get("friction", 1) == 1], ids=label)
def test_a_later_start_time_only_shifts_the_motion(launch, case):
    """Without laws that chatter, where rounding of the time decides."""
    name, values, stop = case
    names = outputs(name)[:2]
    times = [stop * i / 80 for i in range(81)]
    early = launch(name, values, stop=stop).run(times, names)
    late = launch(name, values, start=7.3, stop=7.3 + stop).run([7.3 + t for t in times], names)
    assert_close(late, early, names, 1e-12 if values["solver.method"] == EXACT else 1e-5)


@pytest.mark.parametrize("case", SLED, ids=label)
def test_a_changed_driver_speed_causes_no_jump(launch, case):
    name, values, _stop = case
    fmu = launch(name, values, start=7.3, stop=23.3)
    names = [v for v in outputs(name) if v in ("x", "v", "x_driver", "F_spring", "energy")]
    fmu.run([7.3, 11.9], names)
    before = fmu.get(*names)
    fmu.set({"v_driver": -1.0})
    assert fmu.get(*names) == before
    (_, after) = fmu.run([11.9, 11.9 + 1e-9], names)
    assert after == pytest.approx(before, abs=1e-5)
    assert fmu.get("x_driver") == pytest.approx(before[names.index("x_driver")] - 1e-9, abs=1e-15)
    assert before[names.index("x_driver")] == pytest.approx(0.034 * 4.6, rel=1e-12)


@each_case
def test_a_run_without_stop_time_continues(launch, case):
    name, values, stop = case
    names = outputs(name)[:2]
    times = [stop * i / 40 for i in range(41)]
    rows = launch(name, values).run(times, names)
    if values["solver.method"] == EXACT:
        assert_close(rows, launch(name, values, stop=stop).run(times, names), names, 1e-12)
    assert all(value == value for row in rows for value in row)


def test_the_last_internal_step_ends_at_the_stop_time_without_another_one():
    """With long steps, the size of the last one is rounded."""
    draw = random.Random(1)
    for _ in range(100):
        model, start, stop = model_class("smd")(), draw.choice([0.0, draw.uniform(-1.0, 0.0)]), draw.uniform(0.5, 3.0)
        run = prepared_run(model, {"solver.method": DOP853, "solver.h_max": 1e3, "k": 1.0})
        solver = run.solver
        solver.start(model, start, *model.initial_state(start), stop, 1e-3)
        step = solver.step
        while step.t1 < step.t_end:
            compute_step(model, run)
        assert step.t1 == step.t_end == stop - start
        assert step.t1 - step.t0 > 1e-3


@each_case
def test_outputs_satisfy_force_and_energy_balance(launch, case):
    """Forces give the acceleration, and the energy is that of the state, at every point, including the start."""
    name, values, stop = case
    force, size = push(name)
    fmu = launch(name, {**values, force: size / 50}, stop=stop)
    value = dict(zip(parameters(name), fmu.get(*parameters(name)), strict=True))
    for row in fmu.run([stop * i / 200 for i in range(201)], outputs(name)):
        readings = dict(zip(outputs(name), row, strict=True))
        if name == "pendulum":
            weight, inertia = value["m"] * value["g"] * value["a"], value["J_G"] + value["m"] * value["a"] ** 2
            drive = value["T_ext"] - weight * sin(readings["theta"]) - readings["T_friction"]
            assert inertia * readings["alpha"] == pytest.approx(drive, rel=1e-9, abs=1e-14)
            energy = inertia * readings["omega"] ** 2 / 2 + weight * (1 - cos(readings["theta"]))
        else:
            forces = ("F_spring", "F_damper")
            drive = value["F_ext"] + sum(readings.get(f, 0.0) for f in forces) - readings.get("F_friction", 0.0)
            drive -= value.get("c", 0.0) * readings["v"] if "F_damper" not in readings else 0.0
            stretch = readings.get("x_driver", 0.0) - readings["x"]
            assert readings["F_spring"] == pytest.approx(value["k"] * stretch, rel=1e-12, abs=1e-12)
            assert value["m"] * readings["a"] == pytest.approx(drive, rel=1e-9, abs=1e-11)
            energy = value["m"] * readings["v"] ** 2 / 2 + value["k"] * stretch**2 / 2
        assert readings["energy"] == pytest.approx(energy, rel=1e-9, abs=1e-14)
        if "mode" in readings and values.get("friction") not in (SIGN, THRESHOLD):  # whose modes are those of the steps
            _, speed, acceleration = row[:3]
            assert readings["mode"] * speed > 0 or readings["mode"] * acceleration >= 0 == speed or abs(speed) < CHATTER
