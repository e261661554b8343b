"""Records from instruments, spreadsheets and phones: each is read correctly, or its problem is reported."""

import contextlib
import gzip
import io
import re

import numpy as np
import pytest
from decays import Signal, decay_record, identify

from harness import HarnessError, SceneError, compare, read_record
from harness.records.text_table import parse_text_table
from harness.records.units import split_heading

T = np.arange(600) / 100
TRUTH = {"omega": 12.566, "zeta": 0.01, "r": 0.002}


def motion(order=0, sine=False, rest=0.0, t=T):
    return decay_record(0.01, 0.002, sine=sine, turn=0.0, t=t, order=order, rest=rest).x


X = motion()


def rows(*columns, mark=",", comma=False, form="{:.9g}"):
    """Return lines of numbers, optionally with decimal commas."""
    lines = [
        mark.join(cell if isinstance(cell, str) else form.format(cell) for cell in row)
        for row in zip(*columns, strict=True)
    ]
    return "\n".join(line.replace(".", ",") for line in lines) if comma else "\n".join(lines)


def phone():
    """phyphox: three accelerations and their magnitude, quoted headings, six decimals."""
    a = motion(2)
    noise = 0.02 * np.random.default_rng(1).standard_normal((2, len(T)))
    head = ",".join(
        f'"{h}"'
        for h in (
            "Time (s)",
            *(f"Linear Acceleration {axis} (m/s^2)" for axis in "xyz"),
            "Absolute acceleration (m/s^2)",
        )
    )
    return head + "\n" + rows(T, *noise, a, np.hypot(a, noise[0]), form="{:.9E}")


def timestamped_text():
    start = np.datetime64("2026-11-21T23:59:58.000")
    stamps = [str(start + np.timedelta64(round(1000 * t), "ms")) + "Z" for t in T]
    return "timestamp,angle (deg)\n" + rows(stamps, np.degrees(motion(sine=True)))


def holes():
    cells = [f"{1e3 * x:.9g}" for x in X]
    cells[50], cells[51], cells[200] = "", "NaN", "n/a"
    return "t [s],x [mm]\n" + rows(T, cells)


def gap():
    keep = (T < 2.0) | (T > 2.7)
    return "t [s],x [mm]\n" + rows(T[keep], 1e3 * X[keep])


def instrument():
    return (
        f"Vendor Recorder 3\nSerial;0815\nDate;21.11.2026\n\nTime;Laser\ns;mm\n{rows(T, 1e3 * X, mark=';', comma=True)}"
    )


def logger():
    """Times rounded to 10 ms with samples every 12.5 ms; some are repeated."""
    t = 0.0125 * np.arange(480)
    return "t [s],x [mm]\n" + rows(np.round(t, 2), 1e3 * motion(t=t))


def quoted_text():
    return "\n".join(f'"{t:.9g}","{1e3 * x:.9g}"'.replace(".", ",") for t, x in zip(T, X, strict=True))


def counts():
    return np.round(np.degrees(motion(sine=True)) / 0.001)


def text_of(text, encoding="utf-8"):
    return text.encode(encoding)


