"""Pictures as cameras and programs write them, made byte by byte where no library does."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
from PIL import Image

REC2020_FROM_REC709 = np.array(
    [[0.627404, 0.329283, 0.043313], [0.069097, 0.919540, 0.011362], [0.016391, 0.088013, 0.895595]]
)
"""ITU-R BT.2087."""


def scene(height: int = 64, width: int = 96, top: float = 0.6) -> np.ndarray:
    """Linear Rec. 709 [H, W, 3], no two corners alike, inside of the primaries."""
    y, x = np.mgrid[0:height, 0:width]
    return np.stack([0.02 + top * x / width, 0.05 + top * y / height, 0.4 - 0.38 * x / width], axis=-1)


def srgb(linear: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def pq(linear: np.ndarray) -> np.ndarray:
    """SMPTE ST 2084 of light whose 1 is 203 cd/m2."""
    p = np.clip(linear * 0.0203, 0, 1) ** 0.1593017578125
    return ((0.8359375 + 18.8515625 * p) / (1 + 18.6875 * p)) ** 78.84375


def hlg(linear: np.ndarray) -> np.ndarray:
    """ARIB STD-B67 of light whose 1 is at a signal of 0.75."""
    scene = linear * 0.26496256
    high = 0.17883277 * np.log(np.maximum(12 * scene - 0.28466892, 1e-9)) + 0.55991073
    return np.where(scene <= 1 / 12, np.sqrt(3 * scene), high)


def eight(values: np.ndarray) -> np.ndarray:
    return np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)


def sixteen(values: np.ndarray) -> np.ndarray:
    return np.round(np.clip(values, 0, 1) * 65535).astype(np.uint16)


def png(pixels: np.ndarray, *chunks: tuple[bytes, bytes]) -> bytes:
    """[H, W] or [H, W, 2, 3 or 4], uint8 or uint16, with chunks before the pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    kind = 0 if pixels.ndim == 2 else {2: 4, 3: 2, 4: 6}[pixels.shape[2]]
    bits = 8 * pixels.dtype.itemsize
    head = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], bits, kind, 0, 0, 0)
    rows = b"".join(b"\0" + row.astype(f">u{bits // 8}").tobytes() for row in pixels)
    pieces = [chunk(b"IHDR", head), *(chunk(*one) for one in chunks), chunk(b"IDAT", zlib.compress(rows))]
    return b"\x89PNG\r\n\x1a\n" + b"".join(pieces) + chunk(b"IEND", b"")


def icc(curve: bytes, *, grey: bool = False, columns: np.ndarray | None = None, more: bytes = b"") -> bytes:
    """A profile of primaries (sRGB's, or columns [3, 3] of XYZ at D50) and one curve's tag; named sRGB, whatever it is.

    more: a cicp tag.
    """

    def xyz(values) -> bytes:
        return b"XYZ \0\0\0\0" + struct.pack(">3i", *(round(float(one) * 65536) for one in values))

    srgb_d50 = np.array([[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]])
    columns = srgb_d50 if columns is None else columns
    name = b"desc\0\0\0\0" + struct.pack(">I", 5) + b"sRGB\0" + bytes(78)
    tags = [(b"desc", name), (b"wtpt", xyz((0.9642, 1.0, 0.8249))), (b"cprt", b"text\0\0\0\0-\0")]
    if grey:
        tags.append((b"kTRC", curve))
    else:
        tags += [(f"{c}XYZ".encode(), xyz(columns[:, k])) for k, c in enumerate("rgb")]
        tags += [(f"{c}TRC".encode(), curve) for c in "rgb"]
    if more:
        tags.append((b"cicp", b"cicp\0\0\0\0" + more))
    place, table, body = 128 + 4 + 12 * len(tags), struct.pack(">I", len(tags)), b""
    for tag, value in tags:
        table += struct.pack(">4sII", tag, place + len(body), len(value))
        body += value + bytes(-len(value) % 4)
    space = b"GRAY" if grey else b"RGB "
    head = struct.pack(">I4sI4s4s4s", 132 + len(table) - 4 + len(body), bytes(4), 0x02400000, b"mntr", space, b"XYZ ")
    head += bytes(12) + b"acsp" + bytes(28) + struct.pack(">3i", 63190, 65536, 54061)
    return head.ljust(128, b"\0") + table + body


def gamma_curve(exponent: float) -> bytes:
    return b"curv\0\0\0\0" + struct.pack(">IH", 1, round(exponent * 256)) + bytes(2)


