"""Parts of a JPEG file: concatenated pictures, their segments and markers (ITU-T T.81)."""

from __future__ import annotations

import re
from collections.abc import Iterator

XMP = b"http://ns.adobe.com/xap/1.0/\0"
"""Start of a segment of XMP."""
MAX_PICTURES = 8

_START = b"\xff\xd8\xff"
MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])")
"""A marker that is not a restart; its code is the group."""


def jpeg_pictures(data: bytes) -> Iterator[bytes]:
    """Yield the JPEG pictures of a file, one behind the other."""
    at = 0
    for _ in range(MAX_PICTURES):
        at = data.find(_START, at)
        if at < 0:
            return
        end = jpeg_end(data, at)
        yield data[at:end]
        at = end


def jpeg_end(data: bytes, start: int = 0) -> int:
    """Return where the JPEG that begins at a byte ends."""
    at = start + 2
    while (marker := MARKER.search(data, at)) and marker[1] != b"\xd9":
        at = marker.end()
        at += int.from_bytes(data[at : at + 2], "big") if marker[1] not in b"\x01\xd8" else 0
    return len(data) if marker is None else marker.end()


def app_segments(picture: bytes) -> Iterator[bytes]:
    """Yield the contents of the APP1 and APP2 segments of one picture."""
    at = 2
    while at + 4 <= len(picture) and picture[at] == 0xFF and picture[at + 1] not in (0xDA, 0xD9):
        size = int.from_bytes(picture[at + 2 : at + 4], "big")
        if picture[at + 1] in (0xE1, 0xE2):
            yield picture[at + 4 : at + 2 + size]
        at += 2 + max(size, 2)
