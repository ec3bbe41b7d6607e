"""What is known of the map itself: read, put into the crop's frame, shown to the network and kept."""

from __future__ import annotations

import json

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.refused import refused
from support.room_photos import FOV_DEG, room_photo, smooth_map
from support.transforms import transforms

import anyprobe
from anyprobe.core.camera import PinholeCamera
from anyprobe.core.color import luminance, to_bytes
from anyprobe.core.frames import normalize, turn_towards
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.core.response import inverse_response, response
from anyprobe.errors import InputError
from anyprobe.estimate.photo import crop_object, load_photo
from anyprobe.estimate.runtime import Outputs, lift_inputs
from anyprobe.estimate.surroundings import (
    CLIPPED,
    SEEN,
    TINT_FLOOR,
    GoesOn,
    read_panorama,
    turned,
    use_surroundings,
    visible_surroundings,
)
from anyprobe.light.environment import rotate
from anyprobe.maps.radiance import write_exr, write_hdr

STAYS = GoesOn(share=0.0)
"""What is seen does not go on beside it."""


def test_a_photo_shows_the_map_beside_its_object_in_the_crops_frame():
    """Wherever the object is in it: turned back to the camera, every place shows what lies in its direction."""
    radiance = smooth_map()
    photo, mask = room_photo(radiance)
    crop = crop_object(load_photo(photo, mask=mask, fov_deg=FOV_DEG, surroundings="photo"))
    assert crop.surroundings_map.shape == (64, 128, 4)
    cover = crop.surroundings_map[..., 3]
    truth = response(rotate(radiance, crop.camera_from_crop.T))
    sure = cover > 0.99
    np.testing.assert_allclose(crop.surroundings_map[sure][:, :3], truth[sure], atol=0.02)
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
    assert crop_object(with_alpha).surroundings_map[..., 3].max() == 1.0


def test_a_wide_photo_is_averaged_not_skipped_through():
    """Every second pixel black: half as bright everywhere."""
    photo = np.zeros((800, 1200, 3), np.float32)
    photo[::2, ::2] = photo[1::2, 1::2] = 0.8
    photo[:, 600:] *= 0.5
    image = np.zeros((128, 128, 4), np.float32)
    surroundings_map = visible_surroundings(
        photo, PinholeCamera.of_fov(photo.shape[1], photo.shape[0], 70.0), np.eye(3), image, 0.1
    )
    sure = surroundings_map[..., 3] > 0.99
    left = pixel_directions(64)[..., 0] < -0.1
    np.testing.assert_allclose(surroundings_map[sure & left][:, :3], 0.4, atol=0.02)


def test_a_panorama_is_read_as_far_as_it_is_known(tmp_path):
    picture = np.zeros((128, 256, 4), np.uint8)
    picture[:, :, :3] = (200, 100, 50)
    picture[:64, :, 3] = 255
    Image.fromarray(picture).save(tmp_path / "p.png")
    for source in (picture, tmp_path / "p.png", (tmp_path / "p.png").read_bytes()):
        surroundings_map, _ = read_panorama(source)
        assert surroundings_map.shape == (64, 128, 4)
        np.testing.assert_allclose(
            surroundings_map[:32], [*np.array([200, 100, 50]) / 255, 1.0] * np.ones((32, 128, 1)), atol=1e-3
        )
        assert not surroundings_map[32:].any()
    assert (read_panorama(picture[..., :3])[0][..., 3] == 1).all()


def lit_room() -> np.ndarray:
    """[64, 128, 3]: the soft map with an emitter of radiance 40, whose borders are the map's own pixels'."""
    radiance = smooth_map()
    radiance[20:24, 60:66] = [40.0, 30.0, 20.0]
    return radiance


