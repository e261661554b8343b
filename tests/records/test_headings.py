"""Headings of any length and content are read."""

import contextlib
import random

import pytest

from harness import HarnessError, read_record
from harness.records.units import split_heading

PIECES = ("x", "t", "time", "mm", "m/s^2", "(", ")", "[", "]", "/", " in ", " ", "\t", "_", "µ", "Run #1", "aB", ",")
UNITS = ("mm", "s", "deg", "g", "rpm", "m/s^2", "\u00b5m", "m/(s^2)")


def headings(count):
    """Return random headings: pieces of usual ones, and any characters but surrogates."""
    rng = random.Random(1)
    pieces = (*PIECES, *(chr(rng.choice([*range(0x250), *range(0xE000, 0x11000)])) for _ in range(30)))
    return ["".join(rng.choices(pieces, k=rng.randrange(12))) for _ in range(count)]


@pytest.mark.parametrize("text", [" ", "(", "[(", "x (", "_a", " / ", "aB", "9", "\t", "()", "in "])
def test_the_time_for_a_heading_is_proportional_to_its_length(text):
    """A heading that takes a time proportional to the third power of its length would take years."""
    for around in (("x", "y"), ("x", "]"), ("(", ")"), ("x [mm]", ""), ("", "")):
        name, unit = split_heading(text.join(around).join((text * 20_000, text * 20_000)))
        assert isinstance(name, str)
        assert unit is None or isinstance(unit, str)


def test_name_and_unit_are_parts_of_the_heading():
    for heading in ("x (mm))", "x [(mm)", ",x mm", "( in )x", "x _\tmm", *headings(300)):
        name, unit = split_heading(heading)
        for part in (name, unit or ""):
            assert part == part.strip()
            assert not set("".join(part.split())) - set(heading) - {"/"}, repr(heading)


def test_a_unit_in_brackets_at_the_end_is_found_after_any_name():
    for name in headings(100):
        for unit in UNITS:
            for opening, closing in ("[]", "()"):
                assert split_heading(f"{name} {opening}{unit}{closing}") == (name.strip(), unit)


def test_any_headings_give_a_record_or_a_message(tmp_path):
    path, drawn_headings = tmp_path / "headings.csv", headings(100)
    rows = "\n".join(f"{i / 10},{i % 7}" for i in range(20))
    for first, second in zip(drawn_headings[::2], drawn_headings[1::2], strict=True):
        path.write_text(f"{first},{second}\n{rows}", encoding="utf-8")
        with contextlib.suppress(HarnessError):
            assert len(read_record(path).t) == 20


@pytest.mark.parametrize("padding", [" " * 9000, "( " * 4000, "x_" * 4000])
def test_a_heading_of_thousands_of_characters_is_read(tmp_path, padding):
    path = tmp_path / "record.csv"
    path.write_text(f"t [s],x{padding}y [mm]\n" + "\n".join(f"{i / 10},{i % 7}" for i in range(20)))
    assert read_record(path).unit == "m"
