"""Doubt is said: objects of one shade, light from below the horizon, a ground that cannot be where it is guessed."""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.places import place
from support.refused import refused

from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import inverse_response
from anyprobe.errors import InvalidMask
from anyprobe.estimate import refine
from anyprobe.estimate.doubts import all_around_doubts, grey_doubts, ground_doubts, light_doubts
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.ground import ground_by_posture, up_of
from anyprobe.estimate.photo import load_photo
from anyprobe.notices import give


def warned(picture, mask) -> str:
    return " ".join(load_photo(picture, mask=mask, fov_deg=60.0).warnings)


def test_mostly_clipped_and_nearly_black_objects_are_said(photo_rgba, photo_mask):
    rgb = photo_rgba[..., :3].astype(float)
    assert not warned(photo_rgba[..., :3], photo_mask)
    assert "of the object is clipped" in warned(np.clip(4 * rgb, 0, 255).astype(np.uint8), photo_mask)
    part = rgb.copy()
    part[:, : int(np.median(np.nonzero(photo_mask)[1]))] = 255  # half of the object
    assert "of the object is clipped; where its light comes from is uncertain" in warned(
        part.astype(np.uint8), photo_mask
    )
    assert "nearly black" in warned((0.05 * rgb).astype(np.uint8), photo_mask)


def test_a_photo_of_radiance_in_another_unit_is_said(photo_rgba, photo_mask, tmp_path):
    lit = np.maximum(inverse_response(photo_rgba[..., :3].astype(np.float32) / 300.0), 0.05)

    def written(radiance) -> str:
        OpenEXR.File({}, {"RGB": np.ascontiguousarray(radiance, np.float32)}).write(str(tmp_path / "photo.exr"))
        return str(tmp_path / "photo.exr")

    assert "its radiance" not in warned(written(lit), photo_mask)
    said = warned(written(400 * lit), photo_mask)
    assert "photo.exr: 100% of the photo is above 1, which is white; multiply its radiance by 0.0" in said
    assert "of the object is clipped" not in said, "once is enough"
    with refused(code="no-object", source="photo.exr", naming="100%", kind=InvalidMask):
        load_photo(written(np.full_like(lit, 300.0)))


def written_place(path, radiance):
    OpenEXR.File({}, {"RGB": np.ascontiguousarray(radiance, np.float32)}).write(str(path))
    return str(path)


class FindsNothing:
    name, warning, takes_prompts = "u2netp", "", False

    def cover(self, rgb, on=(), off=(), box=None):
        return np.zeros((32, 32), np.float32)


@pytest.mark.ci
def test_an_environment_map_given_as_the_photo_is_said(tmp_path, command):
    """By its shape, and only where nobody says what the object is: a photo may be an .exr twice as wide as high."""
    around = place(2)
    path = written_place(tmp_path / "field.exr", around)
    done = command("estimate", path, "-o", tmp_path / "out")
    said = done.err + done.out
    assert "field.exr: " in said
    assert "looks like an environment map" in said
    assert all(way in said for way in ("anyprobe export", "--light", "anyprobe match", "--box", "--click", "--mask"))
    with refused(code="no-object", source="far.exr", naming="environment map", kind=InvalidMask):
        load_photo(written_place(tmp_path / "far.exr", around), segmenter=FindsNothing())
    mask = np.zeros(around.shape[:2], np.uint8)
    mask[40:90, 100:150] = 255
    assert "environment-map" not in [one.code for one in load_photo(path, mask=mask).warnings]
    for radiance, is_said in ((around, True), (around[:, 1:], False), (None, False)):
        assert bool(all_around_doubts(radiance, "field.exr")) == is_said


def lamp_at(elevation_deg: float) -> np.ndarray:
    """[64, 128, 3]: a lamp before the object at that elevation over the camera's level, some light all around."""
    angle = np.radians(elevation_deg)
    towards = pixel_directions(64) @ [0.0, np.sin(angle), np.cos(angle)] > np.cos(np.radians(8))
    return np.where(towards[..., None], 60.0, 0.2) * np.ones(3, np.float32)


@pytest.mark.parametrize(("elevation_deg", "pitch_deg", "is_said"), [(-50, 0, True), (-8, 0, False), (40, 0, False)])
def test_a_dominant_light_from_below_the_horizon_is_said(elevation_deg, pitch_deg, is_said):
    assert bool(light_doubts(lamp_at(elevation_deg), None, pitch_deg, "p")) == is_said


def test_the_horizon_is_the_world_s():
    """In a camera that looks down, light from behind it lies lower in its frame than in the world."""
    level = up_of(0.0)
    assert level @ [0, 1, 0] == 1
    assert light_doubts(lamp_at(-30), None, 0.0, "p")
    assert not light_doubts(lamp_at(-30), None, 40.0, "p")  # 10 degrees high


@pytest.mark.ci
def test_doubts_reach_the_light_and_the_command_line(tmp_path, photo_rgba, photo_mask, command, monkeypatch):
    monkeypatch.setattr(refine, "light_doubts", lambda *_: ("from below",))
    light = Estimator()(photo_rgba[..., :3], mask=photo_mask)
    assert light.warnings == ("from below",)
    assert light.sidecar()["warnings"] == ["from below"]
    Image.fromarray(photo_rgba).save(tmp_path / "p.png")
    done = command("estimate", tmp_path / "p.png", "-o", tmp_path / "out")
    assert "from below" in done.err + done.out


def test_an_object_above_any_usual_horizon_is_said(photo_rgba, photo_mask):
    height, width = photo_mask.shape
    rgb = np.random.default_rng(1).integers(60, 160, (4 * height, width, 3)).astype(np.uint8)
    high = np.zeros((4 * height, width), np.uint8)
    high[:height] = photo_mask
    guessed, given = (load_photo(rgb, mask=high, fov_deg=60.0, pitch_deg=pitch).ground for pitch in (None, 30.0))
    assert [one.code for one in ground_doubts(guessed, "p")] == ["ground-guessed"]
    assert not ground_doubts(given, "p")
    found = ground_by_posture(guessed, np.array([20.0, 0.0, 3.0]))
    assert not ground_doubts(found, "p")
    unsure = ground_by_posture(guessed, np.array([20.0, 0.0, 20.0]))
    assert [(one.code, one.remedy) for one in ground_doubts(unsure, "p")] == [("pitch-unsure", give("pitch_deg"))]


def test_one_number_of_albedo_for_a_coloured_object_is_said(photo_rgba, photo_mask):
    grey = np.repeat(photo_rgba[..., :3].mean(axis=-1, keepdims=True), 3, axis=-1)
    red, warm = (np.clip(grey * tint, 0, 255).astype(np.uint8) for tint in ((1.2, 0.4, 0.4), (1.1, 1.0, 0.8)))

    def codes(picture, **given) -> set[str]:
        return {one.code for one in load_photo(picture, mask=photo_mask, fov_deg=60.0, **given).warnings}

    assert "albedo-grey" in codes(red, albedo=0.3)
    assert "albedo-grey" in codes(red, albedo=[0.3], material="plastic")
    for picture, given in ((red, {}), (red, {"albedo": (0.5, 0.1, 0.1)}), (warm, {"albedo": 0.3})):
        assert "albedo-grey" not in codes(picture, **given)
    assert not grey_doubts(np.array([[0.02, 0.0, 0.0]]), "")
    (said,) = grey_doubts(np.array([[0.8, 0.1, 0.1]]), "")
    assert said.endswith("pass albedo=R,G,B")