@pytest.mark.parametrize("kind", ["exr", "hdr", "bytes"])
def test_a_panorama_of_radiance_keeps_its_emitters(tmp_path, kind):
    """The network is told display values; what is above white stays in the result."""
    fine = np.repeat(np.repeat(lit_room(), 2, axis=0), 2, axis=1)
    source = tmp_path / ("p.hdr" if kind == "hdr" else "p.exr")
    (write_hdr if kind == "hdr" else write_exr)(source, fine)
    source = source.read_bytes() if kind == "bytes" else source
    surroundings_map, _ = read_panorama(source)
    assert surroundings_map.shape == (64, 128, 5)
    shown = lift_inputs(np.zeros((128, 128, 4)), 0.3, surroundings=surroundings_map)["surroundings"]
    assert shown.shape == (1, 4, 64, 128)
    np.testing.assert_allclose(shown[0, :3].transpose(1, 2, 0), response(lit_room()), atol=5e-3)
    guess = np.broadcast_to(np.float32([900, 50, 50]), (64, 128, 3))
    found = use_surroundings(answered(guess), surroundings_map)
    np.testing.assert_allclose(found.radiance, lit_room(), rtol=0.01, atol=0.01)
    turn = turn_towards(normalize(np.array([0.2, 0.1, -1.0])))
    turned_too = use_surroundings(answered(guess), turned(surroundings_map, turn)).radiance
    truth = rotate(lit_room(), turn.T)
    inside = (truth.max(axis=-1) > 39) | (truth.max(axis=-1) < 0.7)  # not its border
    np.testing.assert_allclose(turned_too[inside], truth[inside], rtol=0.02, atol=0.02)


