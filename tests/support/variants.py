"""Values of parameters, of which those after the first few run before a merge or before a release only."""

import pytest


def slow_after(count, values):
    """Return the values of a parameter, or tuples of several; those after the first `count` are slow."""
    return mark_after(count, values, pytest.mark.slow)


def campaign_after(count, values):
    """Return the same; those after the first `count` run in the campaign."""
    return mark_after(count, values, pytest.mark.campaign)


def mark_after(count, values, mark):
    """Return the same; those after the first `count` have a mark."""
    rows = [value if isinstance(value, tuple) else (value,) for value in values]
    return [pytest.param(*row, marks=() if i < count else mark) for i, row in enumerate(rows)]
