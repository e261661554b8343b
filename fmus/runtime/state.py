"""A saved state as bytes: a checksum, then JSON; and whether the numbers in it may be taken over."""

import json
from binascii import crc32

LONGEST = 1 << 20  # bytes; a state has some thousand
DEEPEST = 400  # brackets: what they nest must not overflow the parser
WIDEST = 1 << 63  # integers are those of C

REFUSED = (
    "a saved state is refused: it is not, to the last bit, one that this very FMU wrote; "
    "save a state anew and pass it on unchanged"
)


def sealed(state):
    """The bytes of a state."""
    text = json.dumps(state).encode()
    return b"%08x" % crc32(text) + text


def unsealed(content):
    """What the bytes hold, or None where they cannot be a state."""
    seal, text = content[:8], content[8:]
    if len(text) > LONGEST or seal != b"%08x" % crc32(text) or text.count(b"[") + text.count(b"{") > DEEPEST:
        return None
    try:
        return json.loads(text, parse_int=integer)
    except (ValueError, RecursionError):
        return None


def integer(text):
    """As int, which takes minutes for a million digits."""
    return int(text[:20])


def fits(value, pattern):
    """Whether a value has the very names, types and lengths of the pattern."""
    if type(value) is not type(pattern):
        return False
    if type(value) is dict:
        return list(value) == list(pattern) and all(fits(value[name], pattern[name]) for name in pattern)
    if type(value) is list:
        return len(value) == len(pattern) and all(map(fits, value, pattern))
    return type(value) is not int or -WIDEST <= value < WIDEST


def shape(thing):
    """The name of every number of an object with None, and of every object it owns with the shape of that."""
    return {name: shape(value) if hasattr(value, "__dict__") else None for name, value in vars(thing).items()}


def numbers(thing, names):
    """All numbers of an object and of the objects it owns, as its shape names them: a flat copy that JSON can hold."""
    kept = {}
    for name, inner in names.items():
        value = getattr(thing, name)
        kept[name] = numbers(value, inner) if inner is not None else list(value) if isinstance(value, list) else value
    return kept


def take_over(thing, names, kept):
    """Put the numbers back, under the names of the shape and no others."""
    for name, inner in names.items():
        value = kept[name]
        if inner is not None:
            take_over(getattr(thing, name), inner, value)
        else:
            setattr(thing, name, list(value) if isinstance(value, list) else value)
