"""Universal binaries of macOS: libraries for several processors in one file (Apple, mach-o/fat.h)."""

from struct import pack, unpack_from

FAT_MAGIC, MACHO_MAGIC = 0xCAFEBABE, 0xFEEDFACF
ALIGNMENT = 14  # exponent of two: the page size of arm64, a multiple of that of x86_64


def make_universal_binary(slices: list[bytes]) -> bytes:
    """Combine libraries into one file. The header of each library has its processor type."""
    offset = 1 << ALIGNMENT
    header, body = pack(">II", FAT_MAGIC, len(slices)), b""
    for content in slices:
        magic, processor, subtype = unpack_from("<III", content)
        if magic != MACHO_MAGIC:
            raise ValueError("not a 64-bit Mach-O file")
        header += pack(">IIIII", processor, subtype, offset, len(content), ALIGNMENT)
        body += content + bytes(-len(content) % (1 << ALIGNMENT))
        offset = (1 << ALIGNMENT) + len(body)
    return header.ljust(1 << ALIGNMENT, b"\0") + body
