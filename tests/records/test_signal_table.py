"""Several signals from one file, in the units of an FMU."""

import contextlib

import numpy as np
import pytest
from record_formats import FORMATS, LIBRARIES

from harness import SceneError, read_record
from harness.records.columns import ColumnOptions
from harness.records.record import SignalSource, load_record

SOURCES = {"x": SignalSource("laser", "m"), "F": SignalSource("load", "N")}


@pytest.mark.parametrize(
    ("unit", "other", "factor"),
    [
        ("kN", "N", 1e3),
        ("Nm", "N.m", 1.0),
        ("N/mm", "N/m", 1e3),
        ("kg m/s^2", "N", 1.0),
        ("g", "m/s2", 9.80665),
        ("deg", "rad", np.pi / 180),
        ("Nm/deg", "N.m/rad", 180 / np.pi),
        ("lbf", "N", 4.4482216152605),  # NIST SP 811, appendix B.8
        ("mA", "A", 1e-3),
        ("N·m", "N.m", 1.0),
        ("N*m", "kN m", 1e-3),
        ("m³", "m^3", 1.0),
        ("furlong/s", "furlong.s-1", 1.0),
        ("mm", "N", None),
        ("Nm", "m", None),
        ("N m", "m", None),
        ("Hz", "rad/s", None),
        ("rpm", "Hz", None),
        ("furlong", "m", None),
    ],
)
def test_units_of_one_quantity_are_converted(tmp_path, unit, other, factor):
    path = write(tmp_path / "a.csv", [(i, 0.25 * i) for i in range(20)], f"t [s],y [{unit}]\n")
    sources = {"y": SignalSource("y", other)}
    if factor is None:
        with pytest.raises(SceneError):
            load_record(path, ColumnOptions()).signals(sources)
    else:
        values = load_record(path, ColumnOptions()).signals(sources).columns["y"]
        assert values == pytest.approx(factor * 0.25 * np.arange(20), rel=1e-14)


def write(path, rows, heading="# a comment\nt [ms],laser [mm],load (kN),other\n"):
    path.write_text(heading + "".join(",".join(map(str, row)) + "\n" for row in rows))
    return str(path)


def rows(n=40):
    """Rows of uneven times in ms, positions in mm and loads in kN."""
    return [(10 * i + i % 3, 100 * np.sin(0.3 * i), 0.01 * i, 7) for i in range(n)]


def test_columns_are_converted_and_incomplete_rows_skipped(tmp_path):
    table = rows()
    table[5] = (52, "NaN", 0.05, 7)
    table[9] = (90, 1.0, "", 7)
    signals = load_record(write(tmp_path / "a.csv", table), ColumnOptions()).signals(SOURCES)
    complete_rows = [row for i, row in enumerate(table) if i not in (5, 9)]
    assert signals.t == pytest.approx([1e-3 * row[0] for row in complete_rows])
    assert signals.columns["x"] == pytest.approx([1e-3 * row[1] for row in complete_rows])
    assert signals.columns["F"] == pytest.approx([1e3 * row[2] for row in complete_rows])
    assert any("2 of 40 rows" in note for note in signals.notes)


def test_a_second_run_beside_the_first_is_not_read(tmp_path):
    """Its rows go on after the end of the first."""
    heading = "t [s],laser [mm],load (kN),t [s],laser [mm],load (kN)\n"
    table = [(0.01 * i, i % 7, 0.1, 0.02 * i, -1, -1) for i in range(30)]
    table += [("", "", "", 0.02 * i, -1, -1) for i in range(30, 40)]
    signals = load_record(write(tmp_path / "a.csv", table, heading), ColumnOptions()).signals(SOURCES)
    assert len(signals.t) == 30
    assert signals.columns["F"] == pytest.approx(np.full(30, 100.0))


TEXTS = [form for form in FORMATS if not form.refusal and not any(part in form.file for part in (*LIBRARIES, ".mat"))]


