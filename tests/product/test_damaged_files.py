"""Files that cannot be used, of every kind: one clear line each, by its code; and whatever else they may hold, too."""

from __future__ import annotations

import io
import json
import os
import random
import struct
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.hostile_files import instanced_glb
from support.mesh_files import glb, obj, off, ply, stl
from support.mutate import mutated
from support.picture_files import float_tiff, scene
from support.refused import refused

from anyprobe.errors import AnyprobeError, InputError, InvalidEnvironment, InvalidMask, InvalidMesh, InvalidPhoto
from anyprobe.estimate.normals_hint import read_normals
from anyprobe.estimate.result import Light
from anyprobe.files.objects import MESH_SUFFIXES, read_mesh
from anyprobe.maps.radiance import read_radiance, write_exr, write_hdr
from anyprobe.masks.depth import read_depth
from anyprobe.pictures.images import read_image

INPUTS = int(os.environ.get("ANYPROBE_INPUTS", 60))
"""How many mutated files each parser is fed."""
SECONDS = 5.0
"""Most of the processor's time that one file may take."""


class Reader(NamedTuple):
    read: Callable[[Path], Any]
    error: type[AnyprobeError]
    code: str


PHOTO = Reader(read_image, InvalidPhoto, "invalid-image")
MAP = Reader(read_radiance, InvalidEnvironment, "invalid-map")
MESH = Reader(read_mesh, InvalidMesh, "invalid-mesh")
DEPTH = Reader(read_depth, InvalidMask, "invalid-option")
NORMALS = Reader(lambda path: read_normals(path, (8, 9)), InputError, "invalid-option")
SIDECAR = Reader(lambda path: Light.load(path.with_suffix(".exr")), InputError, "invalid-option")


# Photos


def saved(image: Image.Image, kind: str) -> bytes:
    stream = io.BytesIO()
    image.save(stream, kind)
    return stream.getvalue()


