"""The same decay in every format of tests/support/record_formats.py is the same record, or has the message listed."""

import json
from importlib.util import find_spec

import commands
import numpy as np
import pytest
import record_formats
from record_formats import FORMATS, LIBRARIES, T

from harness import SceneError, read_record

X = record_formats.positions()
# read by the code of other formats
LIKE_OTHERS = (
    "timetable73.mat",
    "frame.parquet",
    "signals.mat",
    "structure73.mat",
    "fields.h5",
)


def write(folder, form):
    """Write a record and return its path; skip the test if a library for it is missing."""
    for part, libraries in LIBRARIES.items():
        if part in form.file and not all(map(find_spec, libraries)):
            pytest.skip("extra records")
    path, content = folder / form.file, form.content()
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize(
    "form",
    [
        pytest.param(form, marks=pytest.mark.slow if form.file in LIKE_OTHERS else ())
        for form in FORMATS
        if not form.refusal
    ],
    ids=lambda form: form.file,
)
def test_every_format_of_a_decay_is_the_same_record(tmp_path, form):
    record = read_record(write(tmp_path, form), **form.options)
    assert record.t - record.t[0] == pytest.approx(T, abs=1e-6)
    scale = {"m": 1.0, "units": 1e-3}[record.base]
    assert scale * (record.x - record.x[0]) == pytest.approx(X - X[0], abs=1e-8)
    assert record.base == form.base
    needs_unit = "omega and zeta need none" in " ".join(record.notes)
    assert needs_unit == (form.base == "units")


@pytest.mark.parametrize("form", [form for form in FORMATS if form.refusal], ids=lambda form: form.file)
def test_a_refused_format_has_its_message(tmp_path, form):
    options = [f"--{name.replace('_', '-')}={value}" for name, value in form.options.items()]
    result = commands.harness(tmp_path, "decay", write(tmp_path, form).name, *options)
    assert (result.returncode, result.stderr) == (2, f"Error: {form.refusal}\n")


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
        read_record(path, unit="m")
    assert file in str(refusal.value)
    assert "\n" not in str(refusal.value)


FRAME = """
import numpy, pandas

def load_from_mat(path, add_table_attrs):
    frame = pandas.DataFrame({"t": 10.0 * numpy.arange(50), "x": numpy.sin(numpy.arange(50))})
    frame.attrs["ATTRIBUTE"] = ["ms", "mm"]
    return {"TT": frame}
"""


@pytest.mark.slow
@pytest.mark.parametrize("attribute", ["varUnits", "VariableUnits"])
def test_units_of_a_matlab_table_are_read(tmp_path, monkeypatch, attribute):
    """From a table with units as the library reads it, which cannot write one."""
    path = write(tmp_path, next(form for form in FORMATS if form.file == "timetable.mat"))
    (tmp_path / "matio.py").write_text(FRAME.replace("ATTRIBUTE", attribute))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    record = read_record(path)
    assert record.t == pytest.approx(0.01 * np.arange(50))
    assert record.x == pytest.approx(1e-3 * np.sin(np.arange(50)))


@pytest.mark.parametrize(
    ("entry", "scales"),
    [
        ({"unit": ["s", "mm"]}, (1.0, 1e-3)),
        ({"Units": ["ms", "cm"]}, (1e-3, 1e-2)),
        ({"units": {"x": "mm"}}, (1.0, 1e-3)),
        ({"units": ["mm"]}, (1.0, 1.0)),
        ({"x_units": "mm", "t_unit": "ms"}, (1e-3, 1e-3)),
    ],
)
def test_units_beside_arrays_are_read(tmp_path, entry, scales):
    contents = {"t": T.tolist(), "x": X.tolist()} | entry
    (tmp_path / "record.json").write_text(json.dumps(contents))
    paths = [tmp_path / "record.json"]
    if not any(isinstance(value, dict) for value in entry.values()):
        paths.append(tmp_path / "record.npz")
        np.savez(paths[-1], **{name: np.array(value) for name, value in contents.items()})
    for path in paths:
        record = read_record(path)
        assert record.t == pytest.approx(scales[0] * T)
        assert record.x == pytest.approx(scales[1] * X)


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
        read_record(path)


@pytest.mark.parametrize("options", [{}, {"column": "x [mm] #2"}, {"time": "t [s] #2"}])
def test_one_of_two_runs_side_by_side_is_read_and_the_other_named(tmp_path, options):
    """The second run is longer, so that the first has empty cells at its end."""
    longer = np.arange(800) / 100
    cells = [f"{t},{x:.6f},,{s},{s * s}" for t, x, s in zip(T, 1e3 * X, longer, strict=False)]
    cells += [f",,,{s},{s * s}" for s in longer[len(T) :]]
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(["t [s],x [mm],,t [s],x [mm]", *cells]))
    record = read_record(path, **options)
    assert record.x == pytest.approx(1e-3 * longer**2 if options else X, abs=1e-8)
    first, second = "t [s] with x [mm]", "t [s] #2 with x [mm] #2"
    if "time" in options:
        assert record.notes == ()
    elif options:
        assert f"{second} is used, and {first} is not; time='t [s]' selects another" in record.notes[0]
    else:
        assert f"{first} is used, and {second} is not; time='t [s] #2' selects another" in record.notes[0]
