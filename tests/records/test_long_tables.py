"""Long tables of numbers are read by numpy, with the same result as shorter ones."""

import numpy as np
import pytest

from harness import HarnessError
from harness.records import text_table
from harness.records.columns import parse_numbers
from harness.records.table_files import parse_table_file

ROWS = 3000
T, X = 1e-3 * np.arange(ROWS), np.cos(0.01 * np.arange(ROWS))
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


def read(lines):
    try:
        table = parse_table_file("\n".join(lines).encode(), "record.csv")
        numbers = [parse_numbers(table, i, strict=False) for i in range(len(table.columns))]
        [parse_numbers(table, i) for i in range(len(table.columns))]
    except HarnessError as error:
        return str(error)
    return table.column_headings, table.line, table.interval, numbers


@pytest.mark.parametrize("name", TABLES)
def test_a_long_table_is_read_as_a_short_one(name, monkeypatch):
    expected = read(TABLES[name])
    monkeypatch.setattr(text_table, "LONG_TABLE", 2000)
    found = read(TABLES[name])
    if isinstance(expected, str):
        assert found == expected
    else:
        assert found[:3] == expected[:3]
        np.testing.assert_array_equal(found[3], expected[3])


def test_a_long_table_of_numbers_is_not_split_into_cells(monkeypatch):
    monkeypatch.setattr(text_table, "LONG_TABLE", 2000)
    table = parse_table_file("\n".join(TABLES["headings"]).encode(), "record.csv")
    assert all(isinstance(column, np.ndarray) for column in table.columns)
