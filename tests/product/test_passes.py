"""The parts of a relit photo compose to it, and objects mirror their ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.scenes import made_map, sphere_photo

from anyprobe.core.color import COLORSPACES, rec709_from_rgb
from anyprobe.core.response import inverse_response, response
from anyprobe.errors import InvalidEnvironment
from anyprobe.estimate.photo import load_photo
from anyprobe.maps.exr import read_exr, write_channels
from anyprobe.maps.radiance import read_radiance, write_exr
from anyprobe.pictures.images import read_image, write_png
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.relight.passes import passes_of, write_passes
from anyprobe.render.shapes import sphere
from anyprobe.scatter.materials import Material

pytestmark = pytest.mark.usefixtures("rough_shadows", "networks_opened_once")

MIRROR = Material(albedo=np.zeros(3), f0=np.ones(3), alpha=0.02)
LIGHT = made_map()


@pytest.fixture(scope="module")
def photo():
    return load_photo(sphere_photo((60, 90), 60, 160, 240))


@pytest.fixture
def relight(command, tmp_path, photo):
    """The command on a photo like that of `photo`, with its mask."""
    mask = tmp_path / "mask.png"
    Image.fromarray((photo.mask * 255).astype(np.uint8)).save(mask)
    return lambda path, *given: command("relight", path, "--mask", mask, *given)


@pytest.mark.ci
@pytest.mark.parametrize("at", [None, (90, 112)])
def test_parts_compose_to_the_relit_photo(photo, at):
    """photo * shadow, and the object over it; the second is partly behind the real one."""
    stage = Stage(photo, sphere(24), Arrangement(at=at))
    passes = passes_of(stage, LIGHT, "gold")
    relit = stage.relit(LIGHT, "gold")
    assert np.abs(response(passes.composed()) - relit).max() < 1 / 255
    by_hand = inverse_response(photo.rgb) * passes.shadow
    by_hand = by_hand * (1 - passes.object[..., 3:]) + passes.object[..., :3]
    np.testing.assert_allclose(passes.composed(), by_hand, atol=1e-5)
    assert passes.shadow.min() < 0.7
    assert passes.occlusion.min() < 0.9
    assert passes.object[..., 3].max() == 1


@pytest.mark.ci
def test_shadows_on_what_is_above_white_are_those_of_the_layers(photo):
    """A photo of radiance is eight times white: half in shadow it is still white."""
    bright = np.clip(inverse_response(photo.rgb), 0.3, None) * 8
    stage = Stage(replace(photo, rgb=response(bright).astype(np.float32), radiance=bright), sphere(24))
    passes = passes_of(stage, LIGHT, "gold")
    beside = passes.object[..., 3] == 0
    assert passes.shadow[beside].min() < 0.7
    difference = response(passes.composed()) - stage.relit(LIGHT, "gold")
    assert np.abs(difference[beside]).max() < 1 / 255


@pytest.mark.ci
@pytest.mark.parametrize("colorspace", ["rec709", "acescg"])
def test_the_file_s_layers_compose_in_its_primaries(photo, tmp_path, colorspace):
    passes = passes_of(Stage(photo, sphere(24)), LIGHT, "gold")
    write_passes(tmp_path / "a.exr", passes, colorspace)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        found = {name: one.pixels.astype(np.float32) for name, one in file.channels().items()}
        said = file.header()["chromaticities"]
    np.testing.assert_allclose(said, COLORSPACES[colorspace], atol=1e-6)
    for c in "RGB":
        composed = found[f"plate.{c}"] * found[f"shadow.{c}"] * (1 - found["object.A"]) + found[f"object.{c}"]
        np.testing.assert_allclose(composed, found[c], rtol=0.004, atol=1e-3)
    back = read_exr(tmp_path / "a.exr", "a", InvalidEnvironment, 10**7, rec709=True)[..., :3]
    np.testing.assert_allclose(back, passes.composed(), rtol=0.004, atol=2e-3)


def test_acescg_keeps_white_and_comes_back(tmp_path):
    light = np.full((32, 64, 3), 0.5, np.float32)
    light[:16] = 0.8, 0.1, 0.05
    write_exr(tmp_path / "a.exr", light, half=False, colorspace="acescg")
    stored = read_exr(tmp_path / "a.exr", "a", InvalidEnvironment, 10**7)
    np.testing.assert_allclose(stored[20], 0.5, atol=1e-5)
    # AP1 from Rec. 709 by Bradford, as the ACES documents print it: 0.6131 0.3395 0.0474 in the first row
    assert stored[2, 0, 0] == pytest.approx(0.6131 * 0.8 + 0.3395 * 0.1 + 0.0474 * 0.05, abs=2e-4)
    np.testing.assert_allclose(read_radiance(tmp_path / "a.exr"), light, atol=1e-5)


@pytest.mark.ci
def test_a_mirror_shows_the_ground_below_and_the_light_above(photo):
    """A sphere in a photo of one colour under black light: its lower half is that colour, its upper half black."""
    colour = np.array([0.6, 0.4, 0.2], np.float32)
    flat = load_photo(np.broadcast_to(colour, photo.rgb.shape).copy(), mask=photo.mask, pitch_deg=20)
    stage = Stage(flat, sphere(48))
    drawn = stage.draw(np.zeros((64, 128, 3), np.float32), MIRROR)
    upper, lower = (
        drawn[round(a * len(drawn)) : round(b * len(drawn)), round(0.35 * len(drawn)) : round(0.65 * len(drawn))]
        for a, b in ((0.15, 0.35), (0.72, 0.85))
    )
    np.testing.assert_allclose(
        lower[..., :3], np.broadcast_to(inverse_response(colour), lower[..., :3].shape), rtol=0.03
    )
    assert upper[..., :3].max() < 0.01


@pytest.mark.ci
def test_a_mirrored_ground_has_its_pattern(photo):
    """The left half of the ground is red and the right half green: so is the sphere's lower half."""
    rgb = np.full_like(photo.rgb, 0.5)
    stage = Stage(photo, sphere(48))
    foot = stage.view.pixels(stage.placement.foot)
    middle = round(float(foot[0]))
    rgb[:, :middle], rgb[:, middle:] = (0.7, 0.1, 0.1), (0.1, 0.7, 0.1)
    plain = load_photo(rgb, mask=photo.mask)
    there = Stage(plain, sphere(48), Arrangement(at=(float(foot[0]), float(foot[1]))))
    drawn = there.draw(np.zeros((64, 128, 3), np.float32), MIRROR)
    size = len(drawn)
    row = round(0.75 * size)  # higher up the ball mirrors ground below the photo's border
    assert drawn[row, round(0.3 * size), 0] > 3 * drawn[row, round(0.3 * size), 1]
    assert drawn[row, round(0.75 * size), 1] > 3 * drawn[row, round(0.75 * size), 0]


