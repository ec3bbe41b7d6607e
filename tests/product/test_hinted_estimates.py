"""What is known of the object: its normals, its material; given to the API and the command line."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from support.scenes import CENTER, DIAMETER, HEIGHT, WIDTH, made_map, sphere_photo

import anyprobe
from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.core.sampling import hammersley
from anyprobe.errors import InputError
from anyprobe.estimate.material_hint import MAX_STOPS, fit_gain
from anyprobe.estimate.normals_hint import normals_from_outline, read_normals
from anyprobe.estimate.photo import load_photo
from anyprobe.render.integrate import shade, shading_pyramid
from anyprobe.render.shapes import sphere
from anyprobe.render.spheres import sphere_normals
from anyprobe.render.surface import Camera, pixel_rays, see
from anyprobe.scatter.materials import MATERIALS, Material

MATTE = MATERIALS["matte"]


def sphere_map() -> np.ndarray:
    """The normals [H, W, 3] of the sphere that sphere_photo draws, zero beside it."""
    normals, on = sphere_normals(DIAMETER)
    window = np.zeros((DIAMETER, DIAMETER, 3), np.float32)
    window[on] = normals
    result = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    left, top = CENTER[0] - DIAMETER // 2, CENTER[1] - DIAMETER // 2
    result[top : top + DIAMETER, left : left + DIAMETER] = window
    return result


# Normals


def test_a_normal_map_is_read_from_arrays_pictures_and_files(tmp_path):
    normals = sphere_map()
    on = np.abs(normals).sum(axis=-1) > 0
    shape = (HEIGHT, WIDTH)
    picture = to_bytes(normals / 2 + 0.5) * on[..., None]
    Image.fromarray(picture).save(tmp_path / "n.png")
    np.save(tmp_path / "n.npy", normals)
    np.save(tmp_path / "bytes.npy", picture)
    exact = [normals, 3.0 * normals, tmp_path / "n.npy"]
    pictures = [picture, tmp_path / "n.png", tmp_path / "bytes.npy"]
    for source, error in [(one, 1e-6) for one in exact] + [(one, 0.02) for one in pictures]:
        read = read_normals(source, shape)
        np.testing.assert_allclose(read, normals, atol=error)
        assert (read[~on] == 0).all()


@pytest.mark.parametrize("beside", ["black", "grey", "white", "facing", "transparent"])
@pytest.mark.parametrize("kind", [".png", ".jpg", ".webp"])
def test_a_normal_map_may_be_compressed_and_have_anything_beside_the_object(tmp_path, kind, beside):
    normals = sphere_map()
    on = np.abs(normals).sum(axis=-1) > 0
    colors = {"black": 0.0, "grey": 0.5, "white": 1.0, "facing": (0.5, 0.5, 1.0), "transparent": (1.0, 0.3, 0.9)}
    picture = Image.fromarray(to_bytes(np.where(on[..., None], normals / 2 + 0.5, colors[beside])))
    if beside == "transparent":
        if kind == ".jpg":
            pytest.skip("a JPEG has no transparency")
        picture.putalpha(Image.fromarray(to_bytes(on.astype(np.float32))))
    picture.save(tmp_path / f"n{kind}", quality=60)
    read = read_normals(tmp_path / f"n{kind}", (HEIGHT, WIDTH))
    middle = np.zeros_like(on)
    middle[CENTER[1] - 20 : CENTER[1] + 20, CENTER[0] - 20 : CENTER[0] + 20] = True
    assert (read[middle] * normals[middle]).sum(axis=-1).mean() > 0.99
    if beside in ("black", "white", "grey"):
        assert np.abs(read[~on]).sum(axis=-1).astype(bool).mean() < 0.1
    elif beside == "transparent":
        assert (read[~on] == 0).all()


def test_known_normals_change_the_light_and_are_noted():
    photo = sphere_photo()
    alone, given = anyprobe.estimate(photo), anyprobe.estimate(photo, normals=sphere_map())
    assert alone.sidecar()["hints"] == {"normals": False}
    assert given.sidecar()["hints"] == {"normals": True}
    assert np.abs(given.radiance - alone.radiance).mean() > 1e-3


# Spheres


def seen_sphere(position, fov_deg: float = 60.0, size: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Mask and normals [S, S, 3] of the unit sphere at the origin as the rasteriser sees it from a position."""
    tan_half = float(np.tan(np.radians(fov_deg / 2)))
    surface = see(
        sphere(128), Camera(world_from_camera=np.eye(3), position=np.array(position), tan_half=tan_half, size=size)
    )
    normals = np.zeros((size, size, 3), np.float32)
    normals[surface.mask] = surface.normals
    return surface.mask.astype(np.float32), normals


