"""The records that the tutorials use are those that docs/make_records.py draws."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / "docs"
specification = importlib.util.spec_from_file_location("make_records", DOCS / "make_records.py")
make_records = importlib.util.module_from_spec(specification)
specification.loader.exec_module(make_records)


@pytest.mark.parametrize("name", make_records.RECORDS)
def test_a_shipped_record_is_the_drawn_one_and_says_so(name, tmp_path):
    """Other processors may round a few values to the next step of a sensor."""
    record, shipped_record = tmp_path / name, DOCS / "records" / name
    record.write_text(make_records.RECORDS[name]())
    assert "Synthetic record, drawn by docs/make_records.py" in shipped_record.read_text().splitlines()[0]
    (heads, values), (other_heads, others) = map(read_table, (shipped_record, record))
    assert heads == other_heads
    assert values.shape == others.shape
    is_equal = (values == others) | ((values != values) & (others != others))
    assert is_equal.mean() > 0.99
    assert (values != values).sum() == 1


def read_table(file):
    """Return the headings and the numbers of a record, with NaN for an empty cell."""
    heads, *rows = np.genfromtxt(file, str, delimiter=",")
    return heads.tolist(), np.array([[float(cell or "nan") for cell in row] for row in rows])


@pytest.mark.slow
def test_the_force_of_the_drawn_block_swings_as_in_the_closed_form():
    """While it slides, the force swings about that of friction; it begins with the rate of the motor, k v."""
    block = make_records.PulledBlock()
    times = [0.001 * i for i in range(3001)]
    forces = [block.force(t, x) for t, x in zip(times, make_records.integrate(block, times), strict=True)]
    weight, omega = block.m * make_records.G, (block.k / block.m) ** 0.5
    swing = (((block.mu_s - block.mu_d) * weight) ** 2 + (block.k * block.v_driver / omega) ** 2) ** 0.5
    assert max(forces) == pytest.approx(block.mu_d * weight + swing, abs=1e-3)
    assert min(forces[1500:]) == pytest.approx(block.mu_d * weight - swing, abs=1e-3)
