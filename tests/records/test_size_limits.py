"""A file that unpacks to too much, or describes too much, is refused by a message."""

import gzip
import io
import json
import struct
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest
import record_formats
from variants import slow_after

from harness import HarnessError, SceneError, compare, read_record
from harness.records import size_limits

LIMIT = 100_000  # bytes, for these tests


def deflate_members(data):
    """Return an archive with each member deflated."""
    file = io.BytesIO()
    with ZipFile(io.BytesIO(data)) as source, ZipFile(file, "w", ZIP_DEFLATED) as target:
        for name in source.namelist():
            target.writestr(name, source.read(name))
    return file.getvalue()


def compressed_mat():
    from scipy.io import savemat

    file = io.BytesIO()
    savemat(file, {"t": np.zeros(50_000), "x": np.zeros(50_000)}, do_compression=True)
    return file.getvalue()


def wide_sheet():
    return record_formats.xlsx(["t [s]", *range(3000)], ["x [mm]", *range(3000)])


BOMBS = {
    "record.csv.gz": lambda: gzip.compress(b"t [s],x [mm]\n" + b"0.1,0.2\n" * 20_000),
    "record.npz": lambda: deflate_members(record_formats.npz(t=np.zeros(50_000), x=np.zeros(50_000))),
    "record.mat": compressed_mat,
    "record.xlsx": lambda: deflate_members(wide_sheet()),
    "phyphox.zip": lambda: deflate_members(record_formats.archive(Raw_Data="t [s],x [mm]\n" + "0.1,0.2\n" * 20_000)),
}


@pytest.mark.parametrize("name", BOMBS)
def test_a_compressed_file_has_a_limit(tmp_path, monkeypatch, name):
    (tmp_path / name).write_bytes(BOMBS[name]())
    assert (tmp_path / name).stat().st_size < LIMIT
    monkeypatch.setattr(size_limits, "MAX_UNPACKED", LIMIT)
    with pytest.raises(SceneError, match=rf"{name} unpacks to more than .* MB, too much for a record"):
        read_record(tmp_path / name)


def write_hdf5(path):
    h5py = pytest.importorskip("h5py", reason="extra records")
    with h5py.File(path, "w") as data:
        for name in "tx":
            data.create_dataset(name, (13_000_000,), "f8", chunks=(100_000,), compression="gzip")


def write_parquet(path):
    pyarrow = pytest.importorskip("pyarrow", reason="extra records")
    from pyarrow import parquet

    parquet.write_table(pyarrow.table([np.zeros(13_000_000, np.int8)] * 2, names=["t", "x"]), path)


@pytest.mark.parametrize("write", slow_after(1, [write_hdf5, write_parquet]))
def test_a_compressed_data_set_has_a_limit(tmp_path, write):
    """These are read in a child process, which does not share the limit of this test."""
    write(tmp_path / "record")
    assert (tmp_path / "record").stat().st_size < LIMIT
    with pytest.raises(SceneError, match="record unpacks to more than 200 MB, too much for a record"):
        read_record(tmp_path / "record")


def swap_bytes(data):
    """Return a .mat file whose numbers outside compressed elements have the other order of bytes."""
    swapped_data, position = bytearray(data), 128
    swapped_data[124:128] = data[125:123:-1] + data[127:125:-1]  # version and mark of the order
    while position < len(data):
        swapped_data[position : position + 8] = struct.pack(">II", *struct.unpack_from("<II", data, position))
        position += 8 + struct.unpack_from("<I", data, position + 4)[0]
    return bytes(swapped_data)


@pytest.mark.parametrize("change", [bytes, swap_bytes])
def test_the_limit_is_that_of_the_whole_file(monkeypatch, change):
    """Each of the two compressed elements is below the limit."""
    data = change(compressed_mat())
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
    for read in (read_record, lambda path: compare(path, path)):
        with pytest.raises(SceneError) as refusal:
            read(tmp_path / "far.xlsx")
        assert str(refusal.value) == (
            "far.xlsx cannot be read: it is damaged, has cells far from its table, or needs more than 4 GB of memory; "
            "save its columns as .csv"
        )


def test_a_file_whose_library_reads_beyond_its_end_is_refused(tmp_path):
    """The type of its data is 0x0109: depending on the memory behind it, scipy crashes or raises an exception."""
    data = bytearray(record_formats.mat(t=record_formats.T, x=record_formats.MM))
    data[177] = 1
    (tmp_path / "damaged.mat").write_bytes(data)
    with pytest.raises(SceneError, match=r"damaged.mat cannot be read: "):
        read_record(tmp_path / "damaged.mat")


@pytest.mark.parametrize(
    ("limit", "value", "message"),
    [
        ("MAX_READING_TIME", 0.0, "book.mat takes longer than 0 s to read"),
        ("MAX_MEMORY", 100 << 20, "book.mat cannot be read: .*memory"),
    ],
)
def test_the_reader_in_a_child_process_is_limited(tmp_path, monkeypatch, limit, value, message):
    (tmp_path / "book.mat").write_bytes(record_formats.mat(t=record_formats.T, x=record_formats.MM))
    monkeypatch.setattr(size_limits, limit, value)
    with pytest.raises(SceneError, match=message):
        read_record(tmp_path / "book.mat")


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
        read_record(tmp_path / name)


def test_a_file_with_too_many_lines_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(size_limits, "MAX_LINES", 100)
    (tmp_path / "long.csv").write_text("t [s],x [mm]\n" + "1.5,2\n" * 100)
    with pytest.raises(SceneError, match=r"long.csv has 101 lines, and a record at most 100"):
        read_record(tmp_path / "long.csv")


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, '{"a":' * 100_000, json.dumps({"t": [1, 2], "x": [[[1]]]}), "[]", "{}", "[1, {}]", "[[1, 2], [3]]"],
)
def test_json_without_a_record_is_refused_in_one_sentence(tmp_path, text):
    (tmp_path / "record.json").write_text(text)
    with pytest.raises(HarnessError) as refusal:
        read_record(tmp_path / "record.json")
    assert "\n" not in str(refusal.value)
