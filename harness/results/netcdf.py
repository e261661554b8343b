"""Incremental writer of NetCDF files in the classic format with 64-bit offsets.

The format is read by xarray, scipy, MATLAB and R. The libraries that write it keep all values in memory.

References
----------
Unidata, NetCDF Classic Format Specification.
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
    """Variable over dimensions: numbers, or texts of `text_length` characters, the size of the last dimension."""

    name: str
    dimensions: tuple[str, ...]
    attributes: Mapping[str, str | float]
    text_length: int = 0

    @property
    def dtype(self) -> np.dtype:
        """Return the type of one value in the file."""
        return np.dtype(f"S{self.text_length}" if self.text_length else ">f8")


@dataclass
class NetCDFWriter:
    """NetCDF file open for writing; `sizes` are those of its dimensions."""

    file: BinaryIO
    sizes: Mapping[str, int]
    variables: Sequence[NetCDFVariable]
    attributes: Mapping[str, str | float]
    offsets: dict[str, int] = field(default_factory=dict)  # of the values of each variable

    def __post_init__(self) -> None:
        """Write the header and reserve space for the values, which are zero."""
        offset = len(self.header(dict.fromkeys((variable.name for variable in self.variables), 0)))
        for variable in self.variables:
            self.offsets[variable.name] = offset
            offset += padded_length(self.length(variable))
        self.file.write(self.header(self.offsets))
        self.file.truncate(offset)

    def length(self, variable: NetCDFVariable) -> int:
        """Return the number of bytes of a variable's values."""
        return prod(self.sizes[name] for name in variable.dimensions) * (1 if variable.text_length else 8)

    def header(self, begins: Mapping[str, int]) -> bytes:
        """Return the header for given offsets of the variables."""
        dimension_index = {name: i for i, name in enumerate(self.sizes)}
        dimensions = [encode_name(name) + pack(">i", size) for name, size in self.sizes.items()]
        variables = []
        for variable in self.variables:
            dimension_list = pack(
                f">{1 + len(variable.dimensions)}i",
                len(variable.dimensions),
                *map(dimension_index.get, variable.dimensions),
            )
            size = min(padded_length(self.length(variable)), 2**32 - 1)
            layout = pack(">iIq", CHAR if variable.text_length else DOUBLE, size, begins[variable.name])
            variables.append(
                encode_name(variable.name) + dimension_list + encode_attributes(variable.attributes) + layout
            )
        magic = b"CDF\x02" + pack(">i", 0)
        return (
            magic
            + encode_list(DIMENSIONS, dimensions)
            + encode_attributes(self.attributes)
            + encode_list(VARIABLES, variables)
        )

    def write_values(self, name: str, first: int, values: np.ndarray) -> None:
        """Write values of a variable in the order of its dimensions, starting with value number `first`."""
        (variable,) = (candidate for candidate in self.variables if candidate.name == name)
        self.file.seek(self.offsets[name] + first * variable.dtype.itemsize)
        self.file.write(values.astype(variable.dtype).tobytes())


def padded_length(length: int) -> int:
    """Return the length rounded up to a multiple of four."""
    return length + -length % 4


def encode_name(text: str) -> bytes:
    """Encode a text with its length."""
    content = text.encode()
    return pack(">i", len(content)) + content.ljust(padded_length(len(content)), b"\0")


def encode_list(tag: int, items: Sequence[bytes]) -> bytes:
    """Encode a list with its tag."""
    return pack(">ii", tag if items else 0, len(items)) + b"".join(items)


def encode_attributes(attributes: Mapping[str, str | float]) -> bytes:
    """Encode a list of attributes."""
    items = []
    for name, value in attributes.items():
        content = pack(">i", CHAR) + encode_name(value) if isinstance(value, str) else pack(">iid", DOUBLE, 1, value)
        items.append(encode_name(name) + content)
    return encode_list(ATTRIBUTES, items)
