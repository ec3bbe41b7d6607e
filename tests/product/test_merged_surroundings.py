"""Surroundings of several photos: gathered in the world, known to each of them, and kept in their one light."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.room_photos import FOV_DEG, room_photo, smooth_map
from support.transforms import transforms

from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.response import response
from anyprobe.estimate.multiview import DIFFER, lay_over
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.estimate.surroundings import GivenPanorama
from anyprobe.light.environment import rotate

POSES = [rotation_x(0.1), rotation_y(1.6) @ rotation_x(0.1), rotation_y(-1.5), rotation_y(0.4)]


def take(pose: np.ndarray, light: float = 1.0, surroundings: str | None = "photo") -> Photo:
    """A photo of the disc in the room, by a camera that is turned so; its exposure is so many times the rest."""
    photo, mask = room_photo(smooth_map() * light, world_from_camera=pose)
    photo[mask > 0] = 110  # grey, so that the networks are sure of something
    return load_photo(photo, mask=mask, fov_deg=FOV_DEG, surroundings=surroundings)


def patch(value: float, columns: slice) -> np.ndarray:
    """A panorama of one radiance between some columns."""
    shown = np.zeros((64, 128, 4), np.float32)
    shown[:, columns] = [value, value, value, 1.0]
    return shown


# Panoramas


def test_the_newer_counts_where_it_shows_something():
    newer = patch(0.3, slice(0, 60))
    newer[:10, 55:, :3] *= 1.2
    found = lay_over(newer, patch(0.33, slice(50, 100)))
    np.testing.assert_allclose(found[:, :60], newer[:, :60])
    np.testing.assert_array_equal(found[..., 3], patch(1, slice(0, 100))[..., 3])
    # both show columns 50 to 60, where the newer has 1 / 1.1 of the light: the older's exposure was longer
    np.testing.assert_allclose(found[:, 60:100, :3], 0.3, rtol=1e-6)
    apart = lay_over(patch(0.3, slice(0, 50)), patch(0.33, slice(50, 100)))
    np.testing.assert_allclose(apart[:, 50:100, :3], 0.33)


def test_the_older_is_forgotten_where_the_same_place_looks_otherwise():
    """Another exposure does not make it so, another pattern does."""
    older = patch(0.4, slice(0, 100))
    newer = patch(0.4, slice(0, 40))
    newer[:, :20, :3] *= 0.1  # its left half went dark
    assert np.abs(response(newer) - response(older))[:, :40, :3].mean() > DIFFER
    np.testing.assert_array_equal(lay_over(newer, older), newer)
    darker = patch(0.1, slice(0, 40))
    np.testing.assert_allclose(lay_over(darker, older)[:, 40:100, :3], 0.1, rtol=1e-6)


# Lights


@pytest.mark.parametrize("first", [0, 1])
def test_the_panorama_of_several_photos_shows_the_first(estimator, first):
    poses = [POSES[first], POSES[1 - first]]
    picture = estimator.multiview([take(pose) for pose in poses], poses).panorama(64, frame="camera")
    seen = picture.origin[..., 0] > 0.5  # the middle of it: it passes into a blur towards its border
    assert seen.mean() > 0.002
    truth = rotate(smooth_map(), poses[0].T)
    assert np.abs(response(picture.radiance) - response(truth))[seen].mean() < 0.02


def test_a_panorama_from_a_file_is_of_the_first_camera(estimator):
    first = rotate(smooth_map(), POSES[0].T)
    panorama = np.concatenate([response(first), np.ones((64, 128, 1), np.float32)], axis=-1)
    photos = [replace(take(pose), surroundings=GivenPanorama(values=panorama)) for pose in POSES[:3]]
    light = estimator.multiview(photos, POSES[:3])
    assert np.abs(response(light.radiance) - response(first)).mean() < 0.01


@pytest.mark.ci
def test_the_command_gathers_what_photos_show(command, tmp_path):
    names = []
    for k, pose in enumerate(POSES):
        photo, mask = room_photo(smooth_map(), world_from_camera=pose)
        Image.fromarray(np.dstack([photo, mask])).save(tmp_path / f"{k}.png")
        names.append(tmp_path / f"{k}.png")
    (tmp_path / "poses.json").write_text(transforms(POSES))
    order = ("estimate", *names, "--poses", tmp_path / "poses.json", "--surroundings", "photo", "--fov", FOV_DEG)
    done = command(*order, "-o", tmp_path / "light", "--json", "-q")
    assert done.status == 0, done.err
    assert json.loads(done.out)["hints"]["surroundings"] > 0.1
