"""Masks that come with the photo or beside it: alpha, mattes and depth of renderers, folders of files."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.refused import refused

from anyprobe.cli.photo_files import list_photos
from anyprobe.errors import InvalidMask
from anyprobe.masks import find
from anyprobe.masks.sources import mask_from_alpha, mask_from_file
from anyprobe.pictures.images import read_image

HEIGHT, WIDTH = 48, 64


@pytest.fixture
def square() -> np.ndarray:
    """[H, W] float32, 1 in a square."""
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    mask[10:40, 16:48] = 1.0
    return mask


@pytest.fixture
def network(monkeypatch, square):
    """A network that finds the square in every photo."""

    class Drawn:
        name, warning, takes_prompts = "u2netp", "", False

        def cover(self, rgb, on=(), off=(), box=None):
            return square if rgb.shape[:2] == square.shape else np.ones_like(square)

    monkeypatch.setattr(find, "shared_network", Drawn)


def write_exr(path: Path, channels: dict[str, np.ndarray], **header) -> Path:
    stored = {key: np.ascontiguousarray(value, np.float32) for key, value in channels.items()}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION} | header, stored).write(str(path))
    return path


def almost_opaque(kind: str) -> np.ndarray:
    """[H, W] float32: alpha that cuts nothing away."""
    alpha = np.full((HEIGHT, WIDTH), {"0": 0.0, "254": 254 / 255}.get(kind, 1.0), np.float32)
    if kind == "one pixel":
        alpha[3, 4] = 0.9995
    if kind == "soft":
        alpha[:20] = 0.51
    return alpha


# Alpha


@pytest.mark.parametrize("kind", ["one pixel", "254", "soft", "0"])
def test_alpha_that_cuts_nothing_away_leaves_the_photo_to_the_network(tmp_path, kind, network, square):
    rgb = np.linspace(0.4, 0.6, HEIGHT * WIDTH * 3, dtype=np.float32).reshape(HEIGHT, WIDTH, 3)
    alpha = almost_opaque(kind)
    photos = [read_image(write_exr(tmp_path / "photo.exr", {"RGBA": np.dstack([rgb, alpha])}))]
    if kind != "one pixel":  # 8 bits do not hold 0.9995
        photos.append(read_image(Image.fromarray(np.uint8(np.dstack([rgb, alpha]) * 255 + 0.5))))
    for photo in photos:
        assert photo.alpha is not None
        found = find.find_mask(photo)
        assert found.source == "network"
        assert (found.mask[square > 0] > 0.5).mean() > 0.95


def test_alpha_that_cuts_the_object_out_is_its_mask_as_it_is(square):
    for alpha in (square, np.maximum(square, 0.3), np.minimum(square, 0.9)):
        rgba = np.dstack([np.full((HEIGHT, WIDTH, 3), 0.5, np.float32), alpha])
        found = find.find_mask(read_image(rgba))
        assert found.source == "alpha"
        np.testing.assert_array_equal(found.mask, alpha)
    assert mask_from_alpha(None) is None
    with refused("mask", code="no-object", naming="0.40", kind=InvalidMask):
        mask_from_alpha(square * 0.4)


@pytest.mark.parametrize("kind", ["one pixel", "254", "soft"])
def test_a_masks_alpha_that_cuts_nothing_away_leaves_its_brightness(square, kind):
    rgba = np.dstack([square, square, square, almost_opaque(kind)])
    np.testing.assert_array_equal(mask_from_file(rgba, square.shape), square)


# Mattes of renderers


def test_an_exr_mattes_alpha_counts_where_it_cuts_something_away(tmp_path, square):
    path = write_exr(tmp_path / "cut.exr", {"RGBA": np.dstack([square * 0.2] * 3 + [square * 0.8])})
    np.testing.assert_allclose(mask_from_file(path, square.shape), square * 0.8, atol=1e-6)


# Folders


def make(folder: str, *names: str) -> Path:
    Path(folder).mkdir()
    for name in names:
        (Path(folder) / name).touch()
    return Path(folder)


def test_hidden_files_of_a_folder_are_no_photos(work):
    photos = make("photos", "IMG_1.jpg", "._IMG_1.jpg", ".thumbnail.png", "IMG_2.jpg")
    assert [path.name for path in list_photos([photos])] == ["IMG_1.jpg", "IMG_2.jpg"]
    hidden = photos / ".thumbnail.png"
    assert list_photos([hidden]) == [hidden]  # named, it is meant
    for name in ("IMG_1.jpg", "IMG_2.jpg"):
        os.remove(photos / name)
    with refused(source="photos"):
        list_photos([photos])


def test_environment_maps_and_what_was_drawn_beside_a_photo_are_no_photos(work):
    photos = make(
        "photos", "vase.jpg", "vase_relit.png", "vase_overlay.png", "vase.jpg.png", "old_relit.png", "cut.exr"
    )
    even = np.ones((16, 32), np.float32)
    room = write_exr(photos / "room.exr", {"Y": even})
    write_exr(photos / "shot.exr", {"Y": even[:, :24]})
    assert [path.name for path in list_photos([photos])] == ["cut.exr", "old_relit.png", "shot.exr", "vase.jpg"]
    for name in ("vase.exr", "vase.json", "vase.png"):  # a light, and its preview
        (photos / name).write_bytes(room.read_bytes())
    assert [path.name for path in list_photos([photos])] == ["cut.exr", "old_relit.png", "shot.exr", "vase.jpg"]
    assert list_photos([room, photos / "vase_relit.png"]) == [room, photos / "vase_relit.png"]  # named, they are meant
