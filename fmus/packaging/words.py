"""Names that mean something else where a model goes."""

OF_C = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    bool true false fault
    """.split()  # noqa: SIM905
)