FILES = {
    "commas.csv": lambda: text_of("t [s],x [mm]\n" + rows(T, 1e3 * X)),
    "semicolons.csv": lambda: text_of("Zeit (s);Weg (mm)\n" + rows(T, 1e3 * X, mark=";", comma=True)),
    "tabs.tsv": lambda: text_of("time\tx [m]\n" + rows(T, X, mark="\t")),
    "tabs-commas.txt": lambda: text_of("Time (ms)\tlaser (cm)\n" + rows(1e3 * T, 100 * X, mark="\t", comma=True)),
    "blanks.dat": lambda: text_of("t x[m]\n" + rows(T, X, mark="   ")),
    "quoted-decimal-commas.csv": lambda: text_of('"t [s]","x [mm]"\n' + quoted_text()),
    "windows-lines.csv": lambda: text_of(("t [s],x [mm]\n" + rows(T, 1e3 * X)).replace("\n", "\r\n")),
    "utf8-mark.csv": lambda: text_of("t [s],x [µm]\n" + rows(T, 1e6 * X), "utf-8-sig"),
    "utf16.txt": lambda: text_of("t [s]\tx [mm]\n" + rows(T, 1e3 * X, mark="\t"), "utf-16"),
    "cp1252.csv": lambda: text_of("Zeit [s];Auslenkung [µm]\n" + rows(T, 1e6 * X, mark=";", comma=True), "cp1252"),
    "units-row.csv": lambda: text_of("t,x\ns,mm\n" + rows(T, 1e3 * X)),
    "instrument.csv": lambda: text_of(instrument()),
    "comments.txt": lambda: text_of("# rig 3\n# second run\nt [s],x [mm]\n" + rows(T, 1e3 * X) + "\n# end\n"),
    "heading-in-comment.txt": lambda: text_of("# t[s] x[mm]\n" + rows(T, 1e3 * X, mark=" ")),
    "no-heading.csv": lambda: text_of(rows(T, 1e3 * X)),
    "index.csv": lambda: text_of(",time,x [mm]\n" + rows([str(i) for i in range(len(T))], T, 1e3 * X)),
    "time-second.csv": lambda: text_of("x [mm],t [s]\n" + rows(1e3 * X, T)),
    "stamps.csv": lambda: text_of(timestamped_text()),
    "logger.csv": lambda: text_of(logger()),
    "holes.csv": lambda: text_of(holes()),
    "gap.csv": lambda: text_of(gap()),
    "late-sensor.csv": lambda: text_of("t [s],x [mm]\nnan,nan\n,\n" + rows(T, 1e3 * X)),
    "cut-off.csv": lambda: text_of("t [s],x [mm]\n" + rows(T, 1e3 * X) + "\n6.0"),
    "phone.csv": lambda: text_of(phone()),
    "gyroscope.csv": lambda: text_of('"Time (s)","Gyroscope x (rad/s)"\n' + rows(T, motion(1, sine=True))),
    "accelerometer-in-g.csv": lambda: text_of("t [s],az [g]\n" + rows(T, 1 + motion(2) / 9.80665)),
    "encoder.csv": lambda: text_of("t [ms],count [counts]\n" + rows(1e3 * T, counts())),
    "status.csv": lambda: text_of("t [s],status,x [mm]\n" + rows(T, ["ok"] * len(T), 1e3 * X)),
}  # fmt: skip
OPTIONS = {
    "no-heading.csv": {"headings": "t [s],x [mm]"},
    "encoder.csv": {"unit": "0.001deg"},
}
PENDULUMS = ("stamps.csv", "gyroscope.csv", "encoder.csv")
QUANTITIES = {"phone.csv": "acceleration", "accelerometer-in-g.csv": "acceleration", "gyroscope.csv": "velocity"}
MESSAGES = {
    "logger.csv": "0.0125004 s apart. This step, and any frequency, has a relative uncertainty of about 8e-05",
    "holes.csv": "3 of 600 rows have a missing cell",
    "cut-off.csv": "The last row has a time and no signal, and is left out",
    "phone.csv": "Linear Acceleration z (m/s^2)",
}


def xlsx(*sheets):
    openpyxl = pytest.importorskip("openpyxl", reason="only tests write spreadsheets")
    pytest.importorskip("python_calamine", reason="extra records")
    book = openpyxl.Workbook()
    for rows in sheets:
        for row in rows:
            book.worksheets[-1].append(row)
        book.create_sheet()
    file = io.BytesIO()
    book.save(file)
    return file.getvalue()


FITS = {}


def fit_record(record, pendulum):
    """Return the fit of a record; of records equal to eight digits only the first is fitted."""
    key = (*(np.round(array, 8).tobytes() for array in (record.t, record.x)), record.unit, pendulum)
    if key not in FITS:  # the laws with drag take most of a fit
        FITS[key] = identify(Signal(record.t, record.x, record.unit), pendulum=pendulum, drag=False)
    return FITS[key]