def yc_exr(rgb: np.ndarray, sampling: int = 2) -> bytes:
    """OpenEXR of luminance and chroma, half floats, of linear Rec. 709 [H, W, 3] of even sides."""

    def attribute(name: bytes, kind: bytes, value: bytes) -> bytes:
        return name + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value

    height, width = rgb.shape[:2]
    y = rgb @ np.array([0.2126, 0.7152, 0.0722])
    ry, by = ((rgb[..., k] - y)[::sampling, ::sampling] / y[::sampling, ::sampling] for k in (0, 2))
    kinds = ((b"BY", sampling), (b"RY", sampling), (b"Y", 1))
    channels = b"".join(name + b"\0" + struct.pack("<iB3xii", 1, 0, step, step) for name, step in kinds) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    head = b"\x76\x2f\x31\x01\x02\0\0\0" + attribute(b"channels", b"chlist", channels)
    head += attribute(b"compression", b"compression", b"\0") + attribute(b"dataWindow", b"box2i", window)
    head += attribute(b"displayWindow", b"box2i", window) + attribute(b"lineOrder", b"lineOrder", b"\0")
    head += attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1))
    head += attribute(b"screenWindowCenter", b"v2f", bytes(8))
    head += attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1)) + b"\0"
    table, rows, at = b"", b"", len(head) + 8 * height
    for k in range(height):
        row = b"".join(one[k // sampling].astype("<f2").tobytes() for one in (by, ry)) if k % sampling == 0 else b""
        row += y[k].astype("<f2").tobytes()
        table += struct.pack("<Q", at + len(rows))
        rows += struct.pack("<ii", k, len(row)) + row
    return head + table + rows


def dng(
    linear: np.ndarray,
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0),
    cast: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> bytes:
    """A DNG of linear Rec. 709 [H, W, 3] up to 1 through an RGGB mosaic of a camera whose primaries are those.

    Its first directory is a small preview, red all over. gains: by which the camera's red, green and blue are lower;
    cast: of the light, which the camera's white balance takes off.
    """
    height, width = linear.shape[:2]
    mosaic = np.empty((height, width), np.uint16)
    for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
        mosaic[row::2, column::2] = sixteen(linear[row::2, column::2, channel] * cast[channel] / gains[channel])
    preview = np.tile(np.array([200, 0, 0], np.uint8), (24, 32, 1))
    xyz_d65 = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    )
    to_camera = np.linalg.inv(xyz_d65) / np.array(gains)[:, None]
    matrix = b"".join(struct.pack("<ii", round(float(v) * 10000), 10000) for v in to_camera.ravel())
    neutral = b"".join(struct.pack("<II", round(10000 * c / g), 10000) for g, c in zip(gains, cast, strict=True))
    data, entries = bytearray(b"II*\0\0\0\0\0"), {}

    def put(value: bytes) -> int:
        data.extend(bytes(len(data) % 2))
        data.extend(value)
        return len(data) - len(value)

    def directory(tags: dict[int, tuple[int, int, bytes]]) -> int:
        rows = b""
        for tag, (kind, count, value) in sorted(tags.items()):
            rows += struct.pack("<HHI", tag, kind, count)
            rows += value.ljust(4, b"\0") if len(value) <= 4 else struct.pack("<I", put(value))
        return put(struct.pack("<H", len(tags)) + rows + bytes(4))

    def short(*values: int) -> tuple[int, int, bytes]:
        return 3, len(values), struct.pack(f"<{len(values)}H", *values)

    def long(*values: int) -> tuple[int, int, bytes]:
        return 4, len(values), struct.pack(f"<{len(values)}I", *values)

    raw = {
        **{254: long(0), 256: long(width), 257: long(height), 258: short(16), 259: short(1), 262: short(32803)},
        **{273: long(put(mosaic.astype("<u2").tobytes())), 277: short(1), 278: long(height)},
        **{279: long(mosaic.nbytes), 33421: short(2, 2), 33422: (1, 4, bytes((0, 1, 1, 2))), 50717: short(65535)},
    }
    entries = {
        **{254: long(1), 256: long(32), 257: long(24), 258: short(8, 8, 8), 259: short(1), 262: short(2)},
        **{271: (2, 5, b"Made\0"), 272: (2, 4, b"One\0"), 273: long(put(preview.tobytes())), 274: short(1)},
        **{277: short(3), 278: long(24), 279: long(preview.nbytes), 330: long(directory(raw))},
        **{50706: (1, 4, bytes((1, 4, 0, 0))), 50708: (2, 9, b"Made One\0"), 50721: (10, 9, matrix)},
        **{50728: (5, 3, neutral), 50778: short(21)},
    }
    data[4:8] = struct.pack("<I", directory(entries))
    return bytes(data)


def ultra_hdr(base: np.ndarray, gain: np.ndarray, stops: float, *, iso: bool = False, quality: int = 98) -> bytes:
    """A JPEG of display values [H, W, 3] with a gain map [h, w] or [h, w, 3] of 0 to so many stops.

    iso: described as by ISO 21496-1; else by XMP.
    """

    def jpeg(picture: np.ndarray) -> bytes:
        stream = io.BytesIO()
        Image.fromarray(eight(picture)).save(stream, "JPEG", quality=quality, subsampling=0)
        return stream.getvalue()

    def with_segment(data: bytes, marker: int, content: bytes) -> bytes:
        return data[:2] + bytes((0xFF, marker)) + struct.pack(">H", len(content) + 2) + content + data[2:]

    name, urn = b"http://ns.adobe.com/xap/1.0/\0", b"urn:iso:std:iso:ts:21496:-1\0"
    said = 'xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0"'
    if iso:
        first, second = (0xE2, urn + bytes(4)), (0xE2, urn + iso_numbers(stops))
    else:
        first = 0xE1, name + f"<x:xmpmeta><rdf:Description {said}/></x:xmpmeta>".encode()
        more = f'{said} hdrgm:GainMapMin="0" hdrgm:GainMapMax="{stops}" hdrgm:Gamma="1" hdrgm:OffsetSDR="0.015625"'
        more += f' hdrgm:OffsetHDR="0.015625" hdrgm:HDRCapacityMax="{stops}" hdrgm:BaseRenditionIsHDR="False"'
        second = 0xE1, name + f"<x:xmpmeta><rdf:Description {more}/></x:xmpmeta>".encode()
    return with_segment(jpeg(base), *first) + with_segment(jpeg(gain), *second)


def iso_numbers(stops: float) -> bytes:
    """Metadata of ISO 21496-1 of a gain map of 0 to so many stops."""
    most = round(stops * 1000)
    head = bytes(4) + b"\x40" + struct.pack(">IIII", 0, 1, most, 1000)
    return head + struct.pack(">iIiIIIiIiI", 0, 1, most, 1000, 1, 1, 1, 64, 1, 64)


def iso_heif(base: np.ndarray, gain: np.ndarray, stops: float) -> bytes:
    """A HEIC of display values [H, W, 3] with a gain map [h, w] by ISO 21496-1.

    Of two pictures, to which the item that makes one of both is added.
    """
    import pillow_heif

    stream, whole = io.BytesIO(), pillow_heif.HeifFile()
    for values in (eight(base), eight(gain)):
        whole.add_from_pillow(Image.fromarray(values))
    whole.save(stream, quality=-1, chroma=444)
    data = bytearray(stream.getvalue().replace(b"auxl", b"none"))
    data[data.index(b"infe", data.index(b"infe") + 4) + 7] |= 1  # the map is hidden
    return _with_tone_map(data, b"\0" + iso_numbers(stops))


def _with_tone_map(data: bytearray, said: bytes) -> bytes:
    """A file of two items with a third, which makes one picture of them as its metadata says."""
    number, at = 99, data.index(b"iloc") + 8
    base = 4 if data[at + 1] >> 4 else 0  # bytes of an item's own offset, beside that of its piece
    assert (data[at - 4], data[at]) == (0, 0x44)
    (count,), width = struct.unpack_from(">H", data, at + 2), 14 + base
    ends = {kind: data.index(kind) - 4 + _size(data, kind) for kind in (b"meta", b"iloc", b"iinf")}
    infe = struct.pack(">I4sIHH4sx", 21, b"infe", 0x02000000, number, 0, b"tmap")
    dimg = struct.pack(">I4sHHHH", 16, b"dimg", number, 2, 1, 2)
    if b"iref" in data:
        ends[b"iref"] = data.index(b"iref") - 4 + _size(data, b"iref")
    else:
        dimg = struct.pack(">I4sI", 12 + len(dimg), b"iref", 0) + dimg
    more = width + len(infe) + len(dimg)
    for k in range(count):
        place = at + 4 + k * width + (4 if base else 6)
        struct.pack_into(">I", data, place, struct.unpack_from(">I", data, place)[0] + more)
    entry = struct.pack(">HH", number, 0) + bytes(base) + struct.pack(">HII", 1, len(data) + more + 8, len(said))
    struct.pack_into(">H", data, at + 2, count + 1)
    place = data.index(b"iinf") + 8
    struct.pack_into(">H", data, place, struct.unpack_from(">H", data, place)[0] + 1)
    for kind, by in {b"meta": more, b"iloc": width, b"iinf": len(infe), b"iref": len(dimg)}.items():
        if kind in ends:
            struct.pack_into(">I", data, data.index(kind) - 4, _size(data, kind) + by)
    inserted = [(ends[b"iloc"], entry), (ends[b"iinf"], infe), (ends.get(b"iref", ends[b"meta"]), dimg)]
    for where, what in sorted(inserted, reverse=True):
        data[where:where] = what
    return bytes(data) + struct.pack(">I4s", 8 + len(said), b"mdat") + said


def _size(data: bytes | bytearray, kind: bytes) -> int:
    return struct.unpack_from(">I", data, data.index(kind) - 4)[0]


def maker_note(headroom: float, gain: float) -> bytes:
    """Of Apple's cameras, with what the brightness of a gain map is told by, in EXIF."""
    first = 16 + 2 * 12 + 4
    note = b"Apple iOS\0\0\1MM" + struct.pack(">H", 2)
    note += struct.pack(">HHII", 33, 10, 1, first) + struct.pack(">HHII", 48, 10, 1, first + 8) + bytes(4)
    note += struct.pack(">iiii", round(headroom * 1e6), 10**6, round(gain * 1e6), 10**6)
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0x927C] = note
    return exif.tobytes()


