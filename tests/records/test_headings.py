"""Headings of any length and content are read."""

import contextlib

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from harness import HarnessError, read_record
from harness.records.units import split_heading

PIECES = ("x", "t", "time", "mm", "m/s^2", "(", ")", "[", "]", "/", " in ", " ", "\t", "_", "µ", "Run #1", "aB", ",")
HEADINGS = st.lists(st.sampled_from(PIECES) | st.text(max_size=3), max_size=12).map("".join)

OFTEN = settings(max_examples=100, deadline=None, database=None)  # the checkout may be read-only


@pytest.mark.parametrize("text", [" ", "(", "[(", "x (", "_a", " / ", "aB", "9", "\t", "()", "in "])
def test_the_time_for_a_heading_is_proportional_to_its_length(text):
    """A heading that takes a time proportional to the third power of its length would take years."""
    for around in (("x", "y"), ("x", "]"), ("(", ")"), ("x [mm]", ""), ("", "")):
        name, unit = split_heading(text.join(around).join((text * 20_000, text * 20_000)))
        assert isinstance(name, str)
        assert unit is None or isinstance(unit, str)


@given(HEADINGS)
@OFTEN
@example("x (mm))")
@example("x [(mm)")
@example(",x mm")
@example("( in )x")
@example("x _\tmm")
def test_name_and_unit_are_parts_of_the_heading(heading):
    name, unit = split_heading(heading)
    for part in (name, unit or ""):
        assert part == part.strip()
        assert not set("".join(part.split())) - set(heading) - {"/"}


@given(HEADINGS, st.sampled_from(["mm", "s", "deg", "g", "rpm", "m/s^2", "µm", "m/(s^2)"]))
@OFTEN
def test_a_unit_in_brackets_at_the_end_is_found_after_any_name(name, unit):
    for opening, closing in ("[]", "()"):
        assert split_heading(f"{name} {opening}{unit}{closing}") == (name.strip(), unit)


@pytest.mark.slow
@given(HEADINGS, HEADINGS)
@OFTEN
def test_any_headings_give_a_record_or_a_message(tmp_path_factory, first, second):
    path = tmp_path_factory.getbasetemp() / "headings.csv"
    rows = "\n".join(f"{i / 10},{i % 7}" for i in range(20))
    path.write_text(f"{first},{second}\n{rows}", encoding="utf-8")
    with contextlib.suppress(HarnessError):
        assert len(read_record(path).t) == 20


@pytest.mark.parametrize("filling", [" " * 9000, "( " * 4000, "x_" * 4000])
def test_a_heading_of_thousands_of_characters_is_read(tmp_path, filling):
    path = tmp_path / "record.csv"
    path.write_text(f"t [s],x{filling}y [mm]\n" + "\n".join(f"{i / 10},{i % 7}" for i in range(20)))
    assert read_record(path).unit == "m"
