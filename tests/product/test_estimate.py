"""The front door: anyprobe.estimate, Estimator and Light."""

from __future__ import annotations

import json
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from support.refused import refused
from support.scenes import sphere_photo

import anyprobe
from anyprobe.core.frames import rotation_x, rotation_y, rotation_z
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import inverse_response, response
from anyprobe.estimate.refine import lens_of
from anyprobe.estimate.runtime import bundled_models
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.light.environment import integral, reduced, rotate
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.maps.radiance import map_attributes, read_radiance

FOV_DEG = 70.0
HEIGHT, WIDTH, DIAMETER = 192, 256, 80
FOCAL_PX = WIDTH / 2 / np.tan(np.radians(FOV_DEG / 2))

EXAMPLES = Path(__file__).parents[2] / "examples"


def photo_at(x: int, y: int) -> np.ndarray:
    return sphere_photo((x, y), DIAMETER, HEIGHT, WIDTH)


def emitter_map(direction, level: float = 50.0) -> np.ndarray:
    """[64, 128, 3]: an emitter 12 degrees across in a dim room."""
    direction = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    inside = pixel_directions(64) @ direction > np.cos(np.radians(6))
    return np.where(inside, level, 0.1)[..., None].repeat(3, axis=-1).astype(np.float32)


# One photo in, a light out


def test_light_has_the_promised_shape(photo_path):
    light = anyprobe.estimate(str(photo_path))
    assert isinstance(light, anyprobe.Light)
    height = light.radiance.shape[0]
    assert light.radiance.shape == (height, 2 * height, 3)
    assert light.radiance.dtype == np.float32
    assert np.isfinite(light.radiance).all()
    assert light.radiance.min() >= 0
    assert light.sh9().shape == (9, 3)
    main = light.dominant_light()
    assert np.linalg.norm(main.direction) == pytest.approx(1, abs=1e-5)
    assert main.color.shape == main.irradiance.shape == (3,)
    assert light.confidence.shape == (height, 2 * height)
    assert 0 <= light.confidence.min() <= light.confidence.max() <= 1
    assert 0 <= light.well_exposed_fraction <= 1
    assert light.warnings == ()


def test_mask_counts_as_alpha_does(photo_rgba, photo_mask, mask_path, estimator):
    expected = estimator(photo_rgba).radiance
    for mask in (photo_mask, mask_path, Image.fromarray(photo_mask), photo_mask > 0):
        found = estimator(np.ascontiguousarray(photo_rgba[..., :3]), mask=mask, surroundings="none").radiance
        np.testing.assert_array_equal(found, expected)


def test_background_does_not_matter(photo_rgba, estimator):
    other = photo_rgba.copy()
    other[other[..., 3] == 0, :3] = 255
    np.testing.assert_array_equal(estimator(other).radiance, estimator(photo_rgba).radiance)


def test_object_does_matter(photo_rgba, estimator):
    """The map comes from the photo: another object's shading gives another map."""
    dim = photo_rgba.copy()
    dim[..., :3] //= 3
    red = photo_rgba.copy()
    red[..., 1:3] = 0
    maps = [estimator(photo).radiance for photo in (photo_rgba, dim, red)]
    assert np.abs(maps[1] - maps[0]).max() > 1e-3
    assert np.abs(maps[2] - maps[0]).max() > 1e-3


