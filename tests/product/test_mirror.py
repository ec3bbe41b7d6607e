"""A mirror of known shape is measured: what it shows is the map, and where it is clipped the light is."""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest
from support.scenes import sphere_photo

import anyprobe
from anyprobe.core.frames import dot, reflect, rotation_y
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.estimate.light_graph import Said
from anyprobe.estimate.material_hint import MEASURED_CONFIDENCE, is_mirror, measure, use_material
from anyprobe.estimate.result import MIRROR_ERROR_DEG
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.render.spheres import sphere_normals
from anyprobe.render.surface import pixel_rays
from anyprobe.scatter.materials import MATERIALS, Material

CHROME = MATERIALS["chrome"]
TAN_HALF = 0.1
TOWARDS = np.array([0.6, 0.5, -0.4]) / np.linalg.norm([0.6, 0.5, -0.4])


def smooth_map() -> np.ndarray:
    """[64, 128, 3]: soft waves between 0.1 and 0.7, each channel another way."""
    d = pixel_directions(64)
    return (0.4 + 0.3 * np.sin(3 * d + 1)).astype(np.float32)


def emitter() -> np.ndarray:
    """[64, 128, 1]: 30 where an emitter is that lies before the camera, to the upper right."""
    return 30.0 * (pixel_directions(64) @ TOWARDS > np.cos(0.1))[..., None]


def photo_of(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A chrome sphere under a map: crop [128, 128, 4] and normals [64, 64, 3]; Schlick's Fresnel."""
    normals, on = sphere_normals(128)
    n, wo = normals, pixel_rays(TAN_HALF, 128)[on]
    fresnel = CHROME.f0 + (1 - CHROME.f0) * (1 - dot(n, wo)) ** 5
    image = np.zeros((128, 128, 4), np.float32)
    image[on, :3] = response(fresnel * bilinear(radiance, direction_to_uv(reflect(wo, n)))).clip(max=1.0)
    image[on, 3] = 1.0
    small, on_small = sphere_normals(64)
    given = np.zeros((64, 64, 3), np.float32)
    given[on_small] = small
    return image, given


def test_what_a_mirror_shows_is_the_map():
    """From a map that knows nothing; all but what lies behind the sphere, from where nothing comes to the eye."""
    truth = smooth_map()
    found, _ = measure(np.full_like(truth, 0.2), *photo_of(truth), TAN_HALF, CHROME)
    seen = pixel_directions(64)[..., 2] > -0.7
    error = np.abs(found - truth)[seen]
    assert np.median(error) < 0.01
    assert np.percentile(error, 99) < 0.08
    behind = pixel_directions(64)[..., 2] < -0.98
    np.testing.assert_allclose(found[behind], 0.2, atol=0.1)  # coarse pixels reach a little over


def test_a_clipped_out_spot_gets_the_light_that_the_map_has():
    """The map has the emitter elsewhere: it is moved to where the mirror is clipped, with all its power."""
    truth = smooth_map() + emitter()
    wrong = smooth_map() + emitter()[:, ::-1]
    found, _ = measure(wrong.astype(np.float32), *photo_of(truth), TAN_HALF, CHROME)
    assert np.degrees(np.arccos(find_dominant_light(found).direction @ TOWARDS)) < 4.0
    areas = pixel_solid_angles(64)[..., None]
    power = [(np.maximum(one - 1, 0) * areas).sum() for one in (found, truth)]
    assert power[0] == pytest.approx(power[1], rel=0.15)


def test_a_emitter_that_no_mirror_shows_stays_only_where_none_could():
    """Nothing is clipped: an emitter that the map has in plain view is not there; behind the sphere it may be."""
    truth = smooth_map()
    behind = 30.0 * (pixel_directions(64)[..., 2:] < -0.985)
    image, normals = photo_of(truth)
    assert measure((truth + emitter()).astype(np.float32), image, normals, TAN_HALF, CHROME)[0].max() < 1.5
    found, _ = measure((truth + behind).astype(np.float32), image, normals, TAN_HALF, CHROME)
    assert find_dominant_light(found).direction[2] < -0.95


def test_only_where_normals_are_known_is_anything_measured():
    """The left half is told, the right half is the network's guess, however good: the map stays there as it was."""
    truth, flat = smooth_map(), np.full((64, 128, 3), 0.2, np.float32)
    image, normals = photo_of(truth)
    left = normals.copy()
    left[:, 32:] = 0
    said = Said(
        radiance=flat,
        crop=image,
        crop_frame=np.vstack([np.eye(3), [[TAN_HALF, 64, 64]]]),
        irradiance=image[..., :3],
        object_normals=left,
        confidence=np.full((64, 128), 0.3, np.float32),
    )
    answer = use_material(said, CHROME, has_normals=True, is_above_white=False)[0]
    found = answer.radiance
    d = pixel_directions(64)
    here, there = d[..., 0] < -0.5, d[..., 0] > 0.5
    assert np.median(np.abs(found - truth)[here & (d[..., 2] > -0.5)]) < 0.02
    np.testing.assert_allclose(found[there], 0.2, atol=0.02)
    np.testing.assert_allclose(np.median(answer.confidence[here & (d[..., 2] > -0.5)]), MEASURED_CONFIDENCE, atol=0.05)
    np.testing.assert_allclose(np.median(answer.confidence[there]), 0.3, atol=0.02)


def test_mirrors_are_smooth_metals():
    assert is_mirror(CHROME)
    assert not is_mirror(MATERIALS["plastic"])
    assert not is_mirror(Material(albedo=CHROME.albedo, f0=CHROME.f0, alpha=0.3))


def test_a_chrome_sphere_is_measured_only_if_its_shape_is_known():
    photo = sphere_photo()
    given = anyprobe.estimate(photo, normals="sphere", material="chrome", fov_deg=30.0)
    assert given.sidecar()["hints"]["measured"] is True
    assert "gain" not in given.sidecar()["hints"]
    assert "measured" not in anyprobe.estimate(photo, material="chrome").sidecar()["hints"]


def test_how_sure_a_direction_is_that_a_mirror_shows_unclipped(tmp_path):
    """To a pixel of the map, however the rest of the map is; what is clipped is the network's guess."""
    n, on = sphere_normals(128)
    photo = np.zeros((128, 128, 3), np.float32)
    light_at = np.array([0.6, 0.5, 0.4]) / np.linalg.norm([0.6, 0.5, 0.4])
    lit = smooth_map() + 30.0 * (pixel_directions(64) @ light_at > np.cos(0.1))[..., None]
    photo[on] = bilinear(lit.astype(np.float32), direction_to_uv(reflect(pixel_rays(0.1, 128)[on], n)))
    path = tmp_path / "probe.exr"
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGB": photo}).write(str(path))
    normals = np.zeros((128, 128, 3), np.float32)
    normals[on] = n
    given = {"mask": on, "normals": normals, "material": "chrome", "fov_deg": float(np.degrees(2 * np.arctan(0.1)))}
    light = anyprobe.estimate(path, **given)
    main = light.dominant_light()
    assert np.degrees(np.arccos(main.direction @ light_at)) < MIRROR_ERROR_DEG
    assert main.error_deg == MIRROR_ERROR_DEG
    assert light.sidecar()["dominant_light"]["error_deg"] == round(MIRROR_ERROR_DEG, 1)
    turned = light.rotate(rotation_y(1.0)).dominant_light()
    assert turned.error_deg == MIRROR_ERROR_DEG
    clipped = anyprobe.estimate(response(photo).clip(max=1.0), **given)
    assert clipped.dominant_light().error_deg > MIRROR_ERROR_DEG