@pytest.mark.parametrize("name", FILES)
def test_a_common_file_format_gives_the_expected_parameters(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(FILES[name]())
    record = read_record(path, **OPTIONS.get(name, {}))
    assert record.quantity == QUANTITIES.get(name, "position")
    fit = fit_record(record, name in PENDULUMS)
    values = {estimate.name: estimate for estimate in fit.estimates}
    for symbol, truth in TRUTH.items():
        assert values[symbol].value == pytest.approx(truth, rel=2e-3)
    assert MESSAGES.get(name, "") in " ".join(record.notes)
    assert "taken for a title" not in " ".join(record.notes)


MM = 1e3 * X + 500  # offset, so that no number begins with 0
CLOCKS = [np.datetime64("2026-11-21T23:59:58.500") + np.timedelta64(round(1000 * t), "ms") for t in T]

DAY = CLOCKS[0].item().date()


def text_lines(line, mark="\n"):
    """Return the lines of a file, from a time in s, a position in mm, and a time stamp."""
    return mark.join(line(t, x, stamp.item()) for t, x, stamp in zip(T, MM, CLOCKS, strict=True))


def scope(i, t, x):
    """A line from a Tektronix TDS: the first rows contain the settings."""
    neighbour = ["Record Length,6.0e+02", "Sample Interval,1.0e-02", "", "Source,CH1"]
    return f"{neighbour[i] if i < 4 and neighbour[i] else ','},,{t:016.12f},{x:10.5f},"


NOTATIONS = {  # and the options of its reader; all hold the same motion
    "names with units": (lambda: "time_ms,x_mm\n" + text_lines(lambda t, x, s: f"{1e3 * t:.0f},{x:.6f}"), {}),
    "a clock named after its unit": (
        lambda: "millis x(mm)\n" + text_lines(lambda t, x, s: f"{1e3 * t:.0f} {x:.6f}"),
        {},
    ),
    "units of Pasco": (
        lambda: (
            "Time (ms) Run #1,Position (mm) Run #1,Time (s) Run #2,Position (mm) Run #2\n"
            + text_lines(lambda t, x, s: f"{1e3 * t:.0f},{x:.6f},{2 * t},{3 * x}")
        ),
        {},
    ),
    "blanks before units": (lambda: "Time (s)   x [mm]\n" + text_lines(lambda t, x, s: f"{t:9.3f} {x:11.6f}"), {}),
    "samples": (
        lambda: "Sample,x [mm]\n" + text_lines(lambda t, x, s: f"{100 * t:.0f},{x:.6f}"),
        {"time": "Sample [0.01s]"},
    ),
    "day, month and year": (
        lambda: "Zeit;Weg [mm]\n" + text_lines(lambda t, x, s: f"{s:%d.%m.%Y %H:%M:%S,%f};{x:.6f}".replace(".6", ",6")),
        {},
    ),
    "half days": (lambda: "Time,x [mm]\n" + text_lines(lambda t, x, s: f"{s:%m/%d/%Y %I:%M:%S.%f %p},{x:.6f}"), {}),
    "three colons": (lambda: "Time\tx [mm]\n" + text_lines(lambda t, x, s: f"{s:%H:%M:%S:%f}\t{x:.6f}"), {}),
    "date and time": (
        lambda: "Date,Time,x [mm]\n" + text_lines(lambda t, x, s: f"{s:%Y-%m-%d,%H:%M:%S.%f},{x:.6f}"),
        {},
    ),
    "empty cells": (lambda: "t [s];x [mm];;;;\n" + text_lines(lambda t, x, s: f"{t};{x:.6f};;;;"), {}),
    "settings beside": (
        lambda: "\n".join(scope(i, t, x) for i, (t, x) in enumerate(zip(T, MM, strict=True))),
        {"headings": "t [s],x [mm]"},
    ),
    "settings above": (
        lambda: (
            "Writer_Version\t2\nReader_Version\t2\n\nSamples\t600\t\nX0\t0,0E+0\t\nX_Value\tx [mm]\tComment\n"
            + text_lines(lambda t, x, s: f"{t}\t{x:.6f}".replace(".", ","))
        ),
        {},
    ),
    "the numbers of Fortran": (
        lambda: "# t [s] x [mm]\n" + text_lines(lambda t, x, s: f"  {t:.9E}  {x:.9E}".replace("E", "D")),
        {},
    ),
    "a typesetter's minus": (
        lambda: "t [s];x [mm]\n" + text_lines(lambda t, x, s: f"{t};{x - 1000:.6f}".replace("-", "\u2212")),
        {},
    ),
    "thousands": (lambda: "t [s],x [um]\n" + text_lines(lambda t, x, s: f'{t},"{1e3 * x:,.3f}"'), {}),
    "whole thousands": (lambda: "t [s],x [nm]\n" + text_lines(lambda t, x, s: f'{t},"{1e6 * x:,.0f}"'), {}),
    "thousands in Germany": (
        lambda: (
            "t [s];x [um]\n" + text_lines(lambda t, x, s: f"{t};{1e3 * x:_.3f}".replace(".", ",").replace("_", "."))
        ),
        {},
    ),
    "three decimals and a gap": (
        lambda: "t [s];x [mm]\n9;NaN\n" + text_lines(lambda t, x, s: f"{t + 10};{x:.3f}".replace(".", ",")),
        {},
    ),
    "packed": (lambda: gzip.compress(("t [s],x [mm]\n" + text_lines(lambda t, x, s: f"{t},{x:.6f}")).encode()), {}),
    "times of a spreadsheet": (
        lambda: xlsx([["t", "x [mm]"], *([s.item().time(), x] for s, x in zip(CLOCKS, MM, strict=True))]),
        {},
    ),
    "the longest sheet": (
        lambda: xlsx(
            [["k", "m"], [1, 2], [3, 4]],
            [["date", "t [s]", "x [mm]"], *([DAY, t, x] for t, x in zip(T, MM, strict=True))],
        ),
        {},
    ),
}


@pytest.mark.parametrize("name", NOTATIONS)
def test_numbers_and_times_are_read_in_any_notation(tmp_path, name):
    path, (content, options) = tmp_path / "record", NOTATIONS[name]
    data = content()
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    record = read_record(path, **options)
    assert record.t - record.t[0] == pytest.approx(T, abs=1e-6)
    assert ("a table in several sheets" in " ".join(record.notes)) == (name == "the longest sheet")
    assert record.x - record.x[0] == pytest.approx(X - X[0], abs=1e-6)


ROWS = "\n".join(f"{i},{i}" for i in range(20))
CLOCK = "\n".join(f"10:00:{i:02},{i % 5}" for i in range(20))
UNITS = "\n".join(f"{i} sec,{i % 5} {'cm' if i == 3 else 'mm'}" for i in range(20))


@pytest.mark.parametrize(
    ("text", "options", "sentence"),
    [
        (f"t,x\n{ROWS}", {}, "t has integer or very large numbers and no unit"),
        (f"millivolts,x [m]\n{ROWS}", {}, "millivolts has integer or very large numbers and no unit"),
        (f"t,x [m]\n{ROWS.replace(',', '763770000123.5,')}", {}, "as in time='t [ms]', or [0.01s]"),
        (f"t [s],x [m]\n{ROWS}", {"column": "y"}, "unknown column 'y'"),
        (f"t [h/m],x [m]\n{ROWS}", {}, "unknown unit of t 'h/m'"),
        (f"t [s],x [m]\n{ROWS}\n20,abc", {}, "'abc' in row 22, column x [m], is not a number"),
        (
            f"t [s],x [m]\n{ROWS}\n\nt [s],x [m]\n{ROWS}",
            {},
            "row 22 repeats the headings: save each run in a separate file",
        ),
        (f"t,x\n{UNITS}", {}, "'0 mm' in row 2, column x, is not a number"),  # not all are in mm
        (f"t [s],x [m]\n{ROWS}\n20,1,2", {}, "row 22 has 3 cells where the heading has 2"),
        (f"t [s],x [m]\n{ROWS}\n5,5", {}, "time does not rise after t = 19.0 s"),
        (f"time,x [m]\n{CLOCK}\n10:00:05,5", {}, "time does not rise after t = 19.0 s"),
        (f"t [s],x [m]\n{ROWS}\n20,1e200", {}, "which is not plausible"),
        (f"t [s],x [m]\n{ROWS}", {"begin": 15}, "has 5 samples"),
        (
            f"t [s],x [m]\n{ROWS.replace(',1', ',').replace(',3', ',')}\n20,\n21,\n22,\n23,\n24,5",
            {},
            "rows have no number",
        ),
        (ROWS, {}, "as in headings='t [s],x [mm]' of read_record, or"),
        (ROWS, {"headings": "t"}, "`headings` of read_record names 1 columns, and record.csv has 2"),
        ("", {}, "is empty"),
        ("t [s]\n" + ROWS.replace(",", "."), {}, "only one column that is not empty, t [s]; time and pos"),
        ('{"t": [0.1, 0.2, 0.3], "x": 1}', {}, "only one column that is not empty, t; time and position"),
        ("Dear Sir,\nno table.\n", {}, "contains no table"),
        (f"t [s],count [counts]\n{ROWS}", {}, "as in unit='0.36deg'"),
        (f"t [s],acceleration [mm]\n{ROWS}", {}, "the name of an acceleration and the unit of a position"),
        (f"t [s],a [m/s^2]\n{ROWS}", {"quantity": "position"}, "measures an acceleration"),
        ("2026-11-21T15:18:03,1\n2026-21-11T15:18:03,2\n" * 9, {"headings": "t,x [m]"}, "is not a time stamp"),
        ('t [s],"x [m]\n' + ROWS, {}, "contains no table"),
    ],
)
def test_a_file_without_a_record_is_refused_in_one_sentence(tmp_path, text, options, sentence):
    path = tmp_path / "record.csv"
    path.write_text(text)
    with pytest.raises(SceneError) as refusal:
        read_record(path, **options)
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_no_file_content_ends_in_a_traceback(tmp_path):
    """The files above with bytes changed, removed and inserted: a fit or one sentence."""
    rng = np.random.default_rng(5)
    texts = [FILES[name]() for name in ("commas.csv", "instrument.csv", "stamps.csv", "utf16.txt", "phone.csv")]
    path = tmp_path / "record.csv"
    for data in texts * 12:
        bytes_ = bytearray(data[: rng.integers(200, 4000)])
        at = rng.integers(0, len(bytes_), 8)
        bytes_[at[0] : at[0]] = bytes(rng.integers(0, 256, rng.integers(1, 200), dtype=np.uint8))
        for position in at[1:]:
            bytes_[position] = rng.integers(256)
        path.write_bytes(bytes_)
        with contextlib.suppress(HarnessError):
            read_record(path)


def test_a_missing_file_error_names_the_nearest(tmp_path):
    (tmp_path / "swing.csv").write_text("t [s],x [m]\n" + ROWS)
    with pytest.raises(SceneError, match=r"cannot read .*No such file or directory \(nearest: 'swing.csv'\)"):
        read_record(tmp_path / "swng.csv")


@pytest.mark.parametrize("headings", ["t [s],{}", "t [s],{} [mm]", ""], ids=["no units", "units", "no headings"])
@pytest.mark.parametrize("others", [(0 * X,), (0.3 * X,), (np.arange(len(X)),)], ids=["at rest", "less", "counter"])
@pytest.mark.parametrize("last", [True, False])
def test_of_several_columns_the_one_that_varies_most_is_used(tmp_path, headings, others, last):
    columns = [*others, X] if last else [X, *others]
    names = ["cart", "arm"]
    heading = headings.format((" [mm]," if "mm" in headings else ",").join(names))
    path = tmp_path / "record.csv"
    path.write_text((f"{heading}\n" if heading else "") + rows(T, *columns))
    record = read_record(path)
    assert record.x == pytest.approx(X * (1e-3 if "mm" in headings else 1.0), abs=1e-9)
    note = r"^Of (cart|column 2).*, .*, .* is used, because it varies most; `column` selects another\.$"
    assert [text for text in record.notes if re.match(note, text)]


@pytest.mark.parametrize(
    ("headings", "note"),
    [
        ("t,a,b", "Of a, b, a is used, because it has the name or unit of an acceleration; `column` selects another."),
        ("t,x,b", "Of x, b, x is used, because its name is that of a position; `column` selects another."),
        ("t [s],x [m],y [mm]", "Of x [m], y [mm], x [m] is used, because its name is that of a position; "),
        ("t [s],x [m],v [m/s]", ""),
        ("when,x [m],v [m/s]", "when is used as time; `time` selects another column."),
    ],
)
def test_a_choice_by_name_or_unit_names_what_else_may_be_the_motion(tmp_path, headings, note):
    path = tmp_path / "record.csv"
    path.write_text(f"{headings}\n" + rows(T, X, 2 * X))
    record = read_record(path)
    assert record.x == pytest.approx(X, abs=1e-9)
    choices = [text for text in record.notes if "selects another" in text]
    assert len(choices) == bool(note)
    assert not note or choices[0].startswith(note)


def test_a_column_that_does_not_move_is_named_with_the_others(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text("t [s],x [m],v [m/s]\n" + rows(T, 0 * X, X))
    with pytest.raises(SceneError, match=r"x \[m\] does not move; select another column by `column`: v \[m/s\]"):
        read_record(path)


def test_a_heading_is_matched_literally(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text("clock [s],x [mm],Laser 2 [mm]\n" + rows(T, 0 * X, 1e3 * X))
    record = read_record(path, time="clock [s]", column="Laser 2 [mm]")
    assert record.x == pytest.approx(X, abs=1e-9)
    assert read_record(path, column="laser 2").x == pytest.approx(X, abs=1e-9)


@pytest.mark.parametrize(
    ("unit", "order", "base", "size"),
    [
        ("m/s^2", 2, "m", 1.0),
        ("m/s²", 2, "m", 1.0),
        ("m·s⁻²", 2, "m", 1.0),
        ("m/s/s", 2, "m", 1.0),
        ("g", 2, "m", 9.80665),
        ("deg/s", 1, "rad", np.pi / 180),
        ("°/s", 1, "rad", np.pi / 180),
        ("rpm", 1, "rad", np.pi / 30),
        ("U/min", 1, "rad", np.pi / 30),
        ("1/min", 1, "rad", np.pi / 30),
        ("rev/min", 1, "rad", np.pi / 30),
        ("µm", 0, "m", 1e-6),
        ("Degrees", 0, "rad", np.pi / 180),
        ("inches", 0, "m", 0.0254),
        ("inches/s", 1, "m", 0.0254),
        ("Degrees/s^2", 2, "rad", np.pi / 180),
    ],
)
def test_a_unit_identifies_the_quantity(tmp_path, unit, order, base, size):
    path = tmp_path / "record.csv"
    path.write_text(f"t [s],x [{unit}]\n" + rows(T, X))
    record = read_record(path)
    assert (record.order, record.unit) == (order, base + ("", "/s", "/s2")[order])
    assert record.x == pytest.approx(size * X, rel=1e-6, abs=1e-8 * size)


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        *[(f"time{mark}ms", "time", "ms") for mark in ("_", " ", " / ", " in ", ", ", ":")],
        ("timeMs", "time", "Ms"),
        ("gyro_z_deg_s", "gyro z", "deg/s"),
        ("x (mm) Run #2", "x Run #2", "mm"),
        ("Yaw [º]", "Yaw", "º"),
        ("millis", "millis", "millis"),
        ("mm", "mm", "mm"),
        *[(name, name, None) for name in ("x", "x_min", "x_in", "v_x", "min", "in", "s", "T", "ch1_v", "x_rel")],
    ],
)
def test_a_heading_is_a_name_and_a_unit(heading, name, unit):
    assert split_heading(heading) == (name, unit)


def test_an_unknown_unit_is_kept_and_reported(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text("t [s],sensor [V]\n" + rows(T, X))
    record = read_record(path)
    assert (record.unit, record.order) == ("V", 0)
    assert "assumed to be a position" in record.notes[0]


def test_a_record_has_at_least_twelve_samples(tmp_path):
    path = tmp_path / "swing.csv"
    path.write_text("t [s],x [m]\n" + rows(T[:13], X[:13]))
    for end in (0.115, 0.125):
        assert len(read_record(path, end=end).t) == round(100 * end + 0.5)
    with pytest.raises(SceneError, match="swing has 11 samples in this interval; at least 12 are required"):
        read_record(path, end=0.105)


def test_a_selected_interval_includes_the_samples_at_both_ends():
    record = identify(Signal(T, X), drag=False, begin=T[20], end=T[500]).record
    assert (record.t[0], record.t[-1]) == (T[20], T[500])


@pytest.mark.parametrize(
    ("first_rows", "width", "headings"),
    [
        ([["t", "x"]], 2, ["t", "x"]),
        ([["t", "x", "comment"]], 2, ["t", "x"]),
        ([["t", "x"]], 3, ["t", "x", ""]),
        ([["t", "x", "y", "z"]], 2, []),
        ([["title"]], 2, []),
        ([["x"]], 1, ["x"]),
        ([["t", "x"], ["note"], ["s", "mm"]], 2, ["t [s]", "x [mm]"]),
        ([["t", "x"], ["note"], ["note"], ["s", "mm"]], 2, ["s", "mm"]),
        ([["s", "mm"]], 2, ["s", "mm"]),
        ([["t", "x"], ["s", "laser"]], 2, ["s", "laser"]),
        ([["h", "x"], ["s", "mm"]], 2, ["h [s]", "x [mm]"]),
        ([["s", "m"], ["ms", "mm"]], 2, ["ms", "mm"]),
        ([["t [ms]", "f(x)"], ["s", "mm"]], 2, ["t [ms]", "f(x) [mm]"]),
        ([["t", "x"], ["", "nan"]], 2, ["t", "x"]),
        ([[], ["Y_Unit_Label", "mm"], ["X_Value", "Laser"]], 2, ["X_Value", "Laser [mm]"]),
        ([], 2, []),
    ],
)
def test_headings_are_the_last_rows_of_the_width_of_the_numbers(first_rows, width, headings):
    rows = [*first_rows, *([f"{i + 0.5 * j}" for j in range(width)] for i in range(20))]
    table = parse_text_table("".join("\t".join(row) + "\n" for row in rows).encode(), "record.txt")
    assert list(table.headings) == headings


def test_a_rate_replaces_the_times_and_the_column_of_times_is_not_the_signal(tmp_path):
    path = tmp_path / "record.csv"
    for head in ("", "t [ms],x [mm]\n", "n,x [mm]\n"):
        path.write_text(head + "\n".join(f"{10 * i},{x:.9g}" for i, x in enumerate(1e3 * X)))
        record = read_record(path, rate=50.0, unit="mm")
        assert record.t == pytest.approx(2 * T)
        assert record.x == pytest.approx(X, abs=1e-8)
    path.write_text("t\n" + "\n".join(f"{x:.9g}" for x in X))
    assert read_record(path, rate=100.0, unit="m").x == pytest.approx(X, abs=1e-8)


def test_a_table_to_compare_needs_two_columns(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text("x\n1\n2\n3\n")
    with pytest.raises(SceneError, match="only one column that is not empty; time and a variable are required"):
        compare(path, path)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
@pytest.mark.parametrize("rows", [30, 6000])
def test_fewer_names_than_columns_name_the_first_columns_with_a_note(tmp_path, count, delimiter, rows):
    t = np.linspace(0.0, 6.0, rows)
    names = ["t", "x_mm", "y_mm"][:count]
    np.savetxt(
        tmp_path / "a.csv",
        np.column_stack([t, np.cos(t), t, t]),
        delimiter=delimiter,
        header=delimiter.join(names),
        comments="",
    )
    record = read_record(tmp_path / "a.csv")
    assert record.table.column_headings == (*names, *[""] * (4 - count))
    assert f"a.csv names {count} of 4 columns: the names are taken for the first ones." in record.notes
    assert record.x == pytest.approx(1e-3 * np.cos(t), abs=1e-12)


@pytest.mark.parametrize("rows", [30, 6000])
def test_one_text_above_several_columns_is_a_title_with_a_note(tmp_path, rows):
    t = np.linspace(0.0, 6.0, rows)
    np.savetxt(tmp_path / "a.csv", np.column_stack([t, np.cos(t)]), delimiter=",", header="Time", comments="")
    record = read_record(tmp_path / "a.csv", unit="m")
    assert "a.csv has one text, 'Time', above 2 columns: it is taken for a title" in " ".join(record.notes)
    assert record.x == pytest.approx(np.cos(t), abs=1e-12)