APPLES_MAP = "urn:com:apple:photo:2020:aux:hdrgainmap"


def apple_heic(base: np.ndarray, gain: np.ndarray, exif: bytes) -> bytes:
    """A HEIC of display values [H, W, 3] with Apple's gain map [H, W]: written as alpha, whose kind is changed then."""
    import pillow_heif

    stream, pixels = io.BytesIO(), eight(np.dstack([base, gain]))
    picture = pillow_heif.from_bytes(mode="RGBA", size=pixels.shape[1::-1], data=pixels.tobytes())
    picture.save(stream, quality=-1, chroma=444, exif=exif)
    data = bytearray(stream.getvalue())
    old, new = b"urn:mpeg:hevc:2015:auxid:1", APPLES_MAP.encode()
    at, more = data.index(old), len(new) - len(old)
    for kind in (b"meta", b"iprp", b"ipco", b"auxC"):  # the boxes around it
        place = data.index(kind) - 4
        data[place : place + 4] = struct.pack(">I", struct.unpack_from(">I", data, place)[0] + more)
    place = data.index(b"iloc") + 8
    assert (data[place - 4], bytes(data[place : place + 2])) == (0, b"\x44\x40")  # version 0, offsets of 4 bytes
    for k in range(struct.unpack_from(">H", data, place + 2)[0]):
        item = place + 4 + k * 18 + 4
        data[item : item + 4] = struct.pack(">I", struct.unpack_from(">I", data, item)[0] + more)
    data[at : at + len(old)] = new
    return bytes(data)


