"""The object's mask, the field of view, and the crop that the networks see."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from support.refused import assert_one_line

from anyprobe.core.camera import ASSUMED_LONG_FOV_DEG
from anyprobe.core.color import to_bytes
from anyprobe.errors import InvalidMask
from anyprobe.estimate.photo import load_photo
from anyprobe.masks.check import check_mask
from anyprobe.masks.find import find_mask
from anyprobe.masks.sources import mask_from_file
from anyprobe.pictures.images import read_image


def disc(height: int, width: int, x: float, y: float, radius: float) -> np.ndarray:
    """Mask [H, W] float32 of a disc with a soft edge of one pixel."""
    rows, columns = np.mgrid[0:height, 0:width] + 0.5
    return np.clip(radius + 0.5 - np.hypot(columns - x, rows - y), 0.0, 1.0).astype(np.float32)


def rgba_photo(height=120, width=200, x=70.0, y=50.0, radius=30.0, color=(0.6, 0.3, 0.2)) -> np.ndarray:
    alpha = disc(height, width, x, y, radius)
    return np.dstack([np.broadcast_to(np.float32(color), (height, width, 3)), alpha])


# Which mask


def test_mask_goes_before_alpha():
    mask = disc(120, 200, 150.0, 60.0, 20.0)
    photo = load_photo(rgba_photo(), mask=mask)
    np.testing.assert_allclose(photo.mask > 0.5, mask > 0.5)
    np.testing.assert_allclose(load_photo(rgba_photo()).mask, disc(120, 200, 70.0, 50.0, 30.0), atol=1e-6)


def test_box_goes_before_alpha():
    asked = []

    class Drawn:
        name, warning, takes_prompts = "u2netp", "", False

        def cover(self, rgb, on=(), off=(), box=None):
            asked.append(rgb.shape)
            return disc(64, 64, 32.0, 32.0, 20.0)

    found = load_photo(rgba_photo(), box=(101, 11, 199, 109), segmenter=Drawn())
    assert found.mask_source == "box"
    assert found.mask[60, 150] == 1.0
    assert found.mask[50, 70] == 0.0
    assert len(asked) == 2


@pytest.mark.ci
def test_fully_transparent_photo_is_looked_at_as_an_opaque_one():
    """Programs that know no alpha leave it at zero."""
    photo = rgba_photo()
    photo[..., 3] = 0.0
    with pytest.raises(InvalidMask) as caught:
        load_photo(photo)
    assert_one_line(caught, "nothing stands out")


# Mask files


def test_mask_kinds_agree(tmp_path):
    soft = disc(120, 200, 70.0, 50.0, 30.0)
    grey = to_bytes(soft)
    Image.fromarray(grey).save(tmp_path / "grey.png")
    Image.fromarray(grey).save(tmp_path / "grey.jpg", quality=95)
    Image.fromarray(np.dstack([grey] * 3)).save(tmp_path / "color.png")
    Image.fromarray(np.dstack([np.zeros((120, 200, 3), np.uint8), grey])).save(tmp_path / "alpha.png")
    opaque = np.full((120, 200), 200, np.uint8)  # a constant alpha says nothing
    Image.fromarray(np.dstack([grey, grey, grey, opaque])).save(tmp_path / "constant.png")
    Image.fromarray(soft > 0.5).save(tmp_path / "bit.png")
    hard = soft > 0.5
    clear = np.abs(soft - 0.5) > 0.1  # compression may tip the edge itself
    sources = [*sorted(tmp_path.iterdir()), str(tmp_path / "grey.png"), Image.fromarray(grey), grey, soft, hard]
    sources += [hard.astype(np.uint8), hard.astype(np.int64), hard.astype(np.float64)]
    for source in sources:
        mask = mask_from_file(source, (120, 200))
        assert mask.dtype == np.float32
        np.testing.assert_array_equal((mask > 0.5)[clear], hard[clear])


def test_soft_edge_stays_and_compression_noise_goes():
    values = np.zeros((64, 64), dtype=np.uint8)
    values[:, 32:] = 247
    values[:, 31] = 128
    values[:, :20] = 10
    mask = mask_from_file(values, (64, 64))
    assert mask[:, 31] == pytest.approx(0.5, abs=0.01)
    assert mask[:, :20].max() == 0.0
    assert mask[:, 32:].min() == 1.0


def test_mask_must_fit_the_upright_photo(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.new("RGB", (200, 120), "grey").save(tmp_path / "phone.jpg", exif=exif)
    upright = np.zeros((200, 120), np.uint8)
    upright[50:100, 20:60] = 255
    assert load_photo(tmp_path / "phone.jpg", mask=upright).rgb.shape == (200, 120, 3)
    with pytest.raises(InvalidMask) as caught:
        load_photo(tmp_path / "phone.jpg", mask=upright.T)
    assert_one_line(caught, "120 x 200", "200 x 120", "upright")


def test_object_under_24_pixels():
    for shape, accepted in (((23, 23), False), ((24, 3), True), ((3, 24), True)):
        mask = np.zeros((64, 64))
        mask[5 : 5 + shape[0], 7 : 7 + shape[1]] = 1.0
        if accepted:
            assert check_mask(mask).dtype == np.float32
            continue
        with pytest.raises(InvalidMask) as caught:
            check_mask(mask)
        assert_one_line(caught, "24 pixels", "23 x 23")


# Box


@pytest.mark.ci
@pytest.mark.parametrize("scale", [1, 6])
def test_box_finds_the_object(scale, small_masks):
    height, width = 120 * scale, 200 * scale
    truth = disc(height, width, 70.0 * scale, 50.0 * scale, 30.0 * scale)[..., None]
    noise = np.random.default_rng(0).normal(0.0, 0.02, (height, width, 3))
    rgb = truth * (0.7, 0.35, 0.2) + (1 - truth) * (0.2, 0.4, 0.5) + noise
    rgb = np.clip(rgb, 0.0, 1.0).astype(np.float32)
    box = tuple(scale * v for v in (32, 12, 108, 88))
    mask = find_mask(read_image(rgb), box=box).mask
    assert mask.shape == (height, width)
    found, true = mask > 0.5, truth[..., 0] > 0.5
    assert (found & true).sum() / (found | true).sum() > 0.95
    if scale == 1:
        np.testing.assert_array_equal(mask, find_mask(read_image(rgb), box=box).mask)  # the same twice


# Field of view and exposure


def test_field_of_view_given_then_exif_then_default(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 1
    exif.get_ifd(0x8769)[0xA405] = 18
    Image.fromarray(to_bytes(rgba_photo())).save(tmp_path / "photo.png", exif=exif)
    given = load_photo(tmp_path / "photo.png", fov_deg=40.0)
    assert (given.long_fov_deg, given.fov_source) == (40.0, "given")
    read = load_photo(tmp_path / "photo.png")
    assert read.fov_source == "exif"
    assert read.long_fov_deg == pytest.approx(90.0)
    default = load_photo(rgba_photo())
    assert (default.long_fov_deg, default.fov_source) == (ASSUMED_LONG_FOV_DEG, "default")
    assert default.warnings == ()


def test_an_object_that_is_clipped_in_a_small_part_does_not_warn():
    photo = rgba_photo(color=(0.5, 0.5, 0.5))
    photo[49:52, :, :3] = 1.0
    assert load_photo(photo).warnings == ()