def test_a_panorama_of_radiance_may_be_unfinished(tmp_path):
    """Colour is premultiplied by A; half a pixel known counts as half."""
    alpha = np.zeros((64, 128), np.float32)
    alpha[:32], alpha[32] = 1.0, 0.5
    layers = dict(zip("RGB", np.moveaxis(lit_room() * alpha[..., None], -1, 0), strict=True)) | {"A": alpha}
    OpenEXR.File({}, {k: np.ascontiguousarray(v) for k, v in layers.items()}).write(str(tmp_path / "p.exr"))
    surroundings_map, _ = read_panorama(tmp_path / "p.exr")
    np.testing.assert_allclose(surroundings_map[..., 3], alpha)
    guess = np.full((64, 128, 3), 3.0, np.float32)
    found = use_surroundings(answered(guess), surroundings_map, tint=False, goes_on=STAYS).radiance
    np.testing.assert_allclose(found[:32], lit_room()[:32], rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(found[32], (lit_room()[32] + 3.0) / 2, rtol=1e-3)
    np.testing.assert_allclose(found[33:], 3.0)


@pytest.mark.parametrize(
    ("source", "says"),
    [
        (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\nabc", "surroundings bytes: expected 4 whole rows"),
        (b"\x76\x2f\x31\x01 and no more", "surroundings bytes: expected a flat OpenEXR picture"),
        (np.zeros((64, 64, 3), np.uint8), "twice as wide as high"),
        (np.zeros((64, 128, 4), np.uint8), "not transparent"),
        ("nowhere.png", "surroundings nowhere.png"),
    ],
)
def test_what_is_no_panorama_is_refused_in_one_line(source, says):
    with pytest.raises(InputError, match=says) as error:
        read_panorama(source)
    assert "\n" not in str(error.value)


def test_a_panorama_of_the_camera_is_turned_to_the_crop():
    surroundings_map = np.concatenate([smooth_map(), np.ones((64, 128, 1), np.float32)], axis=-1)
    turn = turn_towards(normalize(np.array([0.5, 0.2, -1.0])))
    np.testing.assert_allclose(rotate(turned(surroundings_map, turn), turn), surroundings_map, atol=0.03)
    np.testing.assert_allclose(
        turned(surroundings_map, turn)[32, 64], surroundings_at(surroundings_map, turn @ [0, 0, -1]), atol=0.02
    )


def surroundings_at(surroundings_map: np.ndarray, direction: np.ndarray) -> np.ndarray:
    return bilinear(surroundings_map, direction_to_uv(np.asarray(direction, np.float32)[None]))[0]


def test_what_is_known_takes_the_place_of_the_guess():
    guess = np.full((64, 128, 3), 3.0, np.float32)
    outputs = Outputs(
        radiance=guess,
        irradiance=np.zeros((128, 128, 3), np.float32),
        ldr=response(guess),
        ln_radiance=np.log(guess),
        confidence=np.full((64, 128), 0.2, np.float32),
    )
    surroundings_map = np.zeros((64, 128, 4), np.float32)
    surroundings_map[:8] = [*response(np.full(3, 0.5)), 1.0]
    surroundings_map[8:16] = [1.0, 1.0, 1.0, 1.0]  # clipped: at least white, and brighter if the guess is
    surroundings_map[16:24] = 0.5 * np.array([*response(np.full(3, 0.5)), 1.0])
    found = use_surroundings(outputs, surroundings_map, goes_on=STAYS)
    np.testing.assert_allclose(found.radiance[:8], 0.5, rtol=1e-3)
    np.testing.assert_allclose(found.radiance[8:16], 3.0)
    np.testing.assert_allclose(found.radiance[16:24], 1.75, rtol=1e-3)
    np.testing.assert_allclose(found.radiance[24:], 3.0)
    np.testing.assert_allclose(found.ldr, response(found.radiance), atol=1e-6)
    np.testing.assert_allclose(found.confidence[[0, 20, 30], 0], [SEEN, (SEEN + 0.2) / 2, 0.2], atol=1e-6)


def answered(guess: np.ndarray) -> Outputs:
    """A model's answer that is this map."""
    return Outputs(
        radiance=guess,
        irradiance=np.zeros((128, 128, 3), np.float32),
        ldr=response(guess),
        ln_radiance=np.log(guess),
        confidence=None,
    )


@pytest.mark.parametrize("shown", [(0.5, 0.7, 1.0), (0.6, 0.98, 0.6), (0.99, 1.0, 0.8)])
@pytest.mark.parametrize("emitter", [(30, 20, 10), (0.1, 0.1, 0.1)])
def test_what_is_clipped_out_in_some_channels_keeps_its_hue(shown, emitter):
    """An emitter guessed there would else be seen in these channels alone: a pure blue sun."""
    guess = np.broadcast_to(np.float32(emitter), (64, 128, 3))
    surroundings_map = np.zeros((64, 128, 4), np.float32)
    surroundings_map[8:16] = [*shown, 1.0]
    seen = inverse_response(np.float32(shown))
    found = use_surroundings(answered(guess), surroundings_map).radiance[10, 10]
    np.testing.assert_allclose(found / found[1], seen / seen[1], rtol=1e-4)
    assert (found >= seen - 1e-5).all()
    not_clipped = np.array(shown) < CLIPPED
    assert (response(found)[not_clipped] < CLIPPED + 1e-3).all()  # as the photo shows
    if emitter[0] > 1:
        assert response(found)[not_clipped].max() == pytest.approx(CLIPPED, abs=1e-3)
    else:
        np.testing.assert_allclose(found, seen, rtol=1e-4)


def test_what_is_clipped_out_altogether_is_as_bright_as_the_guess():
    guess = np.broadcast_to(np.float32([30, 20, 10]), (64, 128, 3))
    surroundings_map = np.zeros((64, 128, 4), np.float32)
    surroundings_map[8:16] = [1.0, 1.0, 0.98, 1.0]
    found = use_surroundings(answered(guess), surroundings_map, tint=False).radiance[10, 10]
    assert luminance(found) == pytest.approx(luminance(guess[0, 0]), rel=1e-4)
    seen = inverse_response(np.float32([1.0, 1.0, 0.98]))
    np.testing.assert_allclose(found / found[0], seen / seen[0], rtol=1e-4)


def test_a_guess_takes_on_half_of_the_colour_that_it_misses():
    blue = np.broadcast_to(np.float32([0.2, 0.2, 0.6]), (64, 128, 3))
    grey = np.full_like(blue, 0.3)
    outputs = answered(grey)
    surroundings_map = np.zeros((64, 128, 4), np.float32)
    surroundings_map[:16] = np.append(response(blue[0, 0]), 1.0)
    found = use_surroundings(outputs, surroundings_map, goes_on=STAYS).radiance[40, 64]
    asked = (blue[0, 0] + TINT_FLOOR) / (0.3 + TINT_FLOOR)
    np.testing.assert_allclose(found[2] / found[0], (asked[2] / asked[0]) ** 0.5, rtol=1e-3)
    np.testing.assert_allclose(np.log(found).mean(), np.log(0.3), atol=1e-5)  # its brightness stays
    known = use_surroundings(outputs, surroundings_map, tint=False, goes_on=STAYS)
    np.testing.assert_allclose(known.radiance[40, 64], 0.3 * np.ones(3, np.float32), rtol=1e-5)


def test_surroundings_change_the_light_and_are_noted():
    photo, mask = room_photo(smooth_map())
    alone = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="none")
    hints = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="photo")
    assert alone.sidecar()["hints"] == {"normals": False}
    assert 0.02 < hints.sidecar()["hints"]["surroundings"] < 0.06
    assert alone.confidence.max() == 0  # a black object tells nothing; what is seen beside it does not hang on that
    assert hints.confidence.max() == pytest.approx(SEEN)
    behind = pixel_directions(64)[..., 2] > 0.3
    assert np.abs(hints.radiance - alone.radiance)[behind].mean() > 1e-4  # not only where it was seen
    panorama = to_bytes(response(smooth_map()))
    whole = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings=panorama)
    assert whole.sidecar()["hints"]["surroundings"] == 1.0
    assert np.median(np.abs(response(whole.radiance) - response(smooth_map()))) < 0.01


