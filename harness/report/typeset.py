"""Typesetting of texts of results as HTML: code, powers of ten, and columns of texts."""

import re

from markupsafe import Markup, escape

from ..results.summary import SummaryTable

MAX_NUMBER_LENGTH = 32  # characters of a number with its interval; longer cells are texts
NUMBER_STARTS = (*"0123456789+-<", "nan", "not finite")

POWER = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]\d+)\b")  # a number such as 1e-06
PERCENT, NO_BREAK = re.compile(r"(?<=\d) (?=%)"), "\N{NO-BREAK SPACE}"  # a number and its percent sign
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def typeset(text: str) -> Markup:
    """Return a text as HTML, with code between backticks as code and powers of ten as such.

    >>> typeset("run `a 1e-3` for 2e-06 < 1e+2")
    Markup('run <code>a 1e-3</code> for 2·10⁻⁶ &lt; 10²')
    """
    parts = str(text).split("`")
    if len(parts) % 2 == 0:  # a backtick without its counterpart is literal
        parts[-2:] = ["`".join(parts[-2:])]
    texts = (escape(PERCENT.sub(NO_BREAK, POWER.sub(format_power, part))) for part in parts[::2])
    code = (Markup("<code>{}</code>").format(part) for part in parts[1::2])
    pieces = [piece for pair in zip(texts, [*code, ""], strict=True) for piece in pair]
    return Markup("").join(pieces)


def format_power(number: re.Match[str]) -> str:
    """Return a number with an exponent as a product with a power of ten; zero without one."""
    if float(number[1]) == 0:
        return "0"
    power = f"10{str(int(number[2])).translate(SUPERSCRIPTS)}"
    return power if float(number[1]) == 1 else f"{number[1]}·{power}"


def is_text_column(table: SummaryTable, column: int) -> bool:
    """Return whether a column has texts, which are set flush left."""
    cells = [row[column] for row in table.rows if row[column]]
    return not any(cell.startswith(NUMBER_STARTS) and len(cell) <= MAX_NUMBER_LENGTH for cell in cells)
