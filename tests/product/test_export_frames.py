"""Every roll against the target's own formula, read by brute force; the formulas are written here again."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.refused import refused
from support.two_phase import assert_same_way_round, probe_directions, two_phase

from anyprobe.core.frames import rotation_y, world_from_camera
from anyprobe.core.latlong import bilinear
from anyprobe.estimate.result import Light
from anyprobe.export.target_frames import OPENEXR, THREE
from anyprobe.export.targets import export
from anyprobe.maps.radiance import read_radiance

TAU = 2 * np.pi
LAYOUTS = {
    # axes of the target from ours, u of a direction in them, which component is up
    "three": (lambda x, y, z: (x, y, z), lambda x, y, z: 0.5 + np.arctan2(z, x) / TAU, 1),
    "usd": (lambda x, y, z: (x, y, z), lambda x, y, z: 0.5 - np.arctan2(x, z) / TAU, 1),
    "blender": (lambda x, y, z: (x, -z, y), lambda x, y, z: 0.5 - np.arctan2(y, x) / TAU, 2),
    "unity": (lambda x, y, z: (x, y, -z), lambda x, y, z: 0.5 - np.arctan2(z, x) / TAU, 1),
    "unreal": (lambda x, y, z: (-z, x, y), lambda x, y, z: 0.5 + np.arctan2(x, -y) / TAU, 2),
}


def read_as(target: str, picture: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The colours that a target sees along our directions [N, 3], by its own formula."""
    axes, u_of, up = LAYOUTS[target]
    there = np.stack(axes(*d.T), axis=-1)
    uv = np.stack([u_of(*there.T) % 1.0, np.arccos(there[:, up]) / np.pi], axis=-1)
    return bilinear(picture, uv)


@pytest.mark.parametrize("target", LAYOUTS)
def test_map_is_rolled_wrongly(target, tmp_path):
    files = {path.suffix: path for path in export(two_phase(), target, tmp_path) if "_ambient" not in path.name}
    picture = read_radiance(files[".hdr"] if ".hdr" in files else files[".exr"])
    d = probe_directions(200)
    assert_same_way_round(read_as(target, picture, d), d, degrees=0.5)


@pytest.mark.parametrize("target", LAYOUTS)
def test_mirrored_map_would_be_seen(target, tmp_path):
    files = [path for path in export(two_phase(), target, tmp_path) if path.suffix in (".hdr", ".exr")]
    d = probe_directions(200)
    with pytest.raises(AssertionError, match="the picture of"):
        assert_same_way_round(read_as(target, read_radiance(files[0])[:, ::-1], d), d, degrees=20)


@pytest.mark.parametrize(
    ("target", "u"), [(None, "0.5 + atan2(x, -z)"), ("blender", "0.5 - atan2(y, x)"), ("usd", "0.5 - atan2(x, z)")]
)
def test_header_says_how_the_map_lies(target, u, tmp_path):
    """envmap is the same in all of them, so that it cannot."""
    import OpenEXR

    if target is None:
        path = Light(radiance=two_phase(16)).save(tmp_path / "light.exr")
    else:
        path = next(p for p in export(two_phase(16), target, tmp_path) if p.suffix == ".exr")
    with OpenEXR.File(str(path), header_only=True) as opened:
        header = dict(opened.header())
    assert header["envmap"] == OpenEXR.ENVMAP_LATLONG
    assert f"u = {u} / 2 pi" in header["anyprobe:frame"]


def test_mitsuba_rows_reach_the_poles(tmp_path):
    """Its bilinear rows at i / (rows - 1) hold our function at our pixel centres and at both poles."""
    import OpenEXR

    paths = export(two_phase(16), "mitsuba", tmp_path)
    file = next(path for path in paths if path.suffix == ".exr")
    with OpenEXR.File(str(file)) as opened:
        pixels = opened.channels()["RGB"].pixels
    assert pixels.shape == (33, 32, 3)
    rolled = OPENEXR.roll(two_phase(16))
    np.testing.assert_allclose(pixels[1:-1:2], rolled, atol=1e-6)
    np.testing.assert_allclose(pixels[[0, -1]], rolled[[0, -1]], atol=1e-6)


@pytest.mark.parametrize("target", [*LAYOUTS, "webxr"])
def test_dominant_light_lies_elsewhere_than_its_emitter(target, tmp_path):
    """The sidecar's direction in the target's axes reads the emitter's pixel in the target's map."""
    radiance = np.full((32, 64, 3), 0.1, np.float32)
    radiance[9:11, 40:42] = (50, 40, 30)
    name = next(p for p in export(radiance, target, tmp_path) if p.suffix == ".json" and "estimate" not in p.name)
    said = json.loads(name.read_text())
    d = np.array([said["primaryLightDirection"][axis] for axis in "xyz"])
    np.testing.assert_allclose(np.linalg.norm(d), 1, atol=1e-5)
    if target == "webxr":
        return
    axes, u_of, up = LAYOUTS[target]
    np.testing.assert_allclose(said["dominant_light"]["direction_in_target"], axes(*d), atol=1e-6)
    files = [p for p in tmp_path.iterdir() if p.suffix in (".hdr", ".exr") and "_ambient" not in p.name]
    emitter = read_as(target, read_radiance(files[0]), d[None])[0]
    np.testing.assert_allclose(emitter, (50, 40, 30), rtol=0.01)
    dark = read_radiance(next(p for p in tmp_path.iterdir() if "_ambient" in p.name and p.suffix != ".json"))
    np.testing.assert_allclose(read_as(target, dark, d[None])[0], 0.1, rtol=0.01)


def test_world_from_camera_turns_the_map_and_the_dominant_light(tmp_path):
    """A camera turned left by 90 degrees: what it had in front lies at the world's -X."""
    radiance = np.full((32, 64, 3), 0.1, np.float32)
    radiance[15:17, 31:33] = 50  # in front
    turn = world_from_camera(np.pi / 2, 0.0)
    np.testing.assert_allclose(turn, rotation_y(np.pi / 2), atol=1e-12)
    paths = export(radiance, "webxr", tmp_path, world_from_camera=turn)
    said = json.loads(next(p for p in paths if "estimate" not in p.name).read_text())
    d = said["primaryLightDirection"]
    np.testing.assert_allclose([d["x"], d["y"], d["z"]], [-1, 0, 0], atol=1e-3)
    np.testing.assert_allclose(said["world_from_camera"], turn, atol=1e-6)


def test_width_that_has_no_quarter():
    with refused("map", code="invalid-map"):
        THREE.roll(np.ones((9, 18, 3), np.float32))
    assert OPENEXR.roll(np.ones((9, 18, 3), np.float32)).shape == (9, 18, 3)