@pytest.mark.ci
@pytest.mark.parametrize("opaque", [0, 60])
def test_transparent_pixels_are_no_ground(photo, opaque):
    """Whatever colour they have: a cut-out's object mirrors the light from below, and else the ground that is shown."""
    drawn = []
    for hidden in (0, 255):
        rgba = np.full((*photo.mask.shape, 4), 128, np.uint8)
        rgba[..., 3] = 255 * (photo.mask > 0.5)
        rgba[len(rgba) - opaque :, :, 3] = 255
        rgba[rgba[..., 3] == 0, :3] = hidden
        stage = Stage(load_photo(rgba, mask=photo.mask, surroundings="none"), sphere(48))
        for material in (MIRROR, "photo"):
            drawn.append(stage.draw(np.full((64, 128, 3), 0.5, np.float32), material))
    np.testing.assert_array_equal(drawn[0], drawn[2])
    np.testing.assert_array_equal(drawn[1], drawn[3])
    ground = inverse_response(np.float32(128 / 255)) if opaque else 0.5
    size = len(drawn[0])
    lower = drawn[0][round(0.75 * size) : round(0.82 * size), round(0.45 * size) : round(0.55 * size), :3]
    assert 0.6 * ground < lower.min()  # in the object's shadow
    assert lower.max() < 1.05 * ground


def test_pixels_that_are_asked_for_count_though_transparent(photo):
    rgba = sphere_photo((60, 90), 60, 160, 240)
    assert load_photo(rgba).hidden.mean() == pytest.approx(1 - photo.mask.mean(), abs=0.01)
    assert load_photo(rgba, surroundings="photo").hidden is None
    assert load_photo(rgba[..., :3], mask=photo.mask).hidden is None


