"""Lights on disk: opened again, and which way round they lie when they were turned before."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.scenes import made_map, sphere_photo
from support.two_phase import two_phase

import anyprobe
from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.sidecar import Origin
from anyprobe.export.exported_light import check_front
from anyprobe.files.objects import OBJECTS
from anyprobe.maps.radiance import read_radiance, write_hdr
from anyprobe.notices import Notice, give

TURN = rotation_y(0.7) @ rotation_x(-0.5)
TURNS = {"left": rotation_y(np.pi / 2), "askew": TURN}


@pytest.fixture
def light():
    return anyprobe.Light(
        radiance=two_phase(32),
        confidence=np.full((32, 64), 0.3, np.float32),
        well_exposed_fraction=0.75,
        warnings=(
            "too dark",
            Notice("too bright", code="bright", source="vase.png", remedy=give("mask", fov_deg="40")),
        ),
        camera_from_crop=rotation_x(0.2),
        origin=Origin(photo="vase.png", model="m-0", exposure=0.02, mask={"source": "alpha"}, more={"by": "another"}),
    )


# Light.load


@pytest.mark.parametrize("kind", ["exr", "hdr"])
@pytest.mark.parametrize("turn", [np.eye(3), TURN])
def test_a_saved_light_is_opened_again(light, tmp_path, kind, turn):
    light = light.rotate(turn)
    path = light.save(tmp_path / f"vase.{kind}")
    light.save(tmp_path / "vase.json")
    again = anyprobe.Light.load(path)
    np.testing.assert_array_equal(again.radiance, read_radiance(path))
    np.testing.assert_allclose(again.radiance, light.radiance, rtol=0.01, atol=0.01 * light.radiance.max())
    np.testing.assert_allclose(again.map_from_camera, turn, atol=1e-5)
    np.testing.assert_allclose(again.camera_from_crop, light.camera_from_crop, atol=1e-5)
    assert (again.well_exposed_fraction, again.warnings, again.info) == (
        light.well_exposed_fraction,
        light.warnings,
        light.info,
    )
    assert [one.as_json() for one in again.warnings] == [one.as_json() for one in light.warnings]
    assert again.confidence is None
    alike = {"sh9", "dominant_light", "sources", "confidence", "map_from_camera"}
    given, before = again.sidecar(), light.sidecar()
    assert {key: given[key] for key in given.keys() - alike} == {key: before[key] for key in before.keys() - alike}


def test_a_saved_light_states_the_error_of_its_estimate(light, tmp_path):
    light = replace(light, said_error_deg=80.0)
    light.save(tmp_path / "vase.json")
    again = anyprobe.Light.load(light.save(tmp_path / "vase.exr"))
    assert again.dominant_light().error_deg == pytest.approx(light.dominant_light().error_deg, abs=0.06)
    assert light.dominant_light().error_deg == 80.0 != replace(light, said_error_deg=None).dominant_light().error_deg


def test_a_map_without_its_sidecar_is_a_light(light, tmp_path):
    again = anyprobe.Light.load(str(light.rotate(TURN).save(tmp_path / "vase.hdr")))
    assert (again.well_exposed_fraction, again.warnings, again.info) == (1.0, (), {"model": "m-0"})
    np.testing.assert_allclose(again.map_from_camera, TURN, atol=1e-5)
    write_hdr(tmp_path / "any.hdr", two_phase(16))
    (tmp_path / "any.json").write_text(json.dumps({"well_exposed_fraction": "something else's", "scale": 2}))
    bare = anyprobe.Light.load(tmp_path / "any.hdr")
    assert (bare.info, bare.well_exposed_fraction) == ({}, 1.0)
    np.testing.assert_array_equal(bare.map_from_camera, np.eye(3))


@pytest.mark.parametrize("version", [None, 3, 5])
def test_a_sidecar_of_another_version_is_refused(light, tmp_path, version):
    path = light.save(tmp_path / "vase.exr")
    (tmp_path / "vase.json").write_text(json.dumps(light.sidecar() | {"version": version}))
    with pytest.raises(anyprobe.InputError) as error:
        anyprobe.Light.load(path)
    assert (error.value.code, error.value.notice.source) == ("invalid-option", str(path))


@pytest.mark.parametrize("name", ["vase.json", "vase.png", "none.exr", "vase_blender.exr", "vase_three.hdr"])
def test_what_is_no_saved_light_is_refused(light, tmp_path, name):
    light.save(tmp_path / "vase.json")
    light.save(tmp_path / "vase.png")
    for target in ("blender", "three"):
        light.export(target, tmp_path, "vase")
    with pytest.raises(anyprobe.InputError, match=name) as error:
        anyprobe.Light.load(tmp_path / name)
    assert "\n" not in str(error.value)


# Turned


@pytest.mark.ci
@pytest.mark.parametrize(("turn", "kind"), [("left", "exr"), ("askew", "hdr")])
@pytest.mark.usefixtures("rough_shadows", "networks_opened_once")
def test_a_turned_light_relights_as_it_did(command, work, kind, turn):
    """It was lit from the wrong side before, without a word."""
    Image.fromarray(sphere_photo()).save(work / "sphere.png")
    light = anyprobe.Light(radiance=made_map())
    pictures = {}
    for name, one in (("straight", light), ("turned", light.rotate(TURNS[turn]))):
        one.save(work / f"{name}.{kind}")
        call = ("relight", "sphere.png", "--light", f"{name}.{kind}", "--insert-material", "matte")
        done = command(*call, "-o", f"{name}.png", "-q")
        assert done.status == 0, done.err
        with Image.open(work / f"{name}.png") as picture:
            pictures[name] = np.asarray(picture, np.float32)[..., :3]
    changed = np.abs(pictures["straight"] - sphere_photo()[..., :3]).max(axis=-1) > 8
    assert changed.mean() > 0.04
    assert np.abs(pictures["turned"] - pictures["straight"])[changed].mean() < 4


def test_a_hdr_says_itself_that_it_lies_otherwise(tmp_path):
    """Without the .json beside it."""
    frame = "right-handed, +X right, +Y up, -Z in front; u = 0.5 + atan2(z, x) / 2 pi, v = acos(y) / pi"
    write_hdr(tmp_path / "a.hdr", two_phase(16), attributes={"frame": frame})
    with pytest.raises(anyprobe.InputError, match=r"front in its centre, got one with u = 0\.5 \+ atan2\(z, x\)"):
        check_front(tmp_path / "a.hdr")
    check_front(anyprobe.Light(radiance=two_phase(16)).save(tmp_path / "b.hdr"))
    anyprobe.Light(radiance=two_phase(16)).export("three", tmp_path, "c")
    (tmp_path / "c_three.json").unlink()
    for name in ("c_three.hdr", "c_three_ambient.hdr"):
        with pytest.raises(anyprobe.InputError, match="front in its centre"):
            check_front(tmp_path / name)


# Light.render


@pytest.mark.parametrize("name", OBJECTS)
def test_render_knows_the_objects_of_relight(name):
    picture = anyprobe.Light(radiance=made_map()).render(name, "gold", size=16)
    assert picture[..., 3].max() == 1


def test_how_soft_a_light_is_comes_back_and_its_brightest_side_is_level(tmp_path):
    """However the map was turned since."""
    d = pixel_directions(64)
    light = anyprobe.Light(radiance=np.where(d[..., 1:2] > 0, 2.0, 0.2) * np.ones(3, np.float32), soft=0.9)
    assert light.is_soft
    assert light.brightest_side() == "above"
    assert light.rotate(rotation_x(1.0)).brightest_side() == "above"
    assert not anyprobe.Light(radiance=light.radiance).is_soft
    light.save(tmp_path / "soft.exr")
    light.save(tmp_path / "soft.json")
    assert anyprobe.Light.load(tmp_path / "soft.exr").soft == 0.9
