"""Cubes: the faces' addressing, and KTX2 and glTF files read back by parsers of this test's own."""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import pytest
from PIL import Image
from support.two_phase import assert_same_way_round, probe_directions, two_phase

from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.export.cube_textures import box_mips, cube_faces, face_directions, face_size
from anyprobe.export.exported_light import prepare
from anyprobe.export.scene_files import pack_rgbd, prefiltered
from anyprobe.export.targets import export
from anyprobe.light.environment import reduced
from anyprobe.light.harmonics import sh_basis
from anyprobe.light.light_sources import split_sources

TABLE = {  # face: (2s - 1) and (2t - 1) as signed axes, and the axis they are over
    0: ("-z", "-y", "x"),
    1: ("+z", "-y", "x"),
    2: ("+x", "+z", "y"),
    3: ("+x", "-z", "y"),
    4: ("+x", "-y", "z"),
    5: ("-x", "-y", "z"),
}


def look_up(faces: np.ndarray, c: np.ndarray) -> np.ndarray:
    """A cube [6, S, S, C] asked for directions c [N, 3] by the table above, nearest texel."""
    size = faces.shape[1]
    out = []
    for direction in c:
        part = dict(zip("xyz", direction, strict=True))
        axis = max("xyz", key=lambda a: abs(part[a]))
        face = 2 * "xyz".index(axis) + (part[axis] < 0)
        s, t, over = TABLE[face]
        place = [(1 + (part[name[1]] if name[0] == "+" else -part[name[1]]) / abs(part[over])) / 2 for name in (s, t)]
        column, row = (min(size - 1, int(p * size)) for p in place)
        out.append(faces[face, row, column])
    return np.array(out)


D = probe_directions(150)
ASKED = D * (-1, 1, 1)


def test_face_addressing():
    """A texel's direction is found again on its own face, row and column."""
    c = face_directions(8)
    texels = np.arange(6 * 64).reshape(6, 8, 8, 1)
    np.testing.assert_array_equal(look_up(texels, c.reshape(-1, 3))[:, 0], np.arange(6 * 64))


def test_faces_are_pictures_from_inside():
    """The face that lies ahead (pz of a cube asked with x turned round shows +Z) has its left on the left."""
    faces = cube_faces(two_phase(64), 64)
    assert_same_way_round(look_up(faces, ASKED), D, degrees=2)
    behind = faces[4]  # +Z, what is behind the camera; seen from inside its right is -X
    right = behind[32, 60]
    assert_same_way_round(right[None], np.array([[-0.66, 0, 0.75]]), degrees=3)


def test_six_files_are_pictures_from_inside(tmp_path):
    cv2 = pytest.importorskip("cv2")
    export(two_phase(64), "cube", tmp_path, "vase")
    named = [tmp_path / f"vase_cube_{face}.hdr" for face in ("px", "nx", "py", "ny", "pz", "nz")]
    faces = np.array([cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1] for path in named])
    assert_same_way_round(look_up(faces, ASKED), D, degrees=2)


def test_cube_keeps_the_light():
    radiance = two_phase(64)
    radiance[20, 30] = 500
    faces = cube_faces(radiance, face_size(64))
    a = (np.arange(64) + 0.5) / 32 - 1
    weights = (1 + a[:, None] ** 2 + a**2) ** -1.5 * (2 / 64) ** 2
    np.testing.assert_allclose(weights.sum() * 6, 4 * np.pi, rtol=1e-3)
    ours = prepare(radiance, "x").sh_full[0] * 3.5449077
    np.testing.assert_allclose((faces * weights[None, :, :, None]).sum(axis=(0, 1, 2)), ours, rtol=0.02)
    levels = box_mips(faces)
    assert [level.shape[1] for level in levels] == [64, 32, 16, 8, 4, 2, 1]
    np.testing.assert_allclose(levels[-1].mean(axis=(0, 1, 2)), faces.mean(axis=(0, 1, 2)), rtol=1e-5)


@pytest.mark.parametrize(("height", "side"), [(1, 1), (2, 2), (33, 64), (64, 64), (4096, 1024)])
def test_face_size(height, side):
    assert face_size(height) == side


