"""NetCDF files written piece by piece, in the classic format with offsets of 64 bits.

Those who read them are many (xarray, scipy, MATLAB, R); the libraries that write them hold all values in memory.
NetCDF Classic Format Specification, Unidata.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import prod
from struct import pack
from typing import BinaryIO

import numpy as np

DIMENSIONS, VARIABLES, ATTRIBUTES = 10, 11, 12  # tags of lists
CHAR, DOUBLE = 2, 6  # types


@dataclass(frozen=True)
class NetCDFVariable:
    """A variable over dimensions: of numbers, or, where the last one is `letters` long, of texts."""

    name: str
    dimensions: tuple[str, ...]
    attributes: Mapping[str, str | float]
    text_length: int = 0

    @property
    def dtype(self) -> np.dtype:
        """How one value stands in the file."""
        return np.dtype(f"S{self.text_length}" if self.text_length else ">f8")


@dataclass
class NetCDFWriter:
    """The file, open for writing; `sizes` are of its dimensions."""

    file: BinaryIO
    sizes: Mapping[str, int]
    variables: Sequence[NetCDFVariable]
    attributes: Mapping[str, str | float]
    offsets: dict[str, int] = field(default_factory=dict)  # where the values of each variable stand

    def __post_init__(self) -> None:
        """Write all but the values, which are zero."""
        at = len(self.header(dict.fromkeys((each.name for each in self.variables), 0)))
        for each in self.variables:
            self.offsets[each.name] = at
            at += padded_length(self.length(each))
        self.file.write(self.header(self.offsets))
        self.file.truncate(at)

    def length(self, variable: NetCDFVariable) -> int:
        """Bytes of its values."""
        return prod(self.sizes[name] for name in variable.dimensions) * (1 if variable.text_length else 8)

    def header(self, begins: Mapping[str, int]) -> bytes:
        places = {name: i for i, name in enumerate(self.sizes)}
        dimensions = [encode_name(name) + pack(">i", size) for name, size in self.sizes.items()]
        variables = []
        for each in self.variables:
            over = pack(f">{1 + len(each.dimensions)}i", len(each.dimensions), *map(places.get, each.dimensions))
            size = min(padded_length(self.length(each)), 2**32 - 1)
            rest = pack(">iIq", CHAR if each.text_length else DOUBLE, size, begins[each.name])
            variables.append(encode_name(each.name) + over + encode_attributes(each.attributes) + rest)
        begun = b"CDF\x02" + pack(">i", 0)
        return (
            begun
            + encode_list(DIMENSIONS, dimensions)
            + encode_attributes(self.attributes)
            + encode_list(VARIABLES, variables)
        )

    def write_values(self, name: str, first: int, values: np.ndarray) -> None:
        """Write values of a variable, in the order of its dimensions, from number `first` on."""
        (variable,) = (each for each in self.variables if each.name == name)
        self.file.seek(self.offsets[name] + first * variable.dtype.itemsize)
        self.file.write(values.astype(variable.dtype).tobytes())


def padded_length(length: int) -> int:
    """Every item begins at a multiple of four."""
    return length + -length % 4


def encode_name(text: str) -> bytes:
    """A text with its length before it."""
    content = text.encode()
    return pack(">i", len(content)) + content.ljust(padded_length(len(content)), b"\0")


def encode_list(tag: int, items: Sequence[bytes]) -> bytes:
    return pack(">ii", tag if items else 0, len(items)) + b"".join(items)


def encode_attributes(attributes: Mapping[str, str | float]) -> bytes:
    items = []
    for name, value in attributes.items():
        content = pack(">i", CHAR) + encode_name(value) if isinstance(value, str) else pack(">iid", DOUBLE, 1, value)
        items.append(encode_name(name) + content)
    return encode_list(ATTRIBUTES, items)