@pytest.mark.parametrize("form", TEXTS, ids=lambda form: form.file)
def test_a_signal_is_read_as_the_record_of_a_decay(tmp_path, form):
    content, path = form.content(), tmp_path / form.file
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    check_signal(path, form.options, form.base)


@pytest.mark.parametrize("tail", [",", ",t [s],laser [mm]"])
def test_comments_gaps_and_a_second_run_are_read_as_for_a_decay(tmp_path, tail):
    """Uneven times in ms, positions in mm, one NaN, one empty cell; the second run has its own times."""
    random = np.random.default_rng(5)
    t = np.cumsum(random.uniform(7.0, 13.0, 300)).round(3)
    cells = [f"{a},{100 * np.cos(0.01 * a) + 300:.3f},{0.02 * i},{-i}" for i, a in enumerate(t)]
    cells[20], cells[50] = f"{t[20]},NaN,0.4,-20", f"{t[50]},,1.0,-50"
    cells += [f",,{0.02 * i},{-i}" for i in range(300, 340)]
    path = tmp_path / "a.csv"
    path.write_text("# phone 3, second floor\n# laser 2\nt [ms],laser [mm]" + tail + "\n" + "\n".join(cells))
    record = check_signal(path, {}, "m")
    assert len(record.t) == 298
    assert any("2 runs side by side" in note for note in record.notes) == ("laser" in tail)


def check_signal(path, options, unit):
    """Assert that a column read as a signal is the record of a decay, with the same notes; return the record."""
    record = read_record(path, **options)
    names = ("headings", "rate", "time")
    columns = ColumnOptions(**{name: value for name, value in options.items() if name in names})
    with pytest.raises(SceneError, match="unknown column 'nosuch'") as refusal:
        load_record(str(path), columns).signals({"x": SignalSource("nosuch", unit)})
    unit_suffix = " [mm]" if "unit" in options else ""  # a unit that the file lacks
    equal = []
    for heading in str(refusal.value).split("allowed: ")[1].split(", "):
        with contextlib.suppress(SceneError):
            signals = load_record(str(path), columns).signals({"x": SignalSource(heading + unit_suffix, unit)})
            if len(signals.t) == len(record.t) and signals.columns["x"] == pytest.approx(record.x, rel=1e-14):
                equal.append(signals)
    assert equal, "no column agrees with the record"
    assert equal[0].t.tolist() == record.t.tolist()
    for text in ("side by side", "missing cell"):
        assert [note for note in equal[0].notes if text in note] == [note for note in record.notes if text in note]
    return record


def test_a_range_of_times_and_a_rate_select_samples(tmp_path):
    file = write(tmp_path / "a.csv", rows())
    signals = load_record(file, ColumnOptions(begin=0.1, end=0.25)).signals(SOURCES)
    assert signals.t[0] >= 0.1
    assert signals.t[-1] <= 0.25
    assert load_record(file, ColumnOptions(rate=200.0)).signals(SOURCES).t[1] == pytest.approx(0.005)


def test_a_unit_in_the_request_replaces_that_of_the_file(tmp_path):
    file = write(tmp_path / "a.csv", rows(), "t [ms],laser,load,other\n")
    sources = {"x": SignalSource("laser [um]", "m"), "F": SignalSource("load", "N")}
    signals = load_record(file, ColumnOptions()).signals(sources)
    assert signals.columns["x"][1] == pytest.approx(1e-6 * rows()[1][1])
    assert signals.notes == ("load has no unit in a.csv: N is assumed, the unit of F in the FMU.",)


@pytest.mark.parametrize(
    ("sources", "options", "message"),
    [
        ({"x": SignalSource("lasre", "m")}, {}, "laser"),
        ({"x": SignalSource("load", "m")}, {}, "load is in kN, and x of the FMU in m"),
        (SOURCES, {"begin": 0.35}, "at least 12 are required"),
        (SOURCES, {"time": "clock"}, "clock"),
    ],
)
def test_a_wrong_request_is_refused_in_one_sentence(tmp_path, sources, options, message):
    with pytest.raises(SceneError) as refusal:
        load_record(write(tmp_path / "a.csv", rows()), ColumnOptions(**options)).signals(sources)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def table(tmp_path, text, encoding="utf-8"):
    """Return the position and the force in a file that has the text."""
    (tmp_path / "record.csv").write_text(text, encoding=encoding)
    sources = {"x": SignalSource("Weg", "m"), "F": SignalSource("Kraft", "N")}
    return load_record(str(tmp_path / "record.csv"), ColumnOptions()).signals(sources)