def apple_jpeg(base: np.ndarray, gain: np.ndarray, exif: bytes = b"", headroom: float | None = None) -> bytes:
    """The same as JPEG, with the map as a second picture; headroom: said by the map's XMP."""
    stream = io.BytesIO()
    small = Image.fromarray(eight(gain))
    Image.fromarray(eight(base)).save(
        stream, "MPO", save_all=True, append_images=[small], quality=98, subsampling=0, exif=exif
    )
    data, name = stream.getvalue(), b"http://ns.adobe.com/xap/1.0/\0"
    told = "" if headroom is None else f' HDRGainMap:HDRGainMapHeadroom="{headroom}"'
    said = name + f'<x:xmpmeta HDRGainMap:HDRGainMapVersion="65536"{told}/>'.encode()
    at = data.rindex(b"\xff\xd8\xff") + 2
    return data[:at] + b"\xff\xe1" + struct.pack(">H", len(said) + 2) + said + data[at:]


def float_tiff(pixels: np.ndarray, kind: str = "<f4", profile: bytes = b"") -> bytes:
    """One strip, without compression."""
    height, width, channels = pixels.shape
    order = kind[0]
    data = pixels.astype(kind).tobytes()
    bits = int(kind[2:]) * 8

    def short(value: int) -> bytes:
        return struct.pack(f"{order}HH", value, 0)

    place = 8 + len(data) + len(data) % 2
    entries = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 1, None), (259, 3, 1, None), (262, 3, 1, None)]
    values = {
        258: short(bits),
        259: short(1),
        262: short(2 if channels == 3 else 1),
        277: short(channels),
        339: short(3),
    }
    entries += [(273, 4, 1, 8), (277, 3, 1, None), (278, 4, 1, height), (279, 4, 1, len(data)), (339, 3, 1, None)]
    beyond = place + 2 + 12 * (len(entries) + bool(profile)) + 4
    if profile:
        entries.append((34675, 7, len(profile), beyond))
    rows = b""
    for tag, of, count, value in sorted(entries):
        rows += struct.pack(f"{order}HHI", tag, of, count)
        rows += values[tag] if value is None else struct.pack(f"{order}I", value)
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", place)
    return head + data + bytes(len(data) % 2) + struct.pack(f"{order}H", len(entries)) + rows + bytes(4) + profile
