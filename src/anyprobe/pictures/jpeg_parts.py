"""Parts of a JPEG file: concatenated pictures, their segments and markers (ITU-T T.81)."""

from __future__ import annotations

import re
from collections.abc import Iterator

XMP = b"http://ns.adobe.com/xap/1.0/\0"
"""Start of a segment of XMP."""
MAX_PICTURES = 8

_START = b"\xff\xd8\xff"
_MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])")
"""A marker that is not a restart; its code is the group."""


def jpeg_pictures(data: bytes) -> Iterator[bytes]:
    """Yield the JPEG pictures of a file, one behind the other."""
    at = 0
    for _ in range(MAX_PICTURES):
        at = data.find(_START, at)
        if at < 0:
            return
        end = next((end for code, end in markers(data, at + 2) if code == b"\xd9"), len(data))
        yield data[at:end]
        at = end


def markers(data: bytes, at: int) -> Iterator[tuple[bytes, int]]:
    """Yield the markers of a JPEG from a byte on: the code, and where the marker ends; the last is that of its end."""
    while marker := _MARKER.search(data, at):
        code, at = marker[1], marker.end()
        yield code, at
        if code == b"\xd9":
            return
        at += int.from_bytes(data[at : at + 2], "big") if code not in b"\x01\xd8" else 0


def app_segments(picture: bytes) -> Iterator[bytes]:
    """Yield the contents of the APP1 and APP2 segments of one picture."""
    at = 2
    while at + 4 <= len(picture) and picture[at] == 0xFF and picture[at + 1] not in (0xDA, 0xD9):
        size = int.from_bytes(picture[at + 2 : at + 4], "big")
        if picture[at + 1] in (0xE1, 0xE2):
            yield picture[at + 4 : at + 2 + size]
        at += 2 + max(size, 2)
