"""One free decay in every format of a record that the command `decay` knows, for the tests and for the documentation.

`FORMATS` lists them: what the file is, its name, its bytes, the options of the reader, and the message if it is
refused.
"""

import gzip
import io
import json
import warnings
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple
from zipfile import ZipFile

import numpy as np
from decays import decay_record

T = np.arange(600) / 100  # s
ZETA, OMEGA, R = 0.01, 12.566, 0.002


def positions() -> np.ndarray:
    """Return the positions (600,) in m of a decay with viscous damping and dry friction, released at 0.1 m."""
    return decay_record(ZETA, R, omega=OMEGA, turn=0.0, a=0.1, rest=0.0, t=T).x


MM = 1e3 * positions() + 500  # mm; the offset avoids numbers that begin with 0
START = np.datetime64("2026-11-21T23:59:58.500")
CLOCK = [(START + np.timedelta64(round(1000 * t), "ms")).item() for t in T]


class Format(NamedTuple):
    """One format of a record.

    `refusal` is part of the message, empty if the file is read; `base` is the unit of its positions.
    """

    text: str
    file: str
    content: Callable[[], str | bytes]
    options: Mapping[str, Any] = {}
    refusal: str = ""
    base: str = "m"


def lines(head: str, row: str, comma: bool = False) -> str:
    """Return a text with a line for each sample, from a format of t (s), x (mm) and s (time stamp)."""
    body = "\n".join(row.format(t=t, x=x, s=s, i=i) for i, (t, x, s) in enumerate(zip(T, MM, CLOCK, strict=True)))
    return head + (body.replace(".", ",") if comma else body)


def lvm(heading: str, row: str) -> str:
    """Return a file of LabVIEW, with two headers."""
    return lines(
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nDate\t2026/11/21\n"
        "Time\t15:18:03.125\n***End_of_Header***\t\n\nChannels\t1\nSamples\t600\nY_Unit_Label\tMillimeters\n"
        f"X_Dimension\tTime\nX0\t0.0E+0\nDelta_X\t0.010000\n***End_of_Header***\t\n{heading}\tLaser\tComment\n",
        row,
    )


def scope() -> str:
    """Return a file of a Tektronix oscilloscope: the first rows hold its settings too."""
    settings = ["Record Length,6.0e+02,,", "Sample Interval,1.0e-02,,", ",,,", "Source,CH1,,"]
    rows = lines("", "{t:016.12f},{x:11.6f},").splitlines()
    return "\n".join((settings[i] if i < 4 else ",,,") + row for i, row in enumerate(rows))


def npy(array: np.ndarray) -> bytes:
    """Return a .npy file."""
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def npz(**arrays: Any) -> bytes:
    """Return a .npz file."""
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def mat(**variables: Any) -> bytes:
    """Return a .mat file of version 5."""
    from scipy.io import savemat

    file = io.BytesIO()
    savemat(file, variables)
    return file.getvalue()


def hdf5(datasets: Mapping[str, Any], attributes: Mapping[str, Mapping[str, Any]], matlab: bool = False) -> bytes:
    """Return an HDF5 file; with `matlab` as a .mat file of version 7.3, after a user block of 512 bytes."""
    import h5py

    file = io.BytesIO()
    with h5py.File(file, "w", userblock_size=512 if matlab else 0) as data:
        for name, values in datasets.items():
            data[name] = values
            data[name].attrs.update(attributes.get(name, {}))
    if not matlab:
        return file.getvalue()
    return b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + file.getvalue()[512:]


def timetable(version: str) -> bytes:
    """Return a .mat file with a timetable."""
    import tempfile
    from pathlib import Path

    import pandas

    times = pandas.to_timedelta(T, unit="s").rename("Time")
    frame = pandas.DataFrame({"x_mm": MM}, index=times)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the library uses an option of pandas that is deprecated
        import matio

        matio.save_to_mat(f"{folder}/t.mat", {"TT": frame}, version=version)
        return Path(folder, "t.mat").read_bytes()


def parquet(fields: bool) -> bytes:
    """Return a Parquet file with units: those of the fields, or the `attrs` of a DataFrame with its time as index."""
    import pandas
    import pyarrow
    from pyarrow import parquet as files

    file = io.BytesIO()
    if fields:
        schema = [pyarrow.field(name, "double", metadata={"unit": unit}) for name, unit in (("t", "s"), ("x", "mm"))]
        files.write_table(pyarrow.table([T, MM], schema=pyarrow.schema(schema)), file)
    else:
        frame = pandas.DataFrame({"x": MM}, index=pandas.to_timedelta(T, unit="s").rename("time"))
        frame.attrs["units"] = {"x": "mm"}
        frame.to_parquet(file)
    return file.getvalue()


