"""Compare two tables of values row by row; the assertion names the first difference."""


def assert_identical(rows, expected, names):
    """Compare bit for bit; NaN equals NaN."""
    assert_close(rows, expected, names, 0.0)


def assert_close(rows, expected, names, rel):
    """Compare Reals to `rel` of the largest value of their column, integers exactly, and NaN only with NaN."""
    assert len(rows) == len(expected)
    for name, column, reference in zip(names, zip(*rows, strict=True), zip(*expected, strict=True), strict=True):
        numbers = [abs(b) for b in reference if b == b]
        bound = rel * max(numbers) if numbers and isinstance(reference[0], float) else 0
        for i, (a, b) in enumerate(zip(column, reference, strict=True)):
            assert repr(a) == repr(b) or abs(a - b) <= bound, f"{name} in row {i}: {a!r}, expected {b!r} +- {bound:.1e}"
