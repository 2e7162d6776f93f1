"""JPEG headers: size, Huffman tables, and whether the file is complete.

Tested by ``test/studies/film_import/test_import_film.py``.
"""

from __future__ import annotations

from dataclasses import dataclass

START = b'\xff\xd8'
"""First bytes of a JPEG (start-of-image marker)."""

_END = b'\xff\xd9'
# Some cameras pad a JPEG with zeros after the end marker.
_PADDING = b'\x00'
_TAIL_BYTES = 64
_TABLES, _SCAN = 0xC4, 0xDA
# Frame headers: C0 to CF without tables, extensions and arithmetic conditioning.
_FRAMES = frozenset(range(0xC0, 0xD0)) - {_TABLES, 0xC8, 0xCC}
# Annex K.3 of ITU-T T.81: the tables to use if the camera omits them.
_STANDARD_TABLES = bytes.fromhex(
    'ffc4001f0000010501010101010100000000000000000102030405060708090a0b'
    'ffc400b5100002010303020403050504040000017d010203000411051221314106'
    '13516107227114328191a1082342b1c11552d1f02433627282090a161718191a25'
    '262728292a3435363738393a434445464748494a535455565758595a6364656667'
    '68696a737475767778797a838485868788898a92939495969798999aa2a3a4a5a6'
    'a7a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2'
    'e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8f9fa'
    'ffc4001f0100030101010101010101010000000000000102030405060708090a0b'
    'ffc400b51100020102040403040705040400010277000102031104052131061241'
    '510761711322328108144291a1b1c109233352f0156272d10a162434e125f11718'
    '191a262728292a35363738393a434445464748494a535455565758595a63646566'
    '6768696a737475767778797a82838485868788898a92939495969798999aa2a3a4'
    'a5a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9da'
    'e2e3e4e5e6e7e8e9eaf2f3f4f5f6f7f8f9fa'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class JpegHead:
    """Header of a JPEG.

    Parameters
    ----------
    width, height : int, [px]
    channels : int
    tables : bool
        Whether it contains its Huffman tables.
    scan : int
        Offset of the scan (the pixel data), [bytes].
    """

    width: int
    height: int
    channels: int
    tables: bool
    scan: int


def is_whole_jpeg(content: bytes | memoryview) -> bool:
    """Whether the content begins with the start marker and ends with the end marker of a JPEG."""
    tail = bytes(content[-_TAIL_BYTES:]).rstrip(_PADDING)
    return bytes(content[:2]) == START and tail.endswith(_END)


def jpeg_head(content: bytes | memoryview) -> JpegHead | None:
    """Header of a JPEG; None if the content is not a JPEG or has no scan."""
    if content[:2] != START:
        return None
    offset, tables, frame = 2, False, (0, 0, 0)
    while offset + 4 <= len(content) and content[offset] == 0xFF:
        marker = content[offset + 1]
        if marker == 0xFF:
            offset += 1
            continue
        if marker == _SCAN:
            height, width, channels = frame
            return JpegHead(
                width=width, height=height, channels=channels, tables=tables, scan=offset
            )
        tables = tables or marker == _TABLES
        if marker in _FRAMES:
            height, width = (
                int.from_bytes(content[offset + field : offset + field + 2], 'big')
                for field in (5, 7)
            )
            frame = (height, width, content[offset + 9] if offset + 9 < len(content) else 0)
        offset += 2 + int.from_bytes(content[offset + 2 : offset + 4], 'big')
    return None


def with_huffman_tables(content: bytes, head: JpegHead) -> bytes:
    """Insert the standard Huffman tables if the JPEG has none; pixels are not changed."""
    if head.tables:
        return content
    return content[: head.scan] + _STANDARD_TABLES + content[head.scan :]