@pytest.mark.ci
def test_the_command_says_that_the_result_of_a_cut_out_is_opaque(command, photo_path, work):
    for given in ((), ("--strict",)):
        done = command("relight", photo_path, *given)
        assert "warning: the photo is partly transparent: the result is opaque there" in done.err
        assert done.status == (2 if given else 0)
    done = command("relight", photo_path, "--surroundings", "photo")
    assert "transparent" not in done.err


@pytest.mark.ci
def test_the_command_writes_passes(relight, tmp_path, photo):
    deep = tmp_path / "photo.png"
    write_png(deep, photo.rgb)
    for name in ("a.png", "a.exr"):
        done = relight(deep, "-o", tmp_path / name, *(["--colorspace", "acescg"] if name == "a.exr" else []))
        assert done.status == 0, done.err
    linear = read_exr(tmp_path / "a.exr", "a", InvalidEnvironment, 10**7, rec709=True)[..., :3]
    assert np.abs(response(linear) - read_image(tmp_path / "a.png").rgb).max() < 0.02
    refused = relight(deep, "-o", tmp_path / "b.png", "--colorspace", "acescg")
    assert "--colorspace: does nothing without an .exr" in refused.err


@pytest.mark.ci
@pytest.mark.parametrize("stored", ["rec709", "acescg"])
@pytest.mark.parametrize("colorspace", ["rec709", "acescg"])
def test_the_plate_of_an_exr_keeps_what_lies_outside(relight, tmp_path, photo, stored, colorspace):
    """Values above the largest half, below 0 and outside of Rec. 709; to the bit in the primaries of the photo."""
    plate = inverse_response(photo.rgb).astype(np.float32)
    plate[2, :3] = (1e5, 2e5, 3e5), (-0.01, 0.2, 0.3), (0.0, 0.9, 0.0)
    channels = {name: np.ascontiguousarray(plate[..., k]) for k, name in enumerate("RGB")}
    path = tmp_path / "plate.exr"
    write_channels(path, channels, {"chromaticities": COLORSPACES[stored]}, latlong=False)
    done = relight(path, "--colorspace", colorspace, "-o", tmp_path / "a.exr")
    assert done.status == 0, done.err
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        found = {name: one.pixels for name, one in file.channels().items()}
    given = plate
    if stored != colorspace:
        matrix = rec709_from_rgb(COLORSPACES["acescg"])
        given = plate @ (matrix if stored == "acescg" else np.linalg.inv(matrix)).T
    for k, name in enumerate("RGB"):
        if stored == colorspace:
            np.testing.assert_array_equal(found[f"plate.{name}"], plate[..., k])
        np.testing.assert_allclose(found[f"plate.{name}"], given[..., k], rtol=1e-5, atol=1e-6)
        np.testing.assert_array_equal(found[name][2], found[f"plate.{name}"][2])  # where there is no shadow


@pytest.mark.ci
def test_a_plate_of_halves_stays_one(relight, tmp_path, photo):
    plate = inverse_response(photo.rgb).astype(np.float16)
    channels = {name: np.ascontiguousarray(plate[..., k]) for k, name in enumerate("RGB")}
    write_channels(tmp_path / "plate.exr", channels, {}, latlong=False)
    done = relight(tmp_path / "plate.exr", "-o", tmp_path / "a.exr")
    assert done.status == 0, done.err
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        found = {name: one.pixels for name, one in file.channels().items()}
    for k, name in enumerate("RGB"):
        assert found[f"plate.{name}"].dtype == np.float16
        np.testing.assert_array_equal(found[f"plate.{name}"], plate[..., k])


def test_what_halves_do_not_hold_is_written_in_32_bits(photo, tmp_path):
    passes = passes_of(Stage(photo, sphere(24)), LIGHT, "gold")
    passes.plate[0, 0] = 1e6
    write_passes(tmp_path / "a.exr", passes, "rec709")
    back = read_exr(tmp_path / "a.exr", "a", InvalidEnvironment, 10**7)
    np.testing.assert_array_equal(back[0, 0, :3], 1e6)
