"""Files as programs write them that most readers do not expect: read rightly, or refused in one line."""

from __future__ import annotations

import io
import json
import struct
import zipfile

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.refused import refused

from anyprobe.errors import InvalidMask
from anyprobe.estimate.photo import load_photo
from anyprobe.files.objects import read_mesh
from anyprobe.maps.radiance import write_exr
from anyprobe.masks.depth import depth_of_view
from anyprobe.match.library import open_library
from anyprobe.pictures.headers import jxl_size
from anyprobe.pictures.images import read_image

ONE = np.ones((8, 8), np.float32)


@pytest.mark.parametrize("channel", ["Depth.Z", "Depth.V"])
def test_depth_among_layers_is_not_the_normals(tmp_path, channel):
    layers = {f"Layer.Combined.{one}": ONE * 0.1 * i for i, one in enumerate("RGB")}
    layers |= {f"Layer.Normal.{one}": ONE for one in "XYZ"} | {f"Layer.{channel}": 3.25 * ONE}
    OpenEXR.File({}, layers).write(str(tmp_path / "d.exr"))
    assert np.unique(depth_of_view(str(tmp_path / "d.exr"), (8, 8))).tolist() == [3.25]


def test_colours_are_no_depth(tmp_path):
    OpenEXR.File({}, {one: ONE * (1 + i) for i, one in enumerate("RGB")}).write(str(tmp_path / "c.exr"))
    with refused("depth", source="c.exr", naming="B, G, R", kind=InvalidMask):
        depth_of_view(str(tmp_path / "c.exr"), (8, 8))
    OpenEXR.File({}, dict.fromkeys("RGB", 2 * ONE)).write(str(tmp_path / "g.exr"))
    assert depth_of_view(str(tmp_path / "g.exr"), (8, 8)).max() == 2
    colored = Image.fromarray(np.arange(192, dtype=np.uint8).reshape(8, 8, 3)).quantize(16)
    colored.save(tmp_path / "c.png")
    with refused("depth", source="c.png", naming="coloured", kind=InvalidMask):
        depth_of_view(str(tmp_path / "c.png"), (8, 8))


@pytest.mark.parametrize(
    ("start", "naming"),
    [
        (b"version https://git-lfs.github.com/spec/v1", "git lfs pull"),
        (b"<!DOCTYPE html><title>404</title>", "web page"),
        (b"gimp xcf v011", "GIMP"),
        (b"SDPX\0\0\x08\0V1.0", "OpenEXR"),
    ],
)
def test_what_stands_in_a_photo_s_place_is_named(start, naming):
    with refused(code="invalid-image", naming=naming):
        read_image(start + bytes(64))


def test_a_photo_of_all_around_is_doubted():
    """Its metadata are Photo Sphere's."""
    stream = io.BytesIO()
    xmp = b'<rdf:Description GPano:ProjectionType="equirectangular"/>'
    Image.new("RGB", (128, 64)).save(stream, "JPEG", xmp=xmp)
    (notice,) = read_image(stream.getvalue()).warnings
    assert notice.code == "environment-map"
    assert read_image(stream.getvalue(), as_data=True).warnings == ()


def tetrahedron(x: int) -> str:
    corners = "".join(f"v {x + a} {b} {c}\n" for a, b, c in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))
    return corners + "f -4 -2 -3\nf -4//-4 -1//-4 -2//-4\nf -4 -3 -1\nf -3 -2 -1\n"


def test_faces_that_count_back(tmp_path):
    """Each block of an OBJ by the vertices before it."""
    normals = "vn 0 0 1\n" * 4
    (tmp_path / "two.obj").write_text(normals + tetrahedron(0) + tetrahedron(3))
    mesh = read_mesh(tmp_path / "two.obj")
    assert len(mesh.faces) == 8
    x = np.unique(np.round(mesh.positions[:, 0] - mesh.positions[:, 0].min(), 4))
    assert len(x) == 4, "two of them, side by side"
    (tmp_path / "zero.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 0")
    with refused(code="invalid-mesh", source="zero.obj", naming="vertex 0"):
        read_mesh(tmp_path / "zero.obj")