@pytest.mark.parametrize(
    ("head", "unit"),
    [
        ("Zeit in s;Weg in mm;Kraft in kN\n", 1e3),
        ("Zeit / s;Weg / mm;Kraft / N\n", 1.0),
        ("# Prüfstand A\nZeit;Weg;Kraft\ns;mm;kN\n", 1e3),
    ],
)
def test_units_of_forces_are_read_as_those_of_motions(tmp_path, head, unit):
    rows = [f"{0.01 * i:.2f};{i % 7},5;{i % 5},25\n".replace(".", ",") for i in range(50)]
    signals = table(tmp_path, head + "".join(rows), "cp1252")
    assert signals.columns["x"][:3] == pytest.approx([0.5e-3, 1.5e-3, 2.5e-3])
    assert signals.columns["F"][:3] == pytest.approx([0.25 * unit, 1.25 * unit, 2.25 * unit])
    assert not signals.notes


def test_marks_of_missing_times_and_rows_after_the_signals_are_left_out(tmp_path):
    times = [-9999.0 if i in (7, 8) else 0.01 * i for i in range(60)]
    rows = [f"{t},{np.sin(i)},{np.cos(i)}\n" if i < 50 else f"{t},,\n" for i, t in enumerate(times)]
    signals = table(tmp_path, "t [s],Weg [m],Kraft [N]\n" + "".join(rows))
    assert signals.t == pytest.approx([0.01 * i for i in range(50) if i not in (7, 8)])
    assert "2 of 60 values of t [s] are -9999" in signals.notes[0]
    assert "The last 10 rows have a time and no signal" in " ".join(signals.notes)


def test_a_body_at_rest_has_no_missing_samples(tmp_path):
    """The speed of a body that sticks is exactly 0 between short slips."""
    random = np.random.default_rng(0)
    v = np.zeros(3000)
    for start in range(50, 3000, 100):
        v[start : start + 6] = np.round(random.uniform(0.2, 0.4) * np.sin(np.pi * (np.arange(6) + 0.5) / 6), 4)
    rows = "".join(f"{0.01 * i:.2f},{speed},{np.sin(i):.6f}\n" for i, speed in enumerate(v))
    signals = table(tmp_path, "t [s],Weg [m],Kraft [N]\n" + rows)
    assert np.array_equal(signals.columns["x"], v)


def test_a_sensor_at_the_end_of_its_range_is_named_and_its_samples_kept(tmp_path):
    t = 0.01 * np.arange(600)
    x = np.minimum(np.cos(6 * t) * np.exp(-0.1 * t), 0.6)
    rows = "".join(f"{a:.2f},{b:.4f},{np.sin(a):.6f}\n" for a, b in zip(t, x, strict=True))
    signals = table(tmp_path, "t [s],Weg [m],Kraft [N]\n" + rows)
    assert len(signals.t) == 600
    assert "Weg is exactly 0.6" in signals.notes[0]


DRIVEN_SOURCES = {"x": SignalSource("x", "m"), "F": SignalSource("F", "N", is_input=True)}


def driven_table(tmp_path, t, x, force):
    """Return the signals of a record with the input F, read from a file; None makes an empty cell."""
    cells = [["" if value is None else f"{value:.9g}" for value in row] for row in zip(t, x, force, strict=True)]
    (tmp_path / "a.csv").write_text("t [s],x [m],F [N]\n" + "".join(",".join(row) + "\n" for row in cells))
    return load_record(str(tmp_path / "a.csv"), ColumnOptions()).signals(DRIVEN_SOURCES)


