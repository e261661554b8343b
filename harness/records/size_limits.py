"""Limits of the files that are read: what a compressed file unpacks to, lines, and memory and time of the reader."""

import gzip
import io
import struct
import zlib
from zipfile import ZipFile

from ..errors import SceneError

MAX_UNPACKED = 200_000_000  # bytes; a record of a million samples has about 20 MB
MAX_LINES = 5_000_000  # of a text file
MAX_MEMORY = 4 << 30  # bytes of a process that reads a file
MAX_READING_TIME = 120.0  # s of such a process
CHUNK = 1 << 20  # bytes
MAT_HEADER, MAT_COMPRESSED = 128, 15  # size of the header of a .mat file in bytes, and type of a compressed element


def check_size(size: float, name: str) -> None:
    """Raise SceneError if a file unpacks to more than `MAX_UNPACKED` bytes."""
    if size > MAX_UNPACKED:
        raise SceneError(
            f"{name} unpacks to more than {MAX_UNPACKED // 1_000_000} MB, too much for a record: save only the columns "
            "and the time of the decay"
        )


def unpack_gzip(data: bytes, name: str) -> bytes:
    """Return the contents of a .gz file."""
    contents = bytearray()
    with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
        while chunk := file.read(CHUNK):
            contents += chunk
            check_size(len(contents), name)
    return bytes(contents)


def check_zip(archive: ZipFile, name: str) -> None:
    """Raise SceneError if the members of an archive are too large; zipfile reads no more of them than they declare."""
    check_size(sum(member.file_size for member in archive.infolist()), name)


def check_mat(data: bytes, name: str) -> None:
    """Raise SceneError if the compressed elements of a .mat file (version 5) are too large; others are not checked.

    References
    ----------
    MathWorks, MAT-File Format (2023), "Level 5 MAT-File Format": a header, then elements with a type and a size
    """
    if data[:10] != b"MATLAB 5.0" or data[512:516] == b"\x89HDF":
        return
    order = ">" if data[MAT_HEADER - 2 : MAT_HEADER] == b"MI" else "<"
    position, size = MAT_HEADER, 0
    while position + 8 <= len(data):
        kind, length = struct.unpack_from(f"{order}II", data, position)
        if kind == MAT_COMPRESSED:
            unpacker, compressed_data = zlib.decompressobj(), data[position + 8 : position + 8 + length]
            while compressed_data:
                chunk = unpacker.decompress(compressed_data, CHUNK)
                size, compressed_data = size + len(chunk), unpacker.unconsumed_tail if chunk else b""
                check_size(size, name)
        position += 8 + length