def archive(**members: str) -> bytes:
    """Return a .zip archive; a double underscore in the name of a member is a folder."""
    file = io.BytesIO()
    with ZipFile(file, "w") as data:
        for name, text in members.items():
            data.writestr(name.replace("__", "/").replace("_", " ") + ".csv", text)
    return file.getvalue()


def xlsx(*columns: list[Any]) -> bytes:
    """Return a workbook with these columns side by side."""
    import openpyxl

    book = openpyxl.Workbook()
    for number, column in enumerate(columns, 1):
        for row, cell in enumerate(column, 1):
            book.active.cell(row, number, cell)
    file = io.BytesIO()
    book.save(file)
    return file.getvalue()


def ods() -> bytes:
    """Return a spreadsheet of LibreOffice, with the parts that readers need."""
    text = '<table:table-cell office:value-type="string"><text:p>{}</text:p></table:table-cell>'
    number = (
        '<table:table-cell office:value-type="float" office:value="{0:.9g}"><text:p>{0:.9g}</text:p></table:table-cell>'
    )
    rows = [text.format("t [s]") + text.format("x [mm]")]
    rows += [number.format(t) + number.format(x) for t, x in zip(T, MM, strict=True)]
    spaces = "".join(
        f' xmlns:{name}="urn:oasis:names:tc:opendocument:xmlns:{name}:1.0"' for name in ("office", "table", "text")
    )
    body = "".join(f"<table:table-row>{row}</table:table-row>" for row in rows)
    content = (
        f'<?xml version="1.0" encoding="UTF-8"?><office:document-content{spaces}><office:body><office:spreadsheet>'
        f'<table:table table:name="Sheet1">{body}</table:table></office:spreadsheet></office:body>'
        "</office:document-content>"
    )
    file = io.BytesIO()
    with ZipFile(file, "w") as data:
        data.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        data.writestr("content.xml", content)
        data.writestr("META-INF/manifest.xml", "<manifest/>")
    return file.getvalue()


LIBRARIES = {  # of the extras records and test, by a part of the name of the file
    ".xlsx": ("openpyxl", "python_calamine"),
    ".ods": ("python_calamine",),
    "timetable": ("matio", "pandas"),
    "new.mat": ("h5py",),
    "structure73": ("h5py",),
    ".h5": ("h5py",),
    ".parquet": ("pyarrow", "pandas"),
}
PLAIN = "{t:.2f},{x:.9g}"
COMMAS = "t [s],x [mm]\n"
CHARACTERS = np.array([[ord("m")], [ord("m")]], np.uint16)
CHAR = {"MATLAB_class": np.bytes_("char")}
LONGER = np.arange(700) / 100