def test_an_input_keeps_every_sample_that_a_measured_signal_would_lose(tmp_path):
    """A commanded force is often 0 between pulses, saturated, and far from its other values; x has marks and holes."""
    random = np.random.default_rng(0)
    t = 0.01 * np.arange(1200)
    force = np.where(np.arange(1200) % 9 < 3, random.uniform(20, 30, 1200).round(3), 0.0)
    force[::100] = -9999.0
    x = np.sin(3 * t)
    lost_rows = random.choice(np.arange(5, 1190), 40, replace=False)
    for value in (-9999.0, None):
        signals = driven_table(tmp_path, t, [value if i in lost_rows else x[i] for i in range(1200)], force)
        assert np.array_equal(signals.inputs["F"], force)
        assert signals.input_t == pytest.approx(t)
        assert signals.t == pytest.approx(np.delete(t, lost_rows))
        assert signals.columns["x"] == pytest.approx(np.delete(x, lost_rows), abs=1e-8)
    with pytest.raises(
        SceneError, match=r"818 of 1200 rows have no number for t .* or x or F"
    ):  # the same column as a measured signal
        load_record(str(tmp_path / "a.csv"), ColumnOptions()).signals({**DRIVEN_SOURCES, "F": SignalSource("F", "N")})


@pytest.mark.parametrize(("row", "cells"), [(1, ("0.01", "0.5", "")), (41, ("", "0.5", "1"))])
def test_a_gap_in_an_input_is_refused(tmp_path, row, cells):
    rows = [(f"{0.01 * i:.2f}", f"{np.sin(i):.6f}", f"{np.cos(i):.6f}") for i in range(100)]
    rows[row] = cells
    missing_item = "value" if cells[0] else "time"
    (tmp_path / "a.csv").write_text("t [s],x [m],F [N]\n" + "".join(",".join(cells) + "\n" for cells in rows))
    with pytest.raises(SceneError) as refusal:
        load_record(str(tmp_path / "a.csv"), ColumnOptions()).signals(DRIVEN_SOURCES)
    assert f"a.csv: F, the input F, has no {missing_item} in row {row + 2}: fill the gap" in str(refusal.value)


@pytest.mark.parametrize("repeated_rows", [[0], [1], [77], [0, 50], [3, 4], [10, 40, 95]])
def test_a_repeated_time_is_dropped_and_named(tmp_path, repeated_rows):
    """A logger that writes a sample twice does not sample slower: no other time may move."""
    t = 0.01 * np.arange(100)
    rows = np.sort(np.append(np.arange(100), repeated_rows))
    signals = driven_table(tmp_path, t[rows], np.sin(t[rows]), np.cos(t[rows]))
    assert signals.t == pytest.approx(t, abs=1e-12)
    assert signals.input_t == pytest.approx(t, abs=1e-12)
    assert signals.inputs["F"] == pytest.approx(np.cos(t), abs=1e-8)
    (note,) = signals.notes
    assert all(f"{t[i]:.6g} s" in note for i in repeated_rows)
    assert f"{len(repeated_rows)} of {len(rows)} samples are left out" in note
    record = read_record(tmp_path / "a.csv", column="x")
    assert record.t == pytest.approx(t, abs=1e-12)
    assert note in record.notes


@pytest.mark.parametrize("lost_rows", [[5], [50], [20, 70]])
def test_a_missing_row_moves_no_other_sample(tmp_path, lost_rows):
    t = np.delete(0.01 * np.arange(100), lost_rows)
    (tmp_path / "a.csv").write_text("t [s],x [m]\n" + "".join(f"{time:.2f},{np.sin(time):.9g}\n" for time in t))
    record = read_record(tmp_path / "a.csv")
    assert record.t == pytest.approx(t, abs=1e-12)


def test_an_input_with_two_values_at_one_time_is_refused(tmp_path):
    t = np.append(0.0, 0.01 * np.arange(60))
    with pytest.raises(SceneError, match="the input F, has two values at t = 0 s: keep one row for each time"):
        driven_table(tmp_path, t, np.sin(t), np.append(7.0, np.cos(t[1:])))
