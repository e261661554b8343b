"""Names reserved in C, and string literals that are valid in Python and in C."""

from json import dumps

C_NAMES = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    bool true false fault
    BUFSIZ EOF FILENAME_MAX FOPEN_MAX HUGE_VAL HUGE_VALF HUGE_VALL INFINITY MODEL_GUID MODEL_H MODEL_NAME NAN NULL
    RAND_MAX SEEK_CUR SEEK_END SEEK_SET TMP_MAX TOLERANCE errno offsetof stderr stdin stdout
    """.split()  # noqa: SIM905
)


def string_literal(text: str) -> str:
    """Return a string literal for printable text."""
    return dumps(text, ensure_ascii=False)