FORMATS = (
    # text
    Format("commas, `t [s],x [mm]`", "commas.csv", lambda: lines(COMMAS, PLAIN)),
    Format("semicolons and decimal commas", "semicolons.csv", lambda: lines("Zeit (s);Weg (mm)\n", "{t};{x}", True)),
    Format("tabs", "tabs.tsv", lambda: lines("time [s]\tx [mm]\n", "{t}\t{x}")),
    Format("columns of blanks", "blanks.dat", lambda: lines("Time (s)   x [mm]\n", "{t:9.3f} {x:14.9f}")),
    Format("vertical bars", "bars.txt", lambda: lines("| t [s] | x [mm] |\n", "| {t} | {x} |")),
    Format("UTF-16", "utf16.txt", lambda: lines("t [s]\tx [mm]\n", "{t}\t{x}").encode("utf-16")),
    Format("Windows-1252", "cp1252.csv", lambda: lines("Zeit [s];Höhe [mm]\n", "{t};{x}", True).encode("cp1252")),
    Format("names that contain units, `time_ms,x_mm`", "names.csv", lambda: lines("time_ms,x_mm\n", "{i}0,{x}")),
    Format("a row of units below the names", "units.csv", lambda: lines("t,x\ns,mm\n", PLAIN)),
    Format("a comment `% Units: s, mm`", "comment-units.csv", lambda: lines("% Units: s, mm\nt,x\n", PLAIN)),
    Format("names in a comment, `# t [s], x [mm]`", "comment.csv", lambda: lines("# t [s], x [mm]\n", PLAIN)),
    Format(
        "names in a comment, others below it, columns of blanks",
        "comments.dat",
        lambda: lines("# rig 3\n# t, x\n# [s], [mm]\n# second run\n", "{t} {x}"),
    ),
    Format(
        "names without units in a comment, `# t, x`",
        "comment-names.csv",
        lambda: lines("# t, x\n", PLAIN),
        base="units",
    ),
    Format("names without units", "no-units.csv", lambda: lines("t,x\n", PLAIN), base="units"),
    Format("two columns without names", "no-heading.csv", lambda: lines("", PLAIN), base="units"),
    Format(
        "settings of an instrument above the table",
        "instrument.csv",
        lambda: lines("Recorder 3\nSerial;0815\nDate;21.11.2026\n\nTime;Laser\ns;mm\n", "{t};{x}", True),
    ),
    Format("LabVIEW `.lvm`", "labview.lvm", lambda: lvm("X_Value", "{t:.6f}\t{x:.9f}")),
    Format("LabVIEW `.lvm` with `Delta_X` in place of times", "no-x.lvm", lambda: lvm("X_Value", "\t{x:.9f}")),
    Format("Tektronix oscilloscope", "scope.csv", scope, {"headings": "t [s],x [mm]"}),
    Format(
        "PASCO, two runs side by side",
        "pasco.csv",
        lambda: lines("Time (s) Run #1,Position (mm) Run #1,Time (s) Run #2,Position (mm) Run #2\n", "{t},{x},{t},{t}"),
    ),
    Format("exponents of Fortran", "fortran.dat", lambda: lines("t[s] x[mm]\n", "{t:.9E} {x:.9E}").replace("E", "D")),
    Format("separators of thousands", "thousands.csv", lambda: lines("t [s];x [mm]\n", "{t};1'{x:09.5f}")),
    Format("time stamps, ISO 8601", "iso.csv", lambda: lines("timestamp,x [mm]\n", "{s:%Y-%m-%dT%H:%M:%S.%f}Z,{x}")),
    Format("day, month and year", "date.csv", lambda: lines("Zeit;x [mm]\n", "{s:%d.%m.%Y %H:%M:%S.%f};{x}")),
    Format("12-hour clock", "half-day.csv", lambda: lines("Time,x [mm]\n", "{s:%m/%d/%Y %I:%M:%S.%f %p},{x}")),
    Format("milliseconds after a colon", "colons.txt", lambda: lines("Time\tx [mm]\n", "{s:%H:%M:%S:%f}\t{x}")),
    Format(
        "serial monitor, `12:00:00.200 -> 512.3`",
        "serial.txt",
        lambda: lines("", "{s:%H:%M:%S.%f} -> {x}"),
        base="units",
    ),
    Format(
        "serial monitor with names",
        "serial-names.txt",
        lambda: lines("23:59:58.100 -> x [mm];state\n", "{s:%H:%M:%S.%f} -> {x};1"),
    ),
    Format(
        "a unit in each cell, `0.010 sec`, as of `writetimetable`",
        "cells.csv",
        lambda: lines("Time,x\n", "{t} sec,{x} mm"),
    ),
    Format("a unit in each cell, columns of blanks", "cells.dat", lambda: lines("Time x\n", "{t:.3f} sec  {x:.9f} mm")),
    Format("sample numbers", "samples.csv", lambda: lines("Sample,x [mm]\n", "{i},{x}"), {"time": "Sample [0.01s]"}),
    Format("counts of an encoder", "counts.csv", lambda: lines("t [s],count\n", PLAIN), {"unit": "1mm"}),
    Format("one column of positions", "column.csv", lambda: lines("x [mm]\n", "{x}"), {"rate": 100}),
    Format("one column with decimal commas", "column.txt", lambda: lines("x [mm]\n", "{x:.9f}", True), {"rate": 100}),
    Format(
        "one column of positions, no rate",
        "notime.csv",
        lambda: lines("x [mm]\n", "{x}"),
        {},
        "notime.csv has one column of numbers, x [mm], and no times: set the sampling rate in Hz, as in --rate 100",
    ),
    Format(
        "several columns, none of times",
        "motions.csv",
        lambda: lines("x [mm],y [mm]\n", "{x},{x}"),
        {},
        "motions.csv has no column of times (it has x [mm], y [mm]): name it, as in --time 'x [mm]', or set the "
        "sampling rate in Hz, as in --rate 100",
    ),
    Format(
        "friction over velocity",
        "friction.csv",
        lambda: lines("v [mm/s],F [N]\n", "{x},{x}"),
        {},
        "friction.csv has no times but a force over a velocity, F [N] over v [mm/s], and is no decay: use "
        "friction-fmus curve, or name the column of times, as in --time t",
    ),
    # compressed text
    Format("gzip", "packed.csv.gz", lambda: gzip.compress(lines(COMMAS, PLAIN).encode())),
    Format(
        "phyphox, the archive as downloaded",
        "phyphox.zip",
        lambda: archive(Raw_Data=lines('"Time (s)","x (mm)"\n', "{t:.9E},{x:.12E}"), meta__device="property,value"),
    ),
    Format(
        "an archive of several tables",
        "tables.zip",
        lambda: archive(Accelerometer="t,a\n", Gyroscope="t,w\n"),
        {},
        "tables.zip is an archive with 2 tables (Accelerometer.csv, Gyroscope.csv): unpack it and specify a file in "
        "it, as in 'Accelerometer.csv'",
    ),
    # spreadsheets
    Format("Excel `.xlsx`", "sheet.xlsx", lambda: xlsx(["t [s]", *T], ["x [mm]", *MM])),
    Format(
        "Excel, two runs side by side, the second longer",
        "runs.xlsx",
        lambda: xlsx(["t [s]", *T], ["x [mm]", *MM], [], ["t [s]", *LONGER], ["x [mm]", *LONGER]),
    ),
    Format("LibreOffice `.ods`", "sheet.ods", ods),
    # arrays
    Format("numpy `.npy`, one column", "column.npy", lambda: npy(MM), {"rate": 100}, base="units"),
    Format("numpy `.npy`, two columns", "columns.npy", lambda: npy(np.stack([T, MM], 1)), base="units"),
    Format(
        "numpy `.npy` with named fields",
        "fields.npy",
        lambda: npy(np.array(list(zip(T, MM, strict=True)), [("t", float), ("x_mm", float)])),
    ),
    Format("numpy `.npz`", "arrays.npz", lambda: npz(t=T, x=MM), {"unit": "mm"}),
    Format("numpy `.npz` with `x_unit`", "units.npz", lambda: npz(t=T, x=MM, x_unit="mm")),
    Format("MATLAB `.mat`, version 5", "vectors.mat", lambda: mat(t=T[:, None], x=MM[:, None]), {"unit": "mm"}),
    Format(
        "MATLAB structure with a field `units`",
        "structure.mat",
        lambda: mat(run={"x": MM, "t": T, "units": {"x": "mm", "t": "s"}}),
    ),
    Format("MATLAB structure of structures", "signals.mat", lambda: mat(t=T, x={"data": MM, "unit": "mm"})),
    Format(
        "MATLAB `.mat`, version 7.3", "new.mat", lambda: hdf5({"t": T[None], "x": MM[None]}, {}, True), base="units"
    ),
    Format(
        "MATLAB structure, version 7.3",
        "structure73.mat",
        lambda: hdf5({"t": T[None], "x/value": MM[None], "x/unit": CHARACTERS}, {"x/unit": CHAR}, True),
    ),
    Format("MATLAB timetable", "timetable.mat", lambda: timetable("v7")),
    Format("MATLAB timetable, version 7.3", "timetable73.mat", lambda: timetable("v7.3")),
    Format(
        "HDF5 with attributes `units`",
        "measured.h5",
        lambda: hdf5({"run/time": T, "run/x": MM}, {"run/time": {"units": "s"}, "run/x": {"units": np.bytes_("mm")}}),
    ),
    Format(
        "HDF5 with named fields",
        "fields.h5",
        lambda: hdf5({"run": np.array(list(zip(T, MM, strict=True)), [("t", float), ("x_mm", float)])}, {}),
    ),
    Format("Parquet with units of the fields", "fields.parquet", lambda: parquet(True)),
    Format("Parquet of a DataFrame, times as index", "frame.parquet", lambda: parquet(False)),
    Format(
        "JSON, arrays by name", "arrays.json", lambda: json.dumps({"t": T.tolist(), "x": MM.tolist()}), base="units"
    ),
    Format(
        "JSON, arrays with units",
        "units.json",
        lambda: json.dumps({"t": T.tolist(), "x": MM.tolist(), "units": {"t": "s", "x": "mm"}}),
    ),
    Format(
        "JSON, a list of objects",
        "objects.json",
        lambda: json.dumps([{"t [s]": t, "x [mm]": x} for t, x in zip(T.tolist(), MM.tolist(), strict=True)]),
    ),
    Format("JSON, a list of pairs", "pairs.json", lambda: json.dumps(np.stack([T, MM], 1).tolist()), base="units"),
    Format("lines of JSON", "lines.jsonl", lambda: lines("", '{{"time": {t}, "x_mm": {x}}}')),
)
