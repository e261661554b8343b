"""A file that unpacks to too much, or describes too much, is refused by a message."""

import gzip
import io
import json
import struct
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest
import record_formats

from harness import HarnessError, SceneError
from harness.records import array_files, child_reader, size_limits
from harness.records.columns import ColumnOptions, read_record
from harness.studies.compare.trajectory_files import read_signals

LIMIT = 100_000  # bytes, for these tests


def zipped(data):
    """Return an archive with each member deflated."""
    file = io.BytesIO()
    with ZipFile(io.BytesIO(data)) as source, ZipFile(file, "w", ZIP_DEFLATED) as target:
        for name in source.namelist():
            target.writestr(name, source.read(name))
    return file.getvalue()


def compressed_hdf5():
    h5py = pytest.importorskip("h5py", reason="extra records")
    file = io.BytesIO()
    with h5py.File(file, "w") as data:
        data.create_dataset("t", (1_000_000,), "f8", chunks=(10_000,), compression="gzip")
        data.create_dataset("x", (1_000_000,), "f8", chunks=(10_000,), compression="gzip")
    return file.getvalue()


def compressed_mat():
    from scipy.io import savemat

    file = io.BytesIO()
    savemat(file, {"t": np.zeros(50_000), "x": np.zeros(50_000)}, do_compression=True)
    return file.getvalue()


def compressed_parquet():
    pyarrow = pytest.importorskip("pyarrow", reason="extra records")
    from pyarrow import parquet

    file = io.BytesIO()
    parquet.write_table(pyarrow.table([np.zeros(50_000), np.zeros(50_000)], names=["t", "x"]), file)
    return file.getvalue()


def wide_sheet():
    return record_formats.xlsx(["t [s]", *range(3000)], ["x [mm]", *range(3000)])