@pytest.mark.parametrize("position", [(0.0, 0.0, 8.0), (1.3, -0.8, 4.5), (-1.5, 1.5, 5.0)])
def test_a_spheres_outline_tells_its_normals(position):
    """Near the edge of a wide photo the outline is an ellipse; still they are the rasteriser's."""
    mask, expected = seen_sphere(position)
    found = normals_from_outline(mask, 60.0)
    both = (np.abs(found).sum(axis=-1) > 0) & (mask > 0)
    assert both.sum() > 0.97 * mask.sum()
    np.testing.assert_allclose(np.linalg.norm(found[both], axis=-1), 1.0, atol=1e-5)
    angle = np.degrees(np.arccos(np.clip((found * expected).sum(axis=-1)[both], -1, 1)))
    assert np.median(angle) < 1.0
    assert np.percentile(angle, 95) < 6.0  # the rim is steep: a tenth of a pixel is degrees there


def test_a_sphere_may_be_called_one():
    photo, expected = sphere_photo(), sphere_map()
    found = load_photo(photo, normals="sphere", fov_deg=5.0).normals
    both = (np.abs(found).sum(axis=-1) > 0) & (np.abs(expected).sum(axis=-1) > 0)
    angle = np.degrees(np.arccos(np.clip((found * expected).sum(axis=-1)[both], -1, 1)))
    assert np.median(angle) < 1.5
    named = anyprobe.estimate(photo, normals="sphere", fov_deg=5.0)
    assert named.sidecar()["hints"] == {"normals": True}
    assert np.abs(named.radiance - anyprobe.estimate(photo, fov_deg=5.0).radiance).mean() > 1e-3


# Material


def photo_of(radiance: np.ndarray, material: Material, tan_half: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """A sphere under a map: crop [128, 128, 4] and normals [64, 64, 3]."""
    normals, on = sphere_normals(64)
    picture = np.zeros((64, 64, 3), np.float32)
    picture[on] = normals
    seen = shade(
        shading_pyramid(radiance, material.alpha),
        picture[on],
        pixel_rays(tan_half, 64)[on].astype(np.float32),
        np.float32(material.alpha),
        hammersley(256),
        wide=shading_pyramid(radiance),
    ).radiance(material)
    image = np.zeros((64, 64, 4), np.float32)
    image[on, :3] = response(seen).clip(max=1.0)
    image[on, 3] = 1.0
    return image.repeat(2, axis=0).repeat(2, axis=1), picture


@pytest.mark.ci
@pytest.mark.parametrize("name", ["matte", "plastic", "chrome"])
def test_the_gain_that_was_taken_away_is_found(name):
    """A map too dark by a gain a channel: the known material tells the gain."""
    radiance, material = 0.5 * made_map(), MATERIALS[name]
    image, normals = photo_of(radiance, material)
    gain = np.array([0.5, 1.3, 2.2], np.float32)
    found = fit_gain(radiance / gain, image, normals, 0.1, material)
    np.testing.assert_allclose(found, gain, rtol=0.03)


def test_a_clipped_out_or_tiny_object_moves_nothing_far():
    image, normals = photo_of(0.5 * made_map(), MATTE)
    white = np.concatenate([np.ones_like(image[..., :3]), image[..., 3:]], axis=-1)
    assert fit_gain(made_map(), white, normals, 0.1, MATTE).max() <= 2**MAX_STOPS
    none = fit_gain(made_map(), np.zeros_like(image), normals, 0.1, MATTE)
    np.testing.assert_array_equal(none, np.ones(3))


def test_floats_of_a_picture_are_no_vectors():
    """(n + 1) / 2 taken for n is a light 40 degrees off."""
    n = np.zeros((8, 8, 3), np.float32)
    n[..., 0], n[..., 2] = 0.6, 0.8
    assert np.allclose(read_normals(n, (8, 8)), n)
    with pytest.raises(InputError, match=r"^normals: expected unit vectors in floats, got .* pass 2 \* values - 1$"):
        read_normals((n + 1) / 2, (8, 8))
