"""Long tables of numbers are read by numpy, with the same result as shorter ones."""

import numpy as np
import pytest

from harness import HarnessError, read_record
from harness.records import text_table

ROWS = 3000
T, X = 1e-3 * np.arange(ROWS), np.cos(0.01 * np.arange(ROWS))
SWAP = str.maketrans(",.", ".,")
PLAIN = [f"{t:.9g},{x:.17g}" for t, x in zip(T, X, strict=True)]


def insert(rows, *lines, at=ROWS // 3):
    return [*rows[:at], *lines, *rows[at:]]


TABLES = {
    "headings": ["t [s],x [m]", *PLAIN],
    "no headings": PLAIN,
    "comments first": ["# a bench", "# t [s],x [m]", *PLAIN],
    "tabs": ["t\tx", "s\tmm", *(row.replace(",", "\t") for row in PLAIN)],
    "blanks": ["  t   x", *("  " + row.replace(",", "   ") for row in PLAIN)],
    "decimal commas": ["t;x", *(row.replace(",", ";").replace(".", ",") for row in PLAIN)],
    "tabs and decimal commas": ["t\tx", *(row.replace(",", "\t").replace(".", ",") for row in PLAIN)],
    "commas in one column": ["t;x", *(f"{t:.3f};{x:.6f}".replace(".", ",", 1) for t, x in zip(T, X, strict=True))],
    "commas of thousands": ["t;x", *(f"{i / 1000:.3f};{500 + i:,}".replace(".", ",") for i in range(ROWS))],
    "thousands and decimal commas": ["t;x", *(f"{i},5;{1 + i / 10:,.1f}".translate(SWAP) for i in range(ROWS))],
    "one column with decimal commas": ["x [mm]", *(f"{x:.6f}".replace(".", ",") for x in X)],
    "a comment among the rows": insert(["t,x", *PLAIN], "# paused"),
    "an empty line": insert(["t,x", *PLAIN], ""),
    "a missing value": insert(["t,x", *PLAIN], "1.0005,"),
    "not a number": insert(["t,x", *PLAIN], "1.0005,nan"),
    "infinite": insert(["t,x", *PLAIN], "1.0005,inf"),
    "quoted": ["t,x", *(f'"{row.replace(",", chr(34) + "," + chr(34))}"' for row in PLAIN)],
    "trailing delimiter": ["t,x,", *(f"{row}," for row in PLAIN)],
    "grouped": ["t;x", *(f"{1000.5 + i:,.1f};{x}" for i, x in enumerate(X))],
    "a word": insert(["t,x", *PLAIN], "1.0005,fault"),
    "a further cell": insert(["t,x", *PLAIN], "1.0005,1,2"),
    "the headings again": insert(["t,x", *PLAIN], "t,x"),
    "units in cells": ["t x", *(f"{t:.4f} s {x:.6f} mm" for t, x in zip(T, X, strict=True))],
    "clock times": ["time,x", *(f"10:{int(t // 60):02d}:{t % 60:06.3f},{x}" for t, x in zip(T, X, strict=True))],
}


def read(path):
    try:
        record = read_record(path, unit="mm", rate=100.0 if "one column" in path.stem else None)
    except HarnessError as error:
        return str(error)
    return record.t.tolist(), record.x.tolist(), record.notes


@pytest.mark.parametrize("name", TABLES)
def test_a_long_table_is_read_as_a_short_one(tmp_path, name, monkeypatch):
    path = tmp_path / f"{name}.csv"
    path.write_text("\n".join(TABLES[name]))
    short = read(path)
    monkeypatch.setattr(text_table, "LONG_TABLE", 2000)
    assert read(path) == short


@pytest.mark.parametrize("name", ["headings", "decimal commas", "tabs and decimal commas"])
def test_a_long_table_of_numbers_is_not_split_into_cells(name, monkeypatch):
    monkeypatch.setattr(text_table, "LONG_TABLE", 2000)
    table = text_table.parse_text_table("\n".join(TABLES[name]).encode(), "record.csv")
    assert isinstance(table.rows, np.ndarray)
