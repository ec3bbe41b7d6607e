"""Parts of picture files.

Boxes of HEIC, AVIF and JPEG XL, and those that describe a gain map (ISO/IEC 14496-12, 23008-12); concatenated pictures
and markers of JPEG (ITU-T T.81).
"""

import re
import struct
from collections.abc import Iterator

MOST_BOXES = 10_000

Span = tuple[int, int]
"""First byte in the file, and the one after the last."""

XMP = b"http://ns.adobe.com/xap/1.0/\0"
"""Start of a segment of XMP."""
MAX_PICTURES = 8

_START = b"\xff\xd8\xff"
_MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])")
"""A marker that is not a restart; its code is the group."""


def find_tone_map(data: bytes) -> tuple[bytes, bytes] | None:
    """Return a whole file's gain map of ISO 21496-1; None where it has none, or one that cannot be read.

    Returns:
        Its metadata without the version byte, and a file whose picture is the map.
    Raises:
        struct.error, ValueError, KeyError: damaged.
    """
    start, end = dict(iso_boxes(data, (0, len(data))))[b"meta"]
    found = dict(iso_boxes(data, (start + 4, end)))
    kinds, flags = _items(data, found[b"iinf"])
    if not (mapped := [number for number, kind in kinds.items() if kind == b"tmap"]) or b"iref" not in found:
        return None
    inputs = _references(data, found[b"iref"]).get((b"dimg", mapped[0]), [])
    place = _place(data, found[b"iloc"], mapped[0], found.get(b"idat"))
    if len(inputs) != 2 or place is None:
        return None
    file, primary = bytearray(data), found[b"pitm"][0]
    struct.pack_into(">I" if data[primary] else ">H", file, primary + 4, inputs[1])
    file[flags[inputs[1]]] &= 0xFE  # not hidden
    return data[place[0] + 1 : place[1]], bytes(file)


def iso_boxes(data: bytes, span: Span) -> Iterator[tuple[bytes, Span]]:
    """Yield the kind and the content's span of each box in a span.

    Raises:
        ValueError: a truncated box, after those before it.
    """
    at, end = span
    for _ in range(MOST_BOXES):
        if at + 8 > end:
            return
        size, kind, head = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8], 8
        if size == 1:
            size, head = int.from_bytes(data[at + 8 : at + 16], "big"), 16
        size = size or end - at
        if size < head or at + size > end:
            raise ValueError(f"a truncated box {kind!r}")
        yield kind, (at + head, at + size)
        at += size


def _items(data: bytes, span: Span) -> tuple[dict[int, bytes], dict[int, int]]:
    """Return the items' kinds, and the offsets of their flags, by item number."""
    kinds, flags = {}, {}
    for kind, (at, _) in iso_boxes(data, (span[0] + (6 if data[span[0]] == 0 else 8), span[1])):
        if kind == b"infe" and data[at] in (2, 3):
            wide = data[at] == 3
            (number,) = struct.unpack_from(">I" if wide else ">H", data, at + 4)
            after = at + 4 + (4 if wide else 2) + 2
            kinds[number], flags[number] = data[after : after + 4], at + 3
    return kinds, flags


def _references(data: bytes, span: Span) -> dict[tuple[bytes, int], list[int]]:
    """Return the items that each item refers to, by the kind of reference and its own number."""
    form, size = (">H", 2) if data[span[0]] == 0 else (">I", 4)
    found = {}
    for kind, (at, _) in iso_boxes(data, (span[0] + 4, span[1])):
        (number,), (count,) = struct.unpack_from(form, data, at), struct.unpack_from(">H", data, at + size)
        found[kind, number] = list(struct.unpack_from(f">{count}{form[1]}", data, at + size + 2))
    return found


def _place(data: bytes, span: Span, wanted: int, idat: Span | None) -> Span | None:
    """Return the span of an item stored in one piece in this file; None for any other."""
    at, version = span[0] + 4, data[span[0]]
    offset_size, length_size = data[at] >> 4, data[at] & 15
    base_size, index_size = data[at + 1] >> 4, data[at + 1] & 15 if version else 0
    at += 2

    def number(size: int) -> int:
        nonlocal at
        value = int.from_bytes(data[at : at + size], "big")
        at += size
        return value

    wide = 4 if version == 2 else 2
    for _ in range(min(number(wide), MOST_BOXES)):
        item = number(wide)
        method = number(2) & 15 if version else 0
        number(2)
        base, extents = number(base_size), number(2)
        for _ in range(min(extents, MOST_BOXES)):
            number(index_size)
            start, length = base + number(offset_size), number(length_size)
            if item == wanted and extents == 1:
                if method == 1 and idat is not None:
                    start += idat[0]
                return (start, start + length) if method < 2 and 0 < length and start + length <= len(data) else None
    return None


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
