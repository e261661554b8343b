"""A universal binary of macOS: libraries for several processors in one file (Apple, mach-o/fat.h)."""

from struct import pack, unpack_from

MAGIC, MAGIC_OF_A_SLICE = 0xCAFEBABE, 0xFEEDFACF
ALIGNMENT = 14  # as a power of two: the page of arm64, and a multiple of that of x86_64


def make_universal_binary(slices: list[bytes]) -> bytes:
    """The file that holds the slices; each tells its processor itself."""
    place = 1 << ALIGNMENT
    head, body = pack(">II", MAGIC, len(slices)), b""
    for content in slices:
        magic, processor, kind = unpack_from("<III", content)
        if magic != MAGIC_OF_A_SLICE:
            raise ValueError("a slice is no 64-bit Mach-O file")
        head += pack(">IIIII", processor, kind, place, len(content), ALIGNMENT)
        body += content + bytes(-len(content) % (1 << ALIGNMENT))
        place = (1 << ALIGNMENT) + len(body)
    return head.ljust(1 << ALIGNMENT, b"\0") + body
