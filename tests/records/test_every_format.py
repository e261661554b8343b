"""The same decay in every format of tests/support/record_formats.py gives the same values, or the message listed."""

from importlib.util import find_spec

import numpy as np
import pytest
import record_formats
from record_formats import FORMATS, LIBRARIES, OMEGA, ZETA, T

from harness import SceneError
from harness.analyses.decay.estimates import KnownParameters
from harness.analyses.decay.identification import fit_decay
from harness.records.array_files import columns_of_frame, list_columns
from harness.records.columns import ColumnOptions, read_record
from harness.records.record import Record

X = record_formats.positions()
FITS = {}


def write(folder, form):
    """Write a record and return its path; skip the test if a library for it is missing."""
    for part, libraries in LIBRARIES.items():
        if part in form.file and not all(map(find_spec, libraries)):
            pytest.skip("extra records")
    path, content = folder / form.file, form.content()
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def fit(record):
    """Return the values of a fit by name; of records equal to eight digits only the first is fitted."""
    key = np.round(record.x, 8).tobytes(), record.base
    if key not in FITS:
        plain = Record("record", T, record.x, record.unit, record.order, record.base)
        estimates = fit_decay(plain, KnownParameters(), drag=False).estimates
        FITS[key] = {estimate.name: estimate.value for estimate in estimates}
    return FITS[key]


@pytest.mark.parametrize("form", [form for form in FORMATS if not form.refusal], ids=lambda form: form.file)
def test_every_format_of_a_decay_gives_the_same_frequency_and_damping(tmp_path, form):
    record = read_record(str(write(tmp_path, form)), ColumnOptions(**form.options), "record")
    assert record.t - record.t[0] == pytest.approx(T, abs=1e-6)
    scale = {"m": 1.0, "units": 1e-3}[record.base]
    assert scale * (record.x - record.x[0]) == pytest.approx(X - X[0], abs=1e-8)
    assert record.base == form.base
    values = fit(record)
    assert values["omega"] == pytest.approx(OMEGA, rel=1e-4)
    assert values["zeta"] == pytest.approx(ZETA, rel=2e-3)
    needs_unit = "omega and zeta need none" in " ".join(record.notes)
    assert needs_unit == (form.base == "units")


@pytest.mark.parametrize("form", [form for form in FORMATS if form.refusal], ids=lambda form: form.file)
def test_a_refused_format_has_its_message(tmp_path, form):
    with pytest.raises(SceneError) as refusal:
        read_record(str(write(tmp_path, form)), ColumnOptions(**form.options), "record")
    assert str(refusal.value) == form.refusal


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "share"),
    [
        ("sheet.xlsx", 0.3),
        ("sheet.ods", 0.9),
        ("vectors.mat", 0.9),
        ("structure.mat", 0.3),
        ("new.mat", 0.5),
        ("timetable.mat", 0.9),
        ("measured.h5", 0.9),
        ("frame.parquet", 0.5),
        ("column.npy", 0.9),
        ("arrays.npz", 0.01),
        ("arrays.npz", 0.9),
        ("packed.csv.gz", 0.5),
        ("phyphox.zip", 0.9),
        ("arrays.json", 0.9),
    ],
)
def test_a_truncated_file_is_refused_in_one_sentence(tmp_path, file, share):
    path = write(tmp_path, next(form for form in FORMATS if form.file == file))
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(SceneError) as refusal:
        read_record(str(path), ColumnOptions(unit="m"), "record")
    assert file in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_units_of_a_matlab_table_are_read():
    frame = pytest.importorskip("pandas", reason="extra sweep").DataFrame({"t": T, "x": X})
    for attribute in ("varUnits", "VariableUnits"):
        frame.attrs = {attribute: ["s", "mm"]}
        assert [column.heading("") for column in list_columns(columns_of_frame(frame))] == ["t [s]", "x [mm]"]


@pytest.mark.parametrize(
    ("entry", "headings"),
    [
        ({"unit": ["s", "mm"]}, ["t [s]", "x [mm]"]),
        ({"Units": np.array([b"s", b"mm"])}, ["t [s]", "x [mm]"]),
        ({"units": {"x": "mm"}}, ["t", "x [mm]"]),
        ({"units": ["mm"]}, ["t", "x"]),
        ({"x_units": "mm", "t_unit": "ms"}, ["t [ms]", "x [mm]"]),
    ],
)
def test_units_beside_arrays_are_read(entry, headings):
    assert [column.heading("") for column in list_columns({"t": T, "x": X} | entry)] == headings


@pytest.mark.parametrize(
    ("library", "file"),
    [
        ("pyarrow", "frame.parquet"),
        ("matio", "timetable.mat"),
        ("h5py", "measured.h5"),
        ("python_calamine", "sheet.xlsx"),
    ],
)
def test_a_missing_library_is_named_with_its_installation(tmp_path, monkeypatch, library, file):
    path = write(tmp_path, next(form for form in FORMATS if form.file == file))
    (tmp_path / f"{library}.py").write_text(f"raise ModuleNotFoundError(name={library!r})")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(SceneError, match=rf"{file} needs {library} to be read: .* 'friction-fmus\[records\]'"):
        read_record(str(path), ColumnOptions(), "record")


@pytest.mark.parametrize("options", [{}, {"position": "x [mm] #2"}, {"time": "t [s] #2"}])
def test_one_of_two_runs_side_by_side_is_read_and_the_other_named(tmp_path, options):
    """The second run is longer, so that the first has empty cells at its end."""
    longer = np.arange(800) / 100
    cells = [f"{t},{x:.6f},,{s},{s * s}" for t, x, s in zip(T, 1e3 * X, longer, strict=False)]
    cells += [f",,,{s},{s * s}" for s in longer[len(T) :]]
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(["t [s],x [mm],,t [s],x [mm]", *cells]))
    record = read_record(str(path), ColumnOptions(**options), "runs")
    assert record.x == pytest.approx(1e-3 * longer**2 if options else X, abs=1e-8)
    first, second = "t [s] with x [mm]", "t [s] #2 with x [mm] #2"
    if "time" in options:
        assert record.notes == ()
    elif options:
        assert f"{second} is used, and {first} is not; --time 't [s]' selects another" in record.notes[0]
    else:
        assert f"{first} is used, and {second} is not; --time 't [s] #2' selects another" in record.notes[0]
