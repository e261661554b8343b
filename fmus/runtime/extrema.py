"""Smallest and largest of four numbers, such as the Bernstein coefficients of a cubic polynomial."""


def smallest_of(a, b, c, d):
    """Return the smallest of four numbers."""
    ab = a if a < b else b
    cd = c if c < d else d
    return ab if ab < cd else cd


def largest_of(a, b, c, d):
    """Return the largest of four numbers."""
    ab = a if a > b else b
    cd = c if c > d else d
    return ab if ab > cd else cd
