"""Names and units in the headings of a table, as in `x [mm]`, `theta (deg)`, `x / mm`, `x_mm` or `millis`.

A heading may have thousands of characters, so every expression here takes a time proportional to its length.
"""

import re

from .units import find_unit, time_unit_size, unit_size

TIME_NAME = re.compile(
    r"^(t|times?|zeit|temps|tiempo|tid|timestamp|datetime|date|elapsed|seconds|epoch)(?![^\W_])|(time|zeit|stamp)$",
    re.I,
)
DATE_NAME = re.compile(r"^(date|datum)\b", re.I)
QUANTITY_NAMES = (
    re.compile(
        r"^(x|y|z|s|theta|phi|pos|position|displacement|disp|angle|weg|winkel|laser|encoder|height|distance)\b", re.I
    ),
    re.compile(r"^(v|vel|velocity|speed|omega|gyro|gyroscope|rate)\b|velocity|gyroscope|speed", re.I),
    re.compile(r"^(a|acc|accel|accelerometer|alpha|a[xyz])\b|acceleration|accelerometer|accel|^a_|^acc", re.I),
)
FORCE_NAME = re.compile(r"^(f|force|kraft|friction|reibung\w*|load|t|m|tau|torque|moment|drehmoment)(?![^\W_])", re.I)
MAGNITUDE_NAME = re.compile(r"\b(abs|absolute|magnitude|norm)\b", re.I)  # of a vector; has no sign
BRACKETED_UNIT = re.compile(r"[^\[\]()]*(\([^()]*\))?")  # with at most one group, as in m/(s^2)
BRACKETS = re.compile(r"[\[(]([^\[\]()]+)[\])]")
WORD_BOUNDARY = re.compile(r"[ _,:]+|(?<=[a-z])(?=[A-Z])")
MAX_UNIT_WORDS = 3  # as in acc_m_s_s


def split_heading(heading: str) -> tuple[str, str | None]:
    """Return name and unit of a heading: x [mm], x / mm, x_mm, millis."""
    name = heading.strip()
    start = find_last_bracket(name)
    if start is not None:
        return name[:start].rstrip(), name[start + 1 : -1].strip() or None
    parts = name.rsplit(None, 2)  # x / mm, x in mm
    if len(parts) == 3 and parts[1] in ("/", "in") and (is_unit(parts[2]) or unit_size(parts[2])):
        return parts[0], parts[2]
    bracketed = BRACKETS.search(name)  # followed by a run, as in x (mm) Run #1
    if bracketed and is_unit(bracketed[1]):
        around = name[: bracketed.start()].rstrip(), name[bracketed.end() :].lstrip()
        return " ".join(filter(None, around)), bracketed[1].strip()
    words = WORD_BOUNDARY.split(name)
    for i in range(max(len(words) - MAX_UNIT_WORDS, 1), len(words)):
        stem, suffix = " ".join(words[:i]).strip(), "/".join(words[i:]).strip()
        if (
            time_unit_size(suffix)
            if TIME_NAME.search(stem)
            else len(suffix) > 1 and suffix.lower() != "in" and find_unit(suffix)
        ):
            return stem, suffix
    if len(name) > 1 and name.lower() not in ("in", "min") and is_unit(name):
        return name, name
    return name, None


def find_last_bracket(text: str) -> int | None:
    """Return the index of the bracket that opens the unit at the end of a text, or None if it ends with none."""
    if not text.endswith((")", "]")):
        return None
    depth = 0
    for i in range(len(text) - 1, -1, -1):
        depth += (text[i] in ")]") - (text[i] in "([")
        if depth == 0:
            return i if BRACKETED_UNIT.fullmatch(text, i + 1, len(text) - 1) else None
    return None


def is_unit(text: str) -> bool:
    """Return whether a text is a unit of a motion or of time."""
    return find_unit(text) is not None or time_unit_size(text) is not None


def order_from_name(name: str) -> int | None:
    """Return the order of the derivative that a name indicates, or None."""
    return next((order for order in (2, 1, 0) if QUANTITY_NAMES[order].search(name)), None)
