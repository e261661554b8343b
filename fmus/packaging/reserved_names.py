"""Names reserved in C, and texts in source code of Python and C."""

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
    """Return a string literal of Python for printable text."""
    return dumps(text, ensure_ascii=False)


def c_string_literal(text: str) -> str:
    """Return a string literal of C for printable text, without trigraphs such as ??/."""
    return string_literal(text).replace("?", "\\?")


def c_comment(text: str) -> str:
    """Return a text that can be part of a comment of C, without its delimiters and trigraphs."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").replace("??", "? ?")
