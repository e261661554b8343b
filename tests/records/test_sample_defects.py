"""Samples that are no measurements are named and left out: marks of missing samples, and a saturated sensor."""

import numpy as np
import pytest
from decays import Signal, decay_record, identify, random_record
from variants import slow_after

from harness import SceneError, read_record
from harness.records.samples import find_saturation, mark_dropouts, mark_sentinels, sort_times

T = np.linspace(0.0, 12.0, 2401)
ZETA = 0.0119


def swing(**options):
    return decay_record(ZETA, a=0.06, turn=0.0, rest=0.0, t=T, noise=2e-4, **options)


def read(folder, t, x):
    path = folder / "record.csv"
    rows = (f"{a:.6f},{b:.7g}" for a, b in zip(t, x, strict=True))
    path.write_text("t [s],x [mm]\n" + "\n".join(rows))
    return read_record(path)


def fit(record):
    return identify(Signal(record.t, record.x), drag=False)


@pytest.mark.parametrize("mark", [-9999.0, 9999.0, -32768.0, 1e30])
def test_marks_of_missing_samples_are_named_and_left_out(tmp_path, mark):
    x = 1e3 * swing().x
    missing = np.random.default_rng(2).choice(len(x), len(x) // 100, replace=False)
    x[missing] = mark
    record = read(tmp_path, T, x)
    assert f"24 of 2401 values of x are {mark:.15g}, far from all others" in record.notes[0]
    assert len(record.t) == len(x) - len(missing)
    result = fit(record)
    assert result["zeta"].value == pytest.approx(ZETA, rel=0.02)
    assert len(result.t) > 0.98 * len(record.t)


@pytest.mark.parametrize("mark", [0.0, -30.0, 59.0])
def test_a_mark_within_the_range_of_the_signal_is_left_out(tmp_path, mark):
    """As the zeros of a sensor that loses its target, singly and in a row."""
    x = 1e3 * swing().x
    missing = np.random.default_rng(2).choice(len(x), 24, replace=False)
    x[missing] = x[500:510] = mark
    record = read(tmp_path, T, x)
    count = len({*missing.tolist(), *range(500, 510)})
    assert f"{count} of 2401 values of x are {mark:.15g}, several times far from the samples" in record.notes[0]
    assert len(record.t) == len(x) - count
    assert fit(record)["zeta"].value == pytest.approx(ZETA, rel=0.02)


def test_two_marks_and_a_mark_among_the_times_are_left_out(tmp_path):
    x, t = 1e3 * swing().x, T.copy()
    x[100:110], x[500:505], t[[700, 900]] = -9999, 32767, -9999
    record = read(tmp_path, t, x)
    assert len(record.t) == len(x) - 17
    assert [note.split(",")[0] for note in record.notes] == [
        "2 of 2401 values of t [s] are -9999",
        "5 of 2401 values of x are 32767",
        "10 of 2401 values of x are -9999",
    ]


def test_a_single_mark_is_recognised_by_its_nines():
    signal = np.sin(np.arange(100.0))
    for value, is_mark in ((-999.0, True), (999.9, True), (99.0, False), (500.0, False)):
        values = np.append(signal, value)
        assert bool(mark_sentinels(values, "x")) == is_mark
        assert np.isnan(values[-1]) == is_mark


def test_too_many_marks_are_refused_by_name(tmp_path):
    x = 1e3 * swing().x
    x[::3] = -9999
    with pytest.raises(SceneError, match=r"801 of 2401 rows have no number for t \[s\] or x: 801 of .* are -9999"):
        read(tmp_path, T, x)


@pytest.mark.parametrize("values", [[0.0, 1.0] * 20, [0.0, 1.0, 2.0] * 20, [5.0] * 30, [np.nan] * 20, []])
def test_coarse_values_are_no_marks(values):
    assert mark_sentinels(np.array(values), "x") == []


@pytest.mark.parametrize(
    ("rest", "mark", "is_mark"),
    [
        ([0.0, 1.0, 2.0, 3.0], 6.0, False),
        ([0.0, 1.0, 2.0, 3.0], 6.1, True),
        ([0.0, 0.5, 1.0, 2.0, 5.0], 9.0, False),
        ([0.0, 0.5, 1.0, 2.0], -2.1, True),
    ],
)
def test_a_mark_is_farther_from_the_others_than_these_from_each_other(rest, mark, is_mark):
    for count in (1, 2):
        assert bool(mark_sentinels(np.array([*rest, *[mark] * count]), "x")) == (is_mark and count == 2)


@pytest.mark.parametrize(("jumps", "passes", "is_mark"), [(6, 0, True), (5, 0, False), (3, 12, True), (3, 13, False)])
def test_a_mark_within_the_range_is_the_most_frequent_value_and_jumps(jumps, passes, is_mark):
    """It jumps between two samples near 1, and passes between two of opposite sign."""
    values = [1.001]
    for i in range(80):
        a = 1 - i / 1000
        if i < jumps:
            values += [0.0, a]
        elif i < jumps + passes:
            values += [a, 0.0, -a + 1e-6]
        else:
            values += [a]
    notes = mark_dropouts(np.array(values), "x")
    assert bool(notes) == is_mark


def test_values_far_from_the_rest_only_as_the_rest_is_wide_are_no_marks():
    """Released from a displacement at which it was held, as long as all that follows is wide."""
    values = np.concatenate([np.full(50, 2.0), np.sin(np.arange(200.0))])
    assert mark_sentinels(values, "x") == []


@pytest.mark.parametrize("level", [0.8, 0.6, 0.4])
@pytest.mark.parametrize("sides", [1, 2])
def test_a_saturated_sensor_is_named_and_does_not_change_the_damping(tmp_path, level, sides):
    x = np.minimum(1e3 * swing().x, 60 * level)
    x = np.maximum(x, -60 * level) if sides == 2 else x
    record = read(tmp_path, T, x)
    levels = f"{0.06 * level:g} or {-0.06 * level:g} m" if sides == 2 else f"{0.06 * level:g} m"
    assert f"are exactly {levels}. They are left out" in record.notes[-1]
    assert np.abs(record.x).max() < 0.06 * level or sides == 1
    assert fit(record)["zeta"].value == pytest.approx(ZETA, rel=0.03)


@pytest.mark.parametrize("order", slow_after(1, [0, 1, 2]))
def test_a_rounded_or_held_motion_has_no_defects(order):
    rng = np.random.default_rng(order)
    for seed in range(60):
        step = 0.2 / rng.integers(3, 300)
        noise, turn = step * rng.choice([0, 0.1, 0.5]), rng.choice([0.0, 1.0])
        damping, times = 10 ** rng.uniform(-4, -1.3), np.linspace(0, rng.uniform(2, 40), 1000)
        record = decay_record(damping, a=0.1, step=step, t=times, turn=turn, noise=noise, seed=seed, order=order)
        for motion in (record, random_record(seed, order=order)[0]):
            assert find_saturation(motion.x)[1] == 0
            assert mark_sentinels(motion.x, "x") == mark_dropouts(motion.x, "x") == []


@pytest.mark.parametrize(
    ("stays", "near", "peaks"),
    [
        ([10, 8], [0.9], 2),
        ([10, 8], [0.9, 0.9], 0),
        ([10, 5], [0.9], 2),
        ([10, 4], [0.9], 0),
        ([10, 8], [0.9, 0.86], 0),
        ([10, 8], [0.9, 0.84], 2),
        ([3, 3, 3], [0.9], 3),
        ([6, 6, 2], [0.9], 2),
        ([2, 2, 2, 2], [], 0),
        ([10], [], 0),
    ],
)
def test_saturation_is_long_stays_at_one_value_that_is_seldom_approached(stays, near, peaks):
    x = [0.0, *near, 0.0]
    for count in stays:
        x += [*[1.0] * count, 0.0]
    is_saturated, count = find_saturation(np.array(x))
    assert count == peaks
    assert is_saturated.sum() == (sum(stays) if peaks else 0)


def test_the_largest_value_of_one_peak_or_of_no_motion_is_not_saturation():
    record = swing()
    plateau = np.concatenate([np.full(400, record.x.max()), record.x[:-400]])
    assert find_saturation(plateau)[1] == find_saturation(np.ones_like(record.x))[1] == 0


def test_rows_in_no_order_are_sorted_and_reported():
    """Falling times, whole parts that are exchanged, and shuffled rows; two runs in one table keep their order."""
    t = np.arange(40) * 0.25
    for order in (np.arange(40)[::-1], np.roll(np.arange(40), 15), np.random.default_rng(1).permutation(40)):
        rows, sentence = sort_times(t[order])
        assert (t[order][rows] == t).all()
        assert "The rows are not in the order of time" in sentence
    parts = np.concatenate([np.linspace(5.0, 10.0, 200), np.linspace(0.0, 5.0, 200)])  # which share one time
    assert (parts[sort_times(parts)[0]] == np.sort(parts)).all()
    for times in (t, np.concatenate([t, t + 0.1]), np.concatenate([t, t])):
        rows, sentence = sort_times(times)
        assert (rows == np.arange(len(times))).all()
        assert sentence == ""


def test_a_single_time_that_steps_back_and_repeated_times_do_not_refuse_a_record(tmp_path):
    """As phones write them: one row comes late, and a few times occur twice."""
    t = np.cumsum(np.random.default_rng(3).uniform(0.0018, 0.0022, 18_000))
    x = np.exp(-0.1 * t) * np.cos(10 * t)
    t[7500], t[7501] = t[7501], t[7500]
    x[7500], x[7501] = x[7501], x[7500]
    repeated_rows = np.arange(1000, 12_000, 1000)
    t[repeated_rows] = t[repeated_rows - 1]
    record = read(tmp_path, t, x)
    assert (np.diff(record.t) > 0).all()
    assert len(record.t) == len(t) - len(repeated_rows)
    texts = "\n".join(record.notes)
    assert "The rows are not in the order of time (1 time falls): they are sorted." in texts
    assert f"{len(repeated_rows)} of {len(t)} samples are left out." in texts