def parse_ktx2(data: bytes) -> list[np.ndarray]:
    """Mips [6, S, S, 4] of a .ktx2 of half floats, everything in the header checked."""
    assert data[:12] == bytes.fromhex("AB4B5458203230BB0D0A1A0A")
    vk, type_size, width, height, depth, layers, faces, count, scheme = struct.unpack_from("<9I", data, 12)
    assert (vk, type_size, depth, layers, faces, scheme) == (97, 2, 0, 0, 6, 0)
    assert width == height
    dfd_at, dfd_length, kvd_at, kvd_length, sgd_at, sgd_length = struct.unpack_from("<4I2Q", data, 48)
    assert (sgd_at, sgd_length) == (0, 0)
    assert dfd_at == 80 + 24 * count
    assert struct.unpack_from("<I", data, dfd_at)[0] == dfd_length == 4 + 24 + 4 * 16
    vendor, version, block = struct.unpack_from("<IHH", data, dfd_at + 4)
    assert (vendor, version, block) == (0, 2, 88)
    assert list(data[dfd_at + 12 : dfd_at + 16]) == [1, 1, 1, 0]  # RGBSDA, BT.709, linear
    assert data[dfd_at + 20] == 8  # bytes of a texel
    for i, channel in enumerate((0, 1, 2, 15)):
        offset, length, kind = struct.unpack_from("<HBB", data, dfd_at + 28 + 16 * i)
        assert (offset, length, kind) == (16 * i, 15, channel | 0xC0)
    pairs, at = {}, kvd_at
    while at < kvd_at + kvd_length:
        (length,) = struct.unpack_from("<I", data, at)
        key, _, value = data[at + 4 : at + 4 + length].partition(b"\0")
        pairs[key.decode()] = value
        at += 4 + length + -length % 4
    assert pairs["KTXorientation"] == b"rd\0"
    assert list(pairs) == sorted(pairs)
    levels, ends = [], []
    for i in range(count):
        start, length, plain = struct.unpack_from("<3Q", data, 80 + 24 * i)
        assert length == plain == 6 * (width >> i) ** 2 * 8
        assert start % 8 == 0
        ends.append(start + length)
        levels.append(np.frombuffer(data, "<f2", length // 2, start).reshape(6, width >> i, width >> i, 4))
    assert ends == sorted(ends, reverse=True)  # the smallest first in the file
    assert ends[0] == len(data)
    return levels


def file_of(target: str, folder, radiance, suffix: str) -> bytes:
    return next(p for p in export(radiance, target, folder) if p.name.endswith(suffix)).read_bytes()


def test_ktx2_read_back(tmp_path):
    radiance = two_phase(32)
    levels = parse_ktx2(file_of("ktx2", tmp_path, radiance, ".ktx2"))
    wanted = box_mips(cube_faces(radiance, 32))
    assert len(levels) == len(wanted) == 6
    for level, want in zip(levels, wanted, strict=True):
        np.testing.assert_allclose(level[..., :3], want, atol=1e-3)
        np.testing.assert_array_equal(level[..., 3], 1)
    assert_same_way_round(look_up(levels[0][..., :3].astype(float), ASKED), D, degrees=4)


def test_half_floats_clip_and_say_so(tmp_path):
    radiance = np.full((16, 32, 3), 1.0, np.float32)
    radiance[4:6, 8:10] = 1e6
    with pytest.warns(RuntimeWarning, match="^ktx2: .*% of the light exceeds the range"):
        data = file_of("ktx2", tmp_path, radiance, ".ktx2")
    assert all(np.isfinite(level).all() for level in parse_ktx2(data))
    said = json.loads((tmp_path / "light_ktx2.json").read_text())
    assert 0.8 < said["clipped_energy"] < 0.95
    assert [one["code"] for one in said["warnings"]] == ["range-clipped"]


def parse_glb(data: bytes) -> tuple[dict, bytes]:
    magic, version, length = struct.unpack_from("<4s2I", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    text_length, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    blob_length, kind = struct.unpack_from("<I4s", data, 20 + text_length)
    assert kind == b"BIN\0"
    assert text_length % 4 == blob_length % 4 == 0
    return json.loads(data[20 : 20 + text_length]), data[28 + text_length :]


def unpack_rgbd(rgba: np.ndarray) -> np.ndarray:
    """As Babylon.js reads it."""
    return (rgba[..., :3] / 255.0) ** 2.2 / (rgba[..., 3:] / 255.0)


def lit_map() -> np.ndarray:
    radiance = 0.5 * two_phase(64)
    radiance[10:13, 90:94] += 40
    radiance[40:43, 20:24] += (20, 16, 12)
    return radiance


def test_gltf_lacks_faces_coefficients_or_a_source(tmp_path):
    radiance = lit_map()
    document, blob = parse_glb(file_of("gltf", tmp_path, radiance, ".glb"))
    (light,) = document["extensions"]["EXT_lights_image_based"]["lights"]
    sources, ambient = split_sources(radiance)
    assert light["specularImageSize"] == 64
    assert [len(level) for level in light["specularImages"]] == [6, 6, 6]
    pictures = []
    for image in document["images"]:
        view = document["bufferViews"][image["bufferView"]]
        png = blob[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        pictures.append(np.asarray(Image.open(io.BytesIO(png)), float))
    assert [p.shape for p in pictures[::6]] == [(64, 64, 4), (32, 32, 4), (16, 16, 4)]
    faces = unpack_rgbd(np.array([pictures[i] for i in light["specularImages"][0]]))
    seen = look_up(faces[:, ::-1], ASKED)  # as tests/targets/test_export_gltf.py finds Babylon.js to read it
    np.testing.assert_allclose(seen, bilinear(ambient, direction_to_uv(D)), atol=0.03)
    rough = unpack_rgbd(np.array([pictures[i] for i in light["specularImages"][2]]))[:, ::-1]
    hemisphere = look_up(rough, ASKED)
    assert_same_side(hemisphere, ambient)
    n = sources[0].direction[None].astype(np.float64)
    e = sh_basis(n * (1, -1, 1)) @ np.array(light["irradianceCoefficients"])
    np.testing.assert_allclose(
        e, sh_basis(n) @ (prepare(radiance, "x", sources=True).sh_ambient * _cosine()), rtol=1e-5
    )
    suns = document["extensions"]["KHR_lights_punctual"]["lights"]
    assert len(suns) == len(sources) == 2
    assert document["scenes"][0]["nodes"] == [0, 1]
    for node, source in zip(document["nodes"], sources, strict=True):
        sun = suns[node["extensions"]["KHR_lights_punctual"]["light"]]
        np.testing.assert_allclose(np.multiply(sun["color"], sun["intensity"]), source.irradiance, rtol=1e-5)
        assert sun["extras"]["angle_deg"] == pytest.approx(2 * source.radius_deg, rel=1e-3)
        matrix = np.reshape(node["matrix"], (4, 4)).T  # columns first in the file
        np.testing.assert_allclose(matrix @ (0, 0, -1, 0), (*-source.direction, 0), atol=1e-5)


@pytest.mark.ci
def test_a_sun_between_the_points_of_a_large_map_is_not_lost():
    d = pixel_directions(1024)
    sun = np.where(d @ (0.48, 0.6, -0.64) > np.cos(np.radians(0.55)), 1e4, 0.01)
    large = np.repeat(sun[..., None], 3, axis=-1).astype(np.float32)
    assert 30 < (sun > 1).sum() < 50
    found, expected = (prefiltered(one, 32)[-1].max() for one in (large, reduced(large, 128)))
    assert found == pytest.approx(expected, rel=0.05)


def assert_same_side(blurred: np.ndarray, radiance: np.ndarray) -> None:
    """What is blurred by roughness 1 is brighter in red where E / pi is, mirrored or turned it is not."""
    sh = prepare(radiance, "x").sh_full
    e = sh_basis(D) @ (sh * _cosine()) / np.pi
    for channel in range(3):
        assert np.corrcoef(blurred[:, channel], e[:, channel])[0, 1] > 0.98


def _cosine():
    return np.array([np.pi, *[2 * np.pi / 3] * 3, *[np.pi / 4] * 5])[:, None]


def test_rgbd_keeps_values_up_to_255(rng):
    values = 10 ** rng.uniform(-2, 2.4, (1000, 1)) * rng.uniform(0.5, 1, (1000, 3))
    np.testing.assert_allclose(unpack_rgbd(pack_rgbd(values).astype(float)), values, rtol=0.06)
    np.testing.assert_allclose(unpack_rgbd(pack_rgbd(np.full((1, 3), 1e5)).astype(float)), 255, rtol=1e-6)
    np.testing.assert_array_equal(pack_rgbd(np.zeros((1, 3))), [[0, 0, 0, 255]])