def test_threads_share_an_estimator(estimator):
    photos = []
    for channel in range(3):  # three colours, in three places
        photo = photo_at(60 + 20 * channel, 60 + 10 * channel)
        photo[..., channel] //= 2
        photos.append(photo)
    expected = [estimator(photo).radiance for photo in photos]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda photo: estimator(photo).radiance, photos * 2))
    for one, other in zip(found, expected * 2, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_model_that_does_not_say_how_sure_it_is_has_no_confidence(photo_path):
    light = anyprobe.estimate(str(photo_path), model="paper")
    assert light.confidence is None
    assert light.sidecar()["confidence"] is None


@pytest.mark.ci
@pytest.mark.parametrize("ev", [0, 1, 2, 3])
def test_confidence_claims_no_more_than_is_right_however_much_of_the_object_is_clipped(estimator, ev):
    """At 2 EV more, two thirds of the example's pixels are clipped, at 3 EV all."""
    picture = np.asarray(Image.open(EXAMPLES / "vase.png"), np.float32) / 255
    exposed = response(inverse_response(picture[..., :3]) * 2.0**ev).clip(0, 1)
    light = estimator(exposed.astype(np.float32), mask=picture[..., 3])
    truth = reduced(read_radiance(EXAMPLES / "vase_truth.exr"), 64) * 2.0**ev
    off = np.abs(response(light.radiance).clip(0, 1) - response(truth).clip(0, 1)).mean(axis=-1)
    claimed, right = (integral(one[..., None])[0] / (4 * np.pi) for one in (light.confidence, np.float32(off < 0.1)))
    assert claimed < right + 0.03


def test_errors_are_the_callers_value_errors(estimator):
    with pytest.raises(ValueError, match="mask=") as caught:
        estimator(np.full((96, 128, 3), 128, np.uint8))
    assert isinstance(caught.value, anyprobe.AnyprobeError)
    with refused("model", code="invalid-model"):
        anyprobe.Estimator("no such model")


# An object away from the middle

OFFSETS = {  # pixels to the right and up, and the rotation that carries -Z there
    "right": (83, 0),
    "up": (0, 51),
    "lower left": (-83, -51),
}


def turned(kind: str) -> np.ndarray:
    """The pinhole camera's turn towards an offset object, from angles and not by the product's formula."""
    right, up = OFFSETS[kind]
    if up == 0:
        return rotation_y(-np.arctan(right / FOCAL_PX))  # to the right: -Z towards +X
    if right == 0:
        return rotation_x(np.arctan(up / FOCAL_PX))  # up: -Z towards +Y
    along = np.arctan2(up, right)
    return rotation_z(along) @ rotation_y(-np.arctan(np.hypot(right, up) / FOCAL_PX)) @ rotation_z(-along)


@pytest.fixture(scope="module", params=bundled_models())
def named(request):
    """Every model; its maps may differ, as it is told that the same pixels take in less off the axis, and `lift` where
    in the photo the object is."""
    return anyprobe.Estimator(request.param)


@pytest.fixture(scope="module")
def central(named):
    return named(photo_at(WIDTH // 2, HEIGHT // 2), fov_deg=FOV_DEG)


@pytest.mark.parametrize("kind", OFFSETS)
def test_object_in_the_corner_gives_the_same_map_turned(named, central, kind):
    right, up = OFFSETS[kind]
    light = named(photo_at(WIDTH // 2 + right, HEIGHT // 2 - up), fov_deg=FOV_DEG)
    np.testing.assert_allclose(light.stages["photo"], central.stages["photo"], atol=1e-5)
    np.testing.assert_allclose(light.camera_from_crop, turned(kind), atol=1e-9)
    expected = rotate(central.radiance, turned(kind))
    # as displayed: an emitter's edge, many times white, is another number wherever it is read between pixels
    found, expected, wrong = (
        response(radiance) for radiance in (light.radiance, expected, rotate(central.radiance, turned(kind).T))
    )
    most, times, degrees = (0.1 / 6, 5, 1.0) if named.settings.model == "paper" else (0.05, 1.5, 10.0)
    assert np.abs(found - expected).mean() < most
    assert np.abs(found - wrong).mean() > times * np.abs(found - expected).mean()
    emitter, seen = (find_dominant_light(radiance).direction for radiance in (light.radiance, central.radiance))
    assert np.degrees(np.arccos(np.clip(emitter @ turned(kind) @ seen, -1, 1))) < degrees


# Light: rotate, save


def test_a_turned_light_says_how(tmp_path):
    """Back in the camera's frame it says nothing of it again."""
    turn = rotation_y(0.7) @ rotation_x(-0.5)
    light = anyprobe.Light(radiance=emitter_map((0.3, 0.4, -0.8)))
    turned = light.rotate(rotation_x(-0.5)).rotate(rotation_y(0.7))
    np.testing.assert_allclose(turned.sidecar()["map_from_camera"], turn, atol=1e-6)
    assert "looks along -Z" in light.sidecar()["frame"] == turned.rotate(turn.T).sidecar()["frame"]
    assert "map_from_camera" not in turned.rotate(turn.T).sidecar()
    assert "looks along" not in turned.sidecar()["frame"]
    header = map_attributes(turned.save(tmp_path / "turned.exr"))
    assert header["frame"] == turned.sidecar()["frame"]
    np.testing.assert_allclose(json.loads(header["map_from_camera"]), turn, atol=1e-6)


def test_a_light_stays_what_it_is():
    mine = emitter_map((0.3, 0.4, -0.8))
    sure = np.full(mine.shape[:2], 0.5, np.float32)
    light = anyprobe.Light(radiance=mine, confidence=sure)
    mine[:], sure[:] = -5, -5
    assert light.radiance.min() >= 0
    assert light.confidence.min() == 0.5
    with pytest.raises(ValueError, match="read-only"):
        light.radiance[0] = 1
    assert light in [anyprobe.Light(radiance=light.radiance), light]
    assert len({light, light}) == 1


def test_emitter_beyond_half_float_is_kept(tmp_path):
    light = anyprobe.Light(radiance=emitter_map((0, 1, -1), level=2e5))
    np.testing.assert_array_equal(read_radiance(light.save(tmp_path / "sun.exr")), light.radiance)


def test_light_in_front_is_saved_in_the_centre(tmp_path):
    """Readers take the middle of the picture for the front, its top for up and its right for +X."""
    for direction, row, column in (((0, 0, -1), 31.5, 63.5), ((1, 0, 0), 31.5, 95.5), ((0, 1, -1), 15.5, 63.5)):
        for suffix in ("exr", "hdr"):
            path = anyprobe.Light(radiance=emitter_map(direction)).save(tmp_path / f"light.{suffix}")
            rows, columns = np.nonzero(read_radiance(path)[..., 0] > 1)
            assert (rows.mean(), columns.mean()) == pytest.approx((row, column), abs=0.6)


def test_sidecar_tells_all(tmp_path, estimator, photo_path):
    light = estimator(photo_path, fov_deg=50)
    text = light.save(tmp_path / "light.json").read_text(encoding="utf-8")
    sidecar = json.loads(text, parse_constant=pytest.fail)  # NaN is no JSON
    for word in ("right-handed", "+X right", "+Y up", "looks along -Z"):
        assert word in sidecar["frame"]
    assert "exposure units" in sidecar["scale"]
    assert sidecar["exposure_ev"] == 0
    np.testing.assert_allclose(sidecar["sh9"], light.sh9(), atol=1e-6)
    main = light.dominant_light()
    for key in ("direction", "color", "irradiance"):
        np.testing.assert_allclose(sidecar["dominant_light"][key], getattr(main, key), atol=1e-6)
    assert set(sidecar["seconds"]) == {"load", "networks"}
    assert all(0 <= seconds < 60 for seconds in sidecar["seconds"].values())
    assert sidecar["model"] == estimator.model_id
    assert sidecar["model"].startswith(f"{DEFAULT_MODEL}-")
    assert sidecar["size"] == [light.radiance.shape[1], light.radiance.shape[0]]
    assert (sidecar["long_fov_deg"], sidecar["fov_source"]) == (50, "given")
    areas = pixel_solid_angles(light.radiance.shape[0])
    mean = float((light.confidence * areas).sum() / (areas.sum() * light.radiance.shape[1]))
    assert sidecar["confidence"] == pytest.approx(mean, abs=1e-4)
    assert sidecar["well_exposed_fraction"] == pytest.approx(light.well_exposed_fraction, abs=1e-4)
    assert sidecar["warnings"] == []
    assert sidecar["photo"] == "sphere.png"
    np.testing.assert_allclose(sidecar["camera_from_crop"], light.camera_from_crop, atol=1e-6)


@pytest.mark.ci
def test_an_estimator_can_be_sent_to_another_process(estimator, photo_rgba):
    again = pickle.loads(pickle.dumps(estimator))
    np.testing.assert_array_equal(again(photo_rgba).radiance, estimator(photo_rgba).radiance)


def test_the_lens_is_the_narrow_end_of_the_networks_where_nothing_else_says_it():
    said = SimpleNamespace(field_of_view=np.array([50.0, 10.0]))
    photo = anyprobe.load_photo(photo_at(128, 96))
    assert lens_of(photo, said) == (40.0, "estimated")
    assert lens_of(photo, SimpleNamespace(field_of_view=None)) == (photo.long_fov_deg, "default")
    assert lens_of(anyprobe.load_photo(photo_at(128, 96), fov_deg=70.0), said) == (70.0, "given")


def test_a_cut_out_says_its_lens_too():
    light = anyprobe.estimate(photo_at(128, 96))
    assert light.ground is None
    assert light.origin.fov_source == "estimated"
    assert 10 < light.origin.long_fov_deg < 70
