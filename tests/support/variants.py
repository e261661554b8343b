"""The variants of a test: a few run by default, all of them in CI."""

import pytest


def slow_after(count, values):
    """Return the values of a parameter, or tuples of several; those after the first `count` are slow."""
    rows = [value if isinstance(value, tuple) else (value,) for value in values]
    return [pytest.param(*row, marks=() if i < count else pytest.mark.slow) for i, row in enumerate(rows)]
