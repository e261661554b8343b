"""Texts of model files that are put together from parts."""

import re


def remove_unused(text):
    """Return the text of a model file without unused parameters, inputs and tables, which are refused."""
    return "".join(line for line in text.splitlines(keepends=True) if not is_unused(line, text))


def is_unused(line, text):
    """Return whether a line declares a parameter, an input or a table that no other line uses."""
    declaration = re.match(r"    (\w+) = (Parameter|Input|Table)\(", line)
    code = re.sub('"[^"]*"', "", text)
    return declaration is not None and len(re.findall(rf"\b{declaration[1]}\b", code)) == 1