def test_packed_and_mixed_meshes_say_what_to_do(tmp_path):
    scene = json.dumps({"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]}).encode()
    scene += b" " * (-len(scene) % 4)
    chunk = struct.pack("<I4s", len(scene), b"JSON") + scene
    (tmp_path / "a.glb").write_bytes(struct.pack("<4s2I", b"glTF", 2, 12 + len(chunk)) + chunk)
    with refused(code="invalid-mesh", source="a.glb", naming="KHR_draco_mesh_compression"):
        read_mesh(tmp_path / "a.glb")
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 5\n" + "".join(f"property float {c}\n" for c in "xyz")
    head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    body = np.arange(15, dtype="<f4").tobytes() + struct.pack("<B4iB3i", 4, 0, 1, 2, 3, 3, 0, 1, 4)
    (tmp_path / "a.ply").write_bytes(head.encode() + body)
    with refused(code="invalid-mesh", source="a.ply", naming="polygons of one kind"):
        read_mesh(tmp_path / "a.ply")


def test_whole_numbers_of_twelve_and_of_signed_sixteen_bits():
    def tiff(bits: int, sample_format: int, data: bytes) -> bytes:
        tags = [(256, 3, 32), (257, 3, 32), (258, 3, bits), (259, 3, 1), (262, 3, 1), (273, 4, 8), (277, 3, 1)]
        tags += [(278, 3, 32), (279, 4, len(data)), (339, 3, sample_format)]
        body = data.ljust(8, b"\0")
        entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
        start = struct.pack("<2sHI", b"II", 42, 8 + len(body))
        return start + body + struct.pack("<H", len(tags)) + entries + bytes(4)

    twelve = read_image(tiff(12, 1, bytes([0xFF, 0xF8, 0x00]) * 512))  # 4095, 2048
    np.testing.assert_allclose(twelve.rgb[0, :2, 0], [1.0, 0.5], atol=1e-3)
    signed = read_image(tiff(16, 2, struct.pack("<2h", 32767, 0) * 512))
    np.testing.assert_allclose(signed.rgb[0, :2, 0], [1.0, 0.0], atol=1e-3)


def test_size_of_a_jpeg_xl_is_that_of_its_codestream():
    def box(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I4s", 8 + len(data), kind) + data

    def code(width: int, height: int) -> bytes:
        bits = 0 | 0 << 1 | (height - 1) << 3 | 0 << 12 | 0 << 15 | (width - 1) << 17  # 9 bits each, no ratio
        return b"\xff\x0a" + bits.to_bytes(16, "little")

    start = b"\0\0\0\x0cJXL \r\n\x87\n"
    lie = box(b"free", b"jxlc" + code(40, 40))
    exif = box(b"Exif", bytes(100_000))
    assert jxl_size(start + lie + exif + box(b"jxlc", code(96, 48))) == (96, 48)
    half = code(96, 48)
    parts = box(b"jxlp", bytes(4) + half[:5]) + box(b"jxlp", struct.pack(">I", 1 | 1 << 31) + half[5:])
    assert jxl_size(start + parts) == (96, 48)


def test_a_small_map_is_left_out_and_an_archive_is_no_library(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "maps"
    folder.mkdir()
    rng = np.random.default_rng(2)
    write_exr(folder / "place.exr", rng.uniform(0.1, 2.0, (64, 128, 3)).astype(np.float32))
    write_exr(folder / "irradiance.exr", np.ones((16, 32, 3), np.float32))
    library = open_library(folder)
    assert library.names == ("place",)
    assert library.faults == ("irradiance.exr: expected at least 32 rows, got 16; use a larger map",)
    with zipfile.ZipFile(tmp_path / "maps.zip", "w") as file:
        file.write(folder / "place.exr", "place.exr")
    with refused(source="maps.zip", naming="ZIP"):
        open_library(tmp_path / "maps.zip")


def test_transparency_that_leaves_nearly_all_is_doubted():
    photo = np.full((100, 120, 4), 200, np.uint8)
    photo[:, :, 0] = np.arange(120)
    photo[:8, :8, 3] = 0
    (line,) = (one for one in load_photo(photo).warnings if "transparency" in one)
    assert (line.code, [one.name for one in line.remedy]) == ("alpha-wide", ["click", "box", "mask"])
    photo[:40, :, 3] = 0
    assert not any("transparency" in one for one in load_photo(photo).warnings)