def test_the_papers_chain_has_no_use_for_surroundings():
    photo, mask = room_photo(smooth_map())
    with refused("surroundings", naming="paper"):
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
        assert json.loads(done.out)["hints"]["surroundings"] == pytest.approx(share, abs=0.02)
    refused = command(*call, "--surroundings", tmp_path / "mask.png")
    assert refused.status == 2
    assert "twice as wide" in refused.err


@pytest.mark.parametrize("kind", ["exr", "hdr"])
def test_the_emitters_of_a_panorama_come_through_the_command(tmp_path, command, kind):
    """The network is told white there; several photos know them too, the panorama being the first one's."""
    photo, mask = room_photo(smooth_map())
    for name in ("disc", "other"):
        Image.fromarray(np.dstack([photo, mask])).save(tmp_path / f"{name}.png")
    (write_hdr if kind == "hdr" else write_exr)(tmp_path / f"pano.{kind}", lit_room())
    (tmp_path / "poses.json").write_text(transforms([np.eye(3)] * 2, ("disc.png", "other.png")))
    call = ("--fov", FOV_DEG, "--surroundings", tmp_path / f"pano.{kind}", "-o", tmp_path / "out", "-q")
    for several in ((), (tmp_path / "other.png", "--poses", tmp_path / "poses.json")):
        done = command("estimate", tmp_path / "disc.png", *several, *call)
        assert done.status == 0, done.err
        found = anyprobe.Light.load(tmp_path / "out" / "disc.exr")
        truth = lit_room()
        assert found.radiance.max() == pytest.approx(40, rel=0.25)  # turned to the crop and back
        assert found.dominant_light().direction @ anyprobe.Light(radiance=truth).dominant_light().direction > 0.998
        power = found.dominant_light().irradiance / anyprobe.Light(radiance=truth).dominant_light().irradiance
        np.testing.assert_allclose(power, 1.0, atol=0.15)


@pytest.mark.parametrize(("beside", "known"), [(0.3, False), (0.4, True)])
def test_surroundings_much_darker_than_the_object_tell_nothing(beside, known):
    """Unless they are asked for: a dark room's walls say nothing of its lamp."""
    photo, mask = room_photo(smooth_map())
    dark, inside = photo.astype(np.float32) / 255, mask > 0
    dark[inside] = 0.6
    dark[~inside] *= np.random.default_rng(0).uniform(0.5, 1.5, dark[~inside].shape)  # else it is one colour
    dark[~inside] *= 0.6 * beside / luminance(dark[~inside]).mean()
    dark = (255 * dark.clip(0, 1)).astype(np.uint8)
    assert (load_photo(dark, mask=mask, fov_deg=FOV_DEG).surroundings is not None) is known
    assert load_photo(dark, mask=mask, fov_deg=FOV_DEG, surroundings="photo").surroundings is not None


def test_what_is_seen_goes_on_beside_it_the_more_the_nearer():
    """A guess is drawn towards the nearest seen colour; light above white stays, and nothing seen changes nothing."""
    guess = np.full((64, 128, 3), 0.1, np.float32)
    guess[32, 100] = 20.0
    outputs = Outputs(radiance=guess, irradiance=guess, ldr=guess, ln_radiance=guess)
    surroundings = np.zeros((64, 128, 4), np.float32)
    surroundings[24:40, 40:60] = [0.8, 0.8, 0.8, 1.0]
    radiance = use_surroundings(outputs, surroundings, tint=False).radiance
    levels = radiance[32, [62, 70, 80, 96], 0]
    assert levels[0] > levels[1] > levels[2] > levels[3] > 0.1
    assert levels[0] < inverse_response(np.float32(0.8))
    assert radiance[32, 100, 0] > 19.0
    np.testing.assert_array_equal(use_surroundings(outputs, 0 * surroundings, tint=False).radiance, guess)
