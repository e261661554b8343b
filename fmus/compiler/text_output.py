"""Texts in Python, C and XML: literals, comments, documents."""

from json import dumps
from re import sub
from xml.etree.ElementTree import Element, indent, tostring


def string_literal(text: str) -> str:
    """Return a string literal of Python for printable text."""
    return dumps(text, ensure_ascii=False)


def c_string_literal(text: str) -> str:
    """Return a string literal of C for printable text, without trigraphs such as ??/."""
    return string_literal(text).replace("?", "\\?")


def c_comment(text: str) -> str:
    """Return a text that can be part of a comment of C, without its delimiters and trigraphs."""
    return sub(r"\?(?=\?)", "? ", text.replace("*/", "* /").replace("/*", "/ *"))


def xml_bytes(root: Element) -> bytes:
    """Return the indented XML document as UTF-8."""
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, "unicode")}\n'.encode()