BOMBS = {
    "record.csv.gz": lambda: gzip.compress(b"t [s],x [mm]\n" + b"0.1,0.2\n" * 20_000),
    "record.npz": lambda: zipped(record_formats.npz(t=np.zeros(50_000), x=np.zeros(50_000))),
    "record.mat": compressed_mat,
    "record.xlsx": lambda: zipped(wide_sheet()),
    "phyphox.zip": lambda: zipped(record_formats.archive(Raw_Data="t [s],x [mm]\n" + "0.1,0.2\n" * 20_000)),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_compressed_file_has_a_limit(tmp_path, monkeypatch, name):
    (tmp_path / name).write_bytes(BOMBS[name]())
    assert (tmp_path / name).stat().st_size < LIMIT
    monkeypatch.setattr(size_limits, "MAX_UNPACKED", LIMIT)
    with pytest.raises(SceneError, match=rf"{name} unpacks to more than .* MB, too much for a record"):
        read_record(str(tmp_path / name), ColumnOptions(), "record")


@pytest.mark.parametrize(("file_format", "content"), [("hdf5", compressed_hdf5), ("parquet", compressed_parquet)])
def test_a_compressed_data_set_has_a_limit(monkeypatch, file_format, content):
    """These are read in a child process, which does not share the limit of this test."""
    data = content()
    assert len(data) < LIMIT
    monkeypatch.setattr(size_limits, "MAX_UNPACKED", LIMIT)
    with pytest.raises(SceneError, match=r"record unpacks to more than .* MB, too much for a record"):
        array_files.READERS[file_format](data, "record")


def test_the_limit_is_that_of_the_whole_file(monkeypatch):
    """Each of the two compressed elements is below the limit."""
    data = compressed_mat()
    monkeypatch.setattr(size_limits, "MAX_UNPACKED", 800_000)
    with pytest.raises(SceneError):
        size_limits.check_mat(data, "record.mat")
    monkeypatch.setattr(size_limits, "MAX_UNPACKED", 900_000)
    size_limits.check_mat(data, "record.mat")


def test_a_cell_far_from_the_table_does_not_end_the_command(tmp_path):
    """In the last row and column of a sheet, it makes the reader allocate 549 GB, which ends its process."""
    openpyxl = pytest.importorskip("openpyxl", reason="only tests write spreadsheets")
    book = openpyxl.Workbook()
    for row in (["t [s]", "x [mm]"], [0.1, 1.0], [0.2, 2.0]):
        book.active.append(row)
    book.active["XFD1048576"] = 1
    book.save(tmp_path / "far.xlsx")
    with pytest.raises(SceneError) as refusal:
        read_record(str(tmp_path / "far.xlsx"), ColumnOptions(), "record")
    assert str(refusal.value) == (
        "far.xlsx cannot be read: it is damaged, has cells far from its table, or needs more than 4 GB of memory; save "
        "its columns as .csv"
    )


def test_a_file_at_which_its_library_crashes_does_not_end_the_command(tmp_path, monkeypatch, make_module):
    code = "import os\ndef read_file(request):\n    os.kill(os.getpid(), 9)"
    monkeypatch.setattr(child_reader, "read_file", make_module("crashing_reader", code).read_file)
    (tmp_path / "record.mat").write_bytes(record_formats.mat(t=record_formats.T, x=record_formats.MM))
    for read in (lambda path: read_record(str(path), ColumnOptions(), "record"), read_signals):
        with pytest.raises(SceneError, match=r"record.mat cannot be read: it is damaged"):
            read(tmp_path / "record.mat")


def test_a_file_whose_library_reads_beyond_its_end_is_refused(tmp_path):
    """The type of its data is 0x0109: depending on the memory behind it, scipy crashes or raises an exception."""
    data = bytearray(record_formats.mat(t=record_formats.T, x=record_formats.MM))
    data[177] = 1
    (tmp_path / "damaged.mat").write_bytes(data)
    for read in (lambda path: read_record(str(path), ColumnOptions(), "record"), read_signals):
        with pytest.raises(SceneError, match=r"damaged.mat cannot be read: "):
            read(tmp_path / "damaged.mat")


def test_a_file_that_takes_too_long_is_refused(monkeypatch):
    monkeypatch.setattr(child_reader, "TIMEOUT", 0.0)
    with pytest.raises(SceneError, match="book takes longer than 0 s to read"):
        child_reader.read_in_child(wide_sheet(), "book", "workbook")


def test_the_memory_of_the_reader_is_limited(monkeypatch):
    resource = pytest.importorskip("resource", reason="a module of POSIX")
    monkeypatch.setattr(child_reader, "read_file", resource.getrlimit)
    monkeypatch.setattr(child_reader, "ReadRequest", lambda *request: resource.RLIMIT_AS)
    assert child_reader.read_in_child(b"", "record", "npy") == (child_reader.MAX_MEMORY,) * 2


@pytest.mark.parametrize("name", ["record.npy", "record.npz"])
def test_an_array_of_a_size_that_the_file_does_not_have_is_refused(tmp_path, name):
    """The header claims 8 TB."""
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }".ljust(117) + b"\n"
    array = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(800)
    file = io.BytesIO()
    with ZipFile(file, "w") as archive:
        archive.writestr("t.npy", array)
    (tmp_path / name).write_bytes(array if name.endswith("npy") else file.getvalue())
    with pytest.raises(SceneError, match=rf"{name} cannot be read"):
        read_record(str(tmp_path / name), ColumnOptions(), "record")


def test_a_file_with_too_many_lines_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("harness.records.text_table.MAX_LINES", 100)
    (tmp_path / "long.csv").write_text("t [s],x [mm]\n" + "1.5,2\n" * 100)
    with pytest.raises(SceneError, match=r"long.csv has 101 lines, and a record at most 100"):
        read_record(str(tmp_path / "long.csv"), ColumnOptions(), "record")


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, '{"a":' * 100_000, json.dumps({"t": [1, 2], "x": [[[1]]]}), "[]", "{}", "[1, {}]", "[[1, 2], [3]]"],
)
def test_json_without_a_record_is_refused_in_one_sentence(tmp_path, text):
    (tmp_path / "record.json").write_text(text)
    with pytest.raises(HarnessError) as refusal:
        read_record(str(tmp_path / "record.json"), ColumnOptions(), "record")
    assert "\n" not in str(refusal.value)