def half(data: bytes) -> bytes:
    return data[: len(data) // 2]


def png_of(width: int, height: int) -> bytes:
    """A PNG whose header tells a size that its pixels do not have."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"\0" * 64)) + chunk(b"IEND", b"")


def exr(pixels: np.ndarray, names: str = "RGB", **header: object) -> bytes:
    stream = io.BytesIO()
    told = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(told, {c: np.ascontiguousarray(pixels[..., k], np.float32) for k, c in enumerate(names)}).write(stream)
    return stream.getvalue()


NOISE = Image.fromarray(np.random.default_rng(0).integers(0, 256, (40, 80, 3), np.uint8))
ONES = np.ones((40, 80, 3))
PHOTOS = {
    "empty.jpg": b"",
    "text.jpg": b"not a picture\n" * 50,
    "postscript.eps": b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 64 64\n%%EndComments\nshowpage\n",
    **{f"cut.{kind.lower()}": half(saved(NOISE, kind)) for kind in ("JPEG", "PNG", "WEBP")},
    "cut.tiff": float_tiff(scene())[:4000],
    "cut.exr": half(exr(ONES)),
    "start.exr": exr(ONES)[:20],
    "start.webp": b"RIFF\x10\0\0\0WEBPVP8 ",
    "start.jpeg": b"\xff\xd8\xff\xe0\0",
    "start.avif": b"\0\0\0\x18ftypavif" + bytes(40),
    "video.jpg": b"\0\0\0\x18ftypisom" + bytes(40),
    "layers.psd": b"8BPS\0\1" + bytes(40),
    "floats.pfm": b"PF\n4 4\n-1.0\n" + bytes(200),
    "tiny.png": saved(Image.new("RGB", (1, 1)), "PNG"),
    "narrow.png": saved(Image.new("RGB", (31, 200)), "PNG"),
    "huge.png": png_of(30000, 30000),
    "large.png": png_of(10001, 10000),
    "line.png": saved(Image.new("1", (3_000_000, 32)), "PNG"),
    "nan.exr": exr(np.where(np.arange(80)[:, None] == 4, np.nan, ONES)),
    "depth.exr": exr(ONES, "Z"),
    "words.exr": exr(ONES, chromaticitiez="red").replace(b"chromaticitiez", b"chromaticities"),
}

# Maps


def written(write: Callable, radiance: np.ndarray) -> bytes:
    path = Path(f"map.{'hdr' if write is write_hdr else 'exr'}")
    write(path, radiance)
    data = path.read_bytes()
    path.unlink()
    return data


def hdr(height: int, width: int, pixels: bytes, lines: str = "FORMAT=32-bit_rle_rgbe\n") -> bytes:
    return f"#?RADIANCE\n{lines}\n-Y {height} +X {width}\n".encode() + pixels


GREY = b"\x80" * 128
PACKED = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + (b"\x02\x02\x00\x10" + b"\x90\x80" * 4) * 8
MAPS = {
    "empty.hdr": b"",
    "empty.exr": b"",
    "text.exr": b"text" * 100,
    **{f"cut to {size}.hdr": PACKED[:size] for size in (5, 60, 100, -1)},
    **{f"cut to {share:.0%}.exr": (data := exr(ONES))[: int(share * len(data))] for share in (0.02, 0.5, 0.95)},
    "png.hdr": saved(NOISE, "PNG"),
    "jpeg.exr": saved(NOISE, "JPEG"),
    "png.png": saved(NOISE, "PNG"),
    "no suffix": b"something",
    "literal of no length.hdr": hdr(4, 8, b"\x02\x02\x00\x08" + b"\x00" * 400),
    "run over the end.hdr": hdr(4, 8, b"\x02\x02\x00\x08" + b"\xff\x07" * 100),
    "repeats over the end.hdr": hdr(4, 8, bytes((9, 9, 9, 128, 1, 1, 1, 7)) * 4),
    "huge.hdr": hdr(60000, 60000, b"\x00" * 100),
    "large.hdr": hdr(8000, 16000, b"\x00" * 100),
    "of nothing.hdr": hdr(0, 0, b""),
    "cmyk.hdr": hdr(4, 8, GREY, "FORMAT=32-bit_rle_cmyk\n"),
    "negative exposure.hdr": hdr(4, 8, GREY, "EXPOSURE=-1\n"),
    "word as exposure.hdr": hdr(4, 8, GREY, "EXPOSURE=bright\n"),
    "two corrections.hdr": hdr(4, 8, GREY, "COLORCORR=1 2\n"),
    "gamma.hdr": hdr(4, 8, GREY, "GAMMA=2.2\n"),
    "words as primaries.hdr": hdr(4, 8, GREY, "PRIMARIES=red green\nFORMAT=32-bit_rle_rgbe\n"),
    "two primaries.hdr": hdr(4, 8, GREY, "PRIMARIES=0.64 0.33\nFORMAT=32-bit_rle_rgbe\n"),
    "no direction.hdr": b"#?RADIANCE\n\n+X 8 -X 4\n" + GREY,
    "square.hdr": hdr(8, 8, b"\x80" * 256),
    "square.exr": exr(np.ones((16, 16, 3))),
    **{f"{bad}.exr": exr(np.where(np.arange(80)[:, None] == 4, bad, ONES)) for bad in (np.nan, np.inf, -0.5)},
    "line.exr": exr(np.zeros((2, 70_000, 3))),
}

# Meshes

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
FACES = np.array([(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)])
LINE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
WITH_NAN, WITH_INFINITY = (np.where(np.arange(8)[:, None] == 3, bad, CUBE) for bad in (np.nan, np.inf))
WHOLE = {"ply": ply(CUBE, FACES), "glb": glb(CUBE, FACES), "stl": stl(CUBE, FACES), "off": off(CUBE, FACES)}
WHOLE["binary.ply"] = ply(CUBE, FACES, binary=True)
MESHES = {
    **{f"a.{name}": b"something" for name in ("fbx", "ply.txt", "png")},
    **{
        f"{name}{suffix}": data
        for suffix in MESH_SUFFIXES
        for name, data in {
            "empty": b"",
            "letter": b"Dear reader,\nthis is a letter.\n" * 20,
            "zeros": bytes(200),
            "picture": b"\x89PNG\r\n\x1a\n" + bytes(99),
        }.items()
    },
    **{
        f"cut to {share:.0%}.{name}": data[: int(share * len(data))]
        for share in (0.02, 0.6, 0.99)
        for name, data in WHOLE.items()
    },
    "faces lost.ply": b"".join(WHOLE["ply"].splitlines(keepends=True)[:-3]),
    "faces lost.off": b"".join(WHOLE["off"].splitlines(keepends=True)[:-3]),
    "no faces.ply": ply(CUBE, []),
    "nothing.ply": ply([], []),
    "no faces.obj": obj(CUBE, []),
    "no faces.off": off(CUBE, []),
    "no faces.stl": stl(CUBE, np.zeros((0, 3), int)),
    "nan.ply": ply(WITH_NAN, FACES),
    "infinity.ply": ply(WITH_INFINITY, FACES, binary=True),
    "nan.stl": stl(WITH_NAN, FACES),
    "nan.glb": glb(WITH_NAN, FACES),
    "1e300.obj": obj(np.where(np.isnan(WITH_NAN), 1e300, CUBE), FACES),
    "one point.ply": ply(CUBE * 0 + 2.5, FACES),
    "one point.glb": glb(CUBE * 0 + 2.5, FACES),
    "no area.ply": ply(LINE, [(0, 1, 2)]),
    "no area.obj": obj(LINE, [(0, 0, 1), (2, 1, 2)]),
    "flat corners.obj": b"v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n",
    "vertex 8.ply": ply(CUBE, [(0, 1, 2), (0, 1, 8)]),
    "vertex -1.ply": ply(CUBE, [(0, 1, 2), (0, 1, -1)], binary=True),
    "vertex 8.off": off(CUBE, [(0, 1, 2), (0, 1, 8)]),
    "vertex 8.glb": glb(CUBE, [(0, 1, 2), (0, 1, 8)]),
    "vertex 8.obj": obj(CUBE, [(0, 1, 2), (0, 1, 8)]),
    "vertex 0.obj": obj(CUBE, [(0, 1, 2), (3, 2, -1)]),
    "vertex 0 of a texture.obj": obj(CUBE, []) + b"f 1/1 2/1 0/1\n",
    "more numbers than bytes.glb": instanced_glb(1, count=3_000_000_000),
}

# What stands beside a map, and arrays

SAID = Light(radiance=np.full((8, 16, 3), 0.5, np.float32)).sidecar()
TEXT = json.dumps(SAID).encode()
GROUND = {"pitch_deg": 20.0, "pitch_error_deg": 4.0, "roll_deg": 3.0, "contact": [1, 2], "source": "given"}
CHANGES: dict[str, dict[str, object]] = {
    "share as a word": {"well_exposed_fraction": "much"},
    "share of two": {"well_exposed_fraction": 2},
    "warnings as a number": {"warnings": 3, "notices": []},
    "notice without text": {"notices": [{"code": "x"}]},
    "half a ground": {"ground": {"pitch_deg": 3}},
    "ground as a number": {"ground": 5},
    "ground of another field": {"ground": GROUND | {"height": 2}},
    "contact as a number": {"ground": GROUND | {"contact": 7}},
    "pitch as a word": {"ground": GROUND | {"pitch_deg": "20"}},
    "no roll": {"ground": GROUND | {"roll_deg": None}},
    "several errors of the pitch": {"ground": GROUND | {"pitch_error_deg": [1]}},
    "turn of two shapes": {"camera_from_crop": [[1, 2], [3]]},
    "turn that stretches": {"camera_from_crop": (2 * np.eye(3)).tolist()},
}
SIDECARS = {
    "half.json": half(TEXT),
    "empty.json": b"",
    "latin.json": TEXT[:-1] + b', "photo": "k\xe9pt"}',
    "zeros.json": bytes(len(TEXT)),
    "deep.json": b"[" * 200_000,
    "text.json": b"not JSON",
    **{f"{name}.json": json.dumps(SAID | change).encode() for name, change in CHANGES.items()},
    **{
        f"long {key}.json": json.dumps(SAID | {key: 7}).replace(f'"{key}": 7', f'"{key}": {"9" * 400}').encode()
        for key in ("well_exposed_fraction", "camera_from_crop")
    },
}


def npy(values: np.ndarray, save: Callable = np.save) -> bytes:
    stream = io.BytesIO()
    save(stream, values)
    return stream.getvalue()


VECTORS = np.full((8, 9, 3), 0.577, np.float32)
ARRAYS = {
    "start.npy": b"\x93NUMPY\x01\x00",
    "several.npy": npy(VECTORS, np.savez),
    "cut.npy": half(npy(VECTORS)),
    "text.npy": b"nothing",
    "none.npy": npy(0 * VECTORS),
    "nan.npy": npy(np.nan * VECTORS),
    "of another size.npy": npy(VECTORS[:, 1:]),
}
CORPUS = {
    f"{kind}: {name}": (reader, name, data)
    for kind, reader, files in (
        ("photo", PHOTO, PHOTOS),
        ("map", MAP, MAPS),
        ("mesh", MESH, MESHES),
        ("sidecar", SIDECAR, SIDECARS),
        ("normals", NORMALS, ARRAYS),
        ("depth", DEPTH, {f"text.{kind}": b"nothing" for kind in ("png", "exr", "npy", "txt")}),
    )
    for name, data in files.items()
}


@pytest.mark.parametrize("name", CORPUS)
def test_what_cannot_be_used_is_one_line_that_names_the_file(tmp_path, name, capfd):
    reader, file, data = CORPUS[name]
    if reader is SIDECAR:
        write_exr((tmp_path / file).with_suffix(".exr"), np.full((8, 16, 3), 0.5, np.float32))
    (tmp_path / file).write_bytes(data)
    with pytest.raises(reader.error) as error:
        reader.read(tmp_path / file)
    assert error.value.code == reader.code
    assert Path(error.value.notice.source).stem == Path(file).stem
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize(
    ("reader", "name", "data", "said"),
    [
        (MESH, "a.glb", b"glTF" + struct.pack("<4I", 1, 200, 100, 0) + bytes(200), "expected glTF 2, got version 1; "),
        (PHOTO, "a.jpg", saved(NOISE, "JPEG").replace(b"\n", b"\r\n"), "expected a JPEG as it was saved, got "),
    ],
)
def test_what_happened_to_a_file_is_said(tmp_path, reader, name, data, said):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(reader.error, match=f"^{name}: {said}"):
        reader.read(tmp_path / name)


@pytest.mark.parametrize("reader", [PHOTO, MAP, MESH, DEPTH, NORMALS])
@pytest.mark.parametrize("place", ["absent", "folder"])
def test_what_is_not_there_is_one_line(tmp_path, reader, place):
    suffix = {MAP: ".exr", MESH: ".ply"}.get(reader, ".png")
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(reader.error) as error:
        reader.read(tmp_path / f"{place}{suffix}")
    assert (error.value.code, Path(error.value.notice.source).stem) == (reader.code, place)


@pytest.mark.parametrize("source", [42, "https://example.com/a.jpg", "no\0ne.jpg", np.zeros(40)])
def test_what_is_no_file_is_no_photo(source):
    with refused(code="invalid-image"):
        read_image(source)


PARSERS = (
    "photo encoded extra linear header exr hdr radiance attributes "
    f"{' '.join(MESH_SUFFIXES)} poses sidecar normals depth video"
).split()


def complaint(read: Callable[[bytes], object], data: bytes) -> str:
    """What refuses a file; empty where it is read."""
    try:
        read(data)
    except AnyprobeError as error:
        return str(error)
    return ""


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", PARSERS)
def test_whatever_a_file_holds_it_is_read_or_refused_in_one_line(name):
    """Whole ones, and those with bytes changed, cut and put in, which are the same each time."""
    parsers = pytest.importorskip("support.parsers", reason="needs the video extra", exc_type=ImportError)
    assert set(parsers.PARSERS) == set(PARSERS)
    seeds, read = parsers.PARSERS[name]
    seeds, rng = seeds(), random.Random(name)
    assert "" in [complaint(read, data) for data in seeds]
    for number in range(INPUTS):
        data, began = mutated(rng.choice(seeds), seeds, rng), time.process_time()
        assert "\n" not in complaint(read, data), number
        assert time.process_time() - began < SECONDS, number
