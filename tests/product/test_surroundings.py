"""What is known of the map itself: read, put into the crop's frame, shown to the network and kept."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image
from support.room_photos import FOV_DEG, room_photo, smooth_map

import anyprobe
from anyprobe.core.color import to_bytes
from anyprobe.core.frames import normalize, turn_towards
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.infer.photo import crop_object, load_photo
from anyprobe.infer.runtime import Outputs
from anyprobe.infer.surroundings import (
    SEEN,
    TINT,
    TINT_FLOOR,
    read_surroundings,
    see_around,
    turned,
    use_surroundings,
)
from anyprobe.light.environment import rotate


def test_a_photo_shows_the_map_beside_its_object_in_the_crops_frame():
    """Wherever the object is in it: turned back to the camera, every place shows what lies in its direction."""
    radiance = smooth_map()
    photo, mask = room_photo(radiance)
    crop = crop_object(load_photo(photo, mask=mask, fov_deg=FOV_DEG, surroundings="photo"))
    assert crop.around.shape == (64, 128, 4)
    cover = crop.around[..., 3]
    truth = response(rotate(radiance, crop.camera_from_crop.T))
    sure = cover > 0.99
    np.testing.assert_allclose(crop.around[sure][:, :3], truth[sure], atol=0.02)
    d = pixel_directions(64) @ crop.camera_from_crop.T  # in the camera's frame
    x, y = d[..., 0] / -d[..., 2], d[..., 1] / -d[..., 2]
    inside = (d[..., 2] < 0) & (np.abs(x) < 0.56) & (np.abs(y) < 0.37)
    outside = (d[..., 2] > 0) | (np.abs(x) > 0.6) | (np.abs(y) > 0.4)
    on_object = (pixel_directions(64) @ [0, 0, -1]) > np.cos(0.8 * np.arctan(crop.tan_half / 1.1))
    assert not cover[outside].any()
    assert not cover[on_object].any()
    far = (pixel_directions(64) @ [0, 0, -1]) < np.cos(1.6 * np.arctan(crop.tan_half))
    assert (cover[inside & far] == 1).all()


@pytest.mark.parametrize("shade", [0, 255, 180])
def test_a_photo_of_one_colour_shows_nothing(shade):
    """A cut-out before black or white is no place; what its alpha channel hides may be one."""
    photo, mask = room_photo(smooth_map())
    plain = photo.copy()
    plain[mask == 0] = shade
    for cut_out in ((plain, mask), (np.dstack([plain, mask]), None)):
        with pytest.raises(InputError, match="one colour behind it"):
            crop_object(load_photo(cut_out[0], mask=cut_out[1], fov_deg=FOV_DEG, surroundings="photo"))
    with_alpha = load_photo(np.dstack([photo, mask]), fov_deg=FOV_DEG, surroundings="photo")
    assert crop_object(with_alpha).around[..., 3].max() == 1.0


def test_a_wide_photo_is_averaged_not_skipped_through():
    """Every second pixel black: half as bright everywhere."""
    photo = np.zeros((800, 1200, 3), np.float32)
    photo[::2, ::2] = photo[1::2, 1::2] = 0.8
    photo[:, 600:] *= 0.5
    image = np.zeros((128, 128, 4), np.float32)
    around = see_around(photo, 70.0, np.eye(3), image, 0.1)
    sure = around[..., 3] > 0.99
    left = pixel_directions(64)[..., 0] < -0.1
    np.testing.assert_allclose(around[sure & left][:, :3], 0.4, atol=0.02)


def test_a_panorama_is_read_as_far_as_it_is_known(tmp_path):
    picture = np.zeros((128, 256, 4), np.uint8)
    picture[:, :, :3] = (200, 100, 50)
    picture[:64, :, 3] = 255
    Image.fromarray(picture).save(tmp_path / "p.png")
    for source in (picture, tmp_path / "p.png", (tmp_path / "p.png").read_bytes()):
        around = read_surroundings(source)
        assert around.shape == (64, 128, 4)
        np.testing.assert_allclose(
            around[:32], [*np.array([200, 100, 50]) / 255, 1.0] * np.ones((32, 128, 1)), atol=1e-3
        )
        assert not around[32:].any()
    assert (read_surroundings(picture[..., :3])[..., 3] == 1).all()


@pytest.mark.parametrize(
    ("source", "says"),
    [
        (np.zeros((64, 64, 3), np.uint8), "twice as wide as high"),
        (np.zeros((64, 128, 4), np.uint8), "not transparent"),
        ("nowhere.png", "surroundings: nowhere.png"),
    ],
)
def test_what_is_no_panorama_is_refused_in_one_line(source, says):
    with pytest.raises(InputError, match=says) as error:
        read_surroundings(source)
    assert "\n" not in str(error.value)


def test_a_panorama_of_the_camera_is_turned_to_the_crop():
    around = np.concatenate([smooth_map(), np.ones((64, 128, 1), np.float32)], axis=-1)
    turn = turn_towards(normalize(np.array([0.5, 0.2, -1.0])))
    np.testing.assert_allclose(rotate(turned(around, turn), turn), around, atol=0.03)
    np.testing.assert_allclose(turned(around, turn)[32, 64], around_at(around, turn @ [0, 0, -1]), atol=0.02)


def around_at(around: np.ndarray, direction: np.ndarray) -> np.ndarray:
    return bilinear(around, direction_to_uv(np.asarray(direction, np.float32)[None]))[0]


def test_what_is_known_takes_the_place_of_the_guess():
    guess = np.full((64, 128, 3), 3.0, np.float32)
    outputs = Outputs(
        radiance=guess,
        irradiance=np.zeros((128, 128, 3), np.float32),
        ldr=response(guess),
        ln_radiance=np.log(guess),
        confidence=np.full((64, 128), 0.2, np.float32),
    )
    around = np.zeros((64, 128, 4), np.float32)
    around[:8] = [*response(np.full(3, 0.5)), 1.0]
    around[8:16] = [1.0, 1.0, 1.0, 1.0]  # burnt out: at least white, and brighter if the guess is
    around[16:24] = 0.5 * np.array([*response(np.full(3, 0.5)), 1.0])
    found = use_surroundings(outputs, around)
    np.testing.assert_allclose(found.radiance[:8], 0.5, rtol=1e-3)
    np.testing.assert_allclose(found.radiance[8:16], 3.0)
    np.testing.assert_allclose(found.radiance[16:24], 1.75, rtol=1e-3)
    np.testing.assert_allclose(found.radiance[24:], 3.0)
    np.testing.assert_allclose(found.ldr, response(found.radiance), atol=1e-6)
    np.testing.assert_allclose(found.confidence[[0, 20, 30], 0], [SEEN, (SEEN + 0.2) / 2, 0.2], atol=1e-6)


def test_a_guess_takes_on_half_of_the_colour_that_it_misses():
    blue = np.broadcast_to(np.float32([0.2, 0.2, 0.6]), (64, 128, 3))
    grey = np.full_like(blue, 0.3)
    outputs = Outputs(
        radiance=grey,
        irradiance=np.zeros((128, 128, 3), np.float32),
        ldr=response(grey),
        ln_radiance=np.log(grey),
        confidence=None,
    )
    around = np.zeros((64, 128, 4), np.float32)
    around[:16] = np.append(response(blue[0, 0]), 1.0)
    found = use_surroundings(outputs, around).radiance[40, 64]
    asked = (blue[0, 0] + TINT_FLOOR) / (0.3 + TINT_FLOOR)
    np.testing.assert_allclose(found[2] / found[0], (asked[2] / asked[0]) ** TINT, rtol=1e-3)
    np.testing.assert_allclose(np.log(found).mean(), np.log(0.3), atol=1e-5)  # its brightness stays
    known = use_surroundings(outputs, around, tint=False)
    np.testing.assert_array_equal(known.radiance[40, 64], 0.3 * np.ones(3, np.float32))


def test_surroundings_change_the_light_and_are_noted():
    photo, mask = room_photo(smooth_map())
    alone = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG)
    told = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="photo")
    assert alone.sidecar()["known"] == {"normals": False}
    assert 0.02 < told.sidecar()["known"]["surroundings"] < 0.06
    assert (
        alone.confidence.max() == 0
    )  # a black object tells nothing; what is seen beside it does not hang on that
    assert told.confidence.max() == pytest.approx(SEEN)
    behind = pixel_directions(64)[..., 2] > 0.3
    assert np.abs(told.radiance - alone.radiance)[behind].mean() > 1e-4  # not only where it was seen
    panorama = to_bytes(response(smooth_map()))
    whole = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings=panorama)
    assert whole.sidecar()["known"]["surroundings"] == 1.0
    assert np.median(np.abs(response(whole.radiance) - response(smooth_map()))) < 0.01


def test_the_papers_chain_has_no_use_for_surroundings():
    photo, mask = room_photo(smooth_map())
    with pytest.raises(InputError, match="use lift"):
        anyprobe.estimate(photo, mask=mask, surroundings="photo", model="paper")


def test_the_command_line_tells_surroundings(tmp_path, command):
    photo, mask = room_photo(smooth_map())
    Image.fromarray(photo).save(tmp_path / "disc.png")
    Image.fromarray(mask).save(tmp_path / "mask.png")
    Image.fromarray(to_bytes(response(smooth_map()))).save(tmp_path / "pano.png")
    call = ("estimate", tmp_path / "disc.png", "--mask", tmp_path / "mask.png", "--fov", "60", "--json")
    call = (*call, "-o", tmp_path / "out")
    for given, share in (("photo", 0.04), (tmp_path / "pano.png", 1.0)):
        done = command(*call, "--surroundings", given)
        assert done.status == 0, done.err
        assert json.loads(done.out)["known"]["surroundings"] == pytest.approx(share, abs=0.02)
    refused = command(*call, "--surroundings", tmp_path / "mask.png")
    assert refused.status == 2
    assert "twice as wide" in refused.err
