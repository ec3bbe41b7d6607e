"""Depth that a phone's file carries: in every container what was written comes out, and gives normals and mask."""

import numpy as np
import pytest
from support import depth_files
from support.depth_files import (
    DISPARITY,
    INVERSE_Z,
    OTHER_DISPARITY,
    apple_portrait,
    dynamic_depth_jpeg,
    gdepth_jpeg,
    heic_with_depth,
    turned,
)
from support.refused import refused

from anyprobe import load_photo
from anyprobe.errors import InvalidMask
from anyprobe.masks.depth import read_depth
from anyprobe.pictures.images import read_image
from anyprobe.pictures.photo_depth import MOST_PIXELS
from anyprobe.video.following import MaskFollower

HEIGHT, WIDTH, FOV_DEG = 96, 128, 50.0
NEAR, FAR = 0.5, 4.0
LEVELS = np.linspace(0.0, 1.0, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH) ** 2
PICTURE = np.random.default_rng(0).uniform(0.2, 0.8, (HEIGHT, WIDTH, 3))
INVERSE = 1 / (1 / FAR + LEVELS * (1 / NEAR - 1 / FAR))
"""Depth of levels that are linear in its inverse, the nearest 1."""
LINEAR = NEAR + LEVELS * (FAR - NEAR)

RANGE = {"Near": str(NEAR), "Far": str(FAR)}
APPLE = {"IntMinValue": "0", "IntMaxValue": "255", "FloatMinValue": str(1 / FAR), "FloatMaxValue": str(1 / NEAR)}

CONTAINERS = {
    "HEIC, disparity": (lambda: heic_with_depth(PICTURE, LEVELS, DISPARITY, 1 / FAR, 1 / NEAR), INVERSE),
    "HEIC, inverse depth": (lambda: heic_with_depth(PICTURE, LEVELS, INVERSE_Z, NEAR, FAR), INVERSE),
    "HEIC, depth": (lambda: heic_with_depth(PICTURE, LEVELS, depth_files.Z, NEAR, FAR), LINEAR),
    "Apple's JPEG": (lambda: apple_portrait(PICTURE, LEVELS, AuxiliaryImageType="disparity", **APPLE), INVERSE),
    "Apple's JPEG, depth": (
        lambda: apple_portrait(
            PICTURE, LEVELS, **{**APPLE, "FloatMinValue": "0.5", "FloatMaxValue": "4", "AuxiliaryImageType": "depth"}
        ),
        LINEAR,
    ),
    "GDepth": (lambda: gdepth_jpeg(PICTURE, 1 - LEVELS, Format="RangeInverse", **RANGE), INVERSE),
    "GDepth in parts": (lambda: gdepth_jpeg(PICTURE, LEVELS, parts=3, Format="RangeLinear", **RANGE), LINEAR),
    "Dynamic Depth": (
        lambda: dynamic_depth_jpeg(PICTURE, 1 - LEVELS, Format="RangeInverse", Units="Meters", **RANGE),
        INVERSE,
    ),
    "Dynamic Depth by use": (
        lambda: dynamic_depth_jpeg(PICTURE, LEVELS, by_semantic=True, Format="RangeLinear", **RANGE),
        LINEAR,
    ),
    "Dynamic Depth in diopters": (
        lambda: dynamic_depth_jpeg(PICTURE, LEVELS, Format="RangeLinear", Units="Diopters", Near="0.25", Far="2"),
        INVERSE,
    ),
}


def made(name: str) -> bytes:
    if name.startswith("HEIC"):
        pytest.importorskip("pillow_heif")
    return CONTAINERS[name][0]()


@pytest.mark.parametrize("name", CONTAINERS)
def test_depth_comes_out_as_it_was_written(name):
    found, depth = read_image(made(name), with_depth=True).depth, CONTAINERS[name][1]
    assert (found.dtype, found.shape) == (np.float32, depth.shape)
    step = 1.5 / 255  # half a level, and JPEG's noise
    if depth is INVERSE:
        np.testing.assert_allclose(1 / found, 1 / depth, atol=step * (1 / NEAR - 1 / FAR))
    else:
        np.testing.assert_allclose(found, depth, atol=step * (FAR - NEAR))


def test_it_is_turned_as_the_photo_is():
    data = gdepth_jpeg(PICTURE, LEVELS, Format="RangeLinear", **RANGE)
    found = read_image(turned(data, 6), with_depth=True)
    assert found.rgb.shape == (WIDTH, HEIGHT, 3)
    np.testing.assert_allclose(found.depth, np.rot90(LINEAR, -1), atol=1e-3)


def test_disparity_of_nothing_is_not_measured():
    """The far end of relative disparity may lie beyond infinity."""
    properties = {**APPLE, "FloatMinValue": "-1", "FloatMaxValue": "1", "AuxiliaryImageType": "disparity"}
    found = read_image(apple_portrait(PICTURE, LEVELS, **properties), with_depth=True).depth
    assert (found[LEVELS < 0.48] == 0).all()
    np.testing.assert_allclose(found[LEVELS > 0.7], 1 / (2 * LEVELS[LEVELS > 0.7] - 1), rtol=0.03)


# What it gives

CENTRE, RADIUS = np.array([0.05, -0.02, -1.0]), 0.25


def ball() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth of a sphere before a wall at FAR, its mask and its normals."""
    focal = WIDTH / 2 / np.tan(np.radians(FOV_DEG) / 2)
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5 - WIDTH / 2, HEIGHT / 2 - np.arange(HEIGHT) - 0.5)
    d = np.stack([x / focal, y / focal, -np.ones_like(x)], axis=-1)
    a, b, c = (d * d).sum(axis=-1), d @ CENTRE, CENTRE @ CENTRE - RADIUS**2
    on = b * b > a * c
    depth = np.where(on, (b - np.sqrt(np.where(on, b * b - a * c, 0.0))) / a, FAR)
    return depth, on, (depth[..., None] * d - CENTRE) / RADIUS


def portrait() -> bytes:
    """The sphere's picture and depth, of 16 bits."""
    depth, on, _ = ball()
    levels = (depth - NEAR) / (FAR - NEAR)
    return gdepth_jpeg(np.where(on[..., None], PICTURE, 0.5), levels, Format="RangeLinear", **RANGE)


def test_it_gives_normals_and_mask():
    _, on, normals = ball()
    photo = load_photo(portrait(), depth="photo", near=0.6, far=2.0, fov_deg=FOV_DEG, surroundings="none")
    assert (photo.mask_source, photo.normals.origin, photo.warnings) == ("depth", "depth", ())
    assert ((photo.mask > 0.5) == on).mean() > 0.999
    known = photo.normals.values.any(axis=-1)
    error = np.degrees(np.arccos(np.clip((photo.normals.values[known] * normals[known]).sum(axis=-1), -1, 1)))
    assert (known.sum() > 0.7 * on.sum(), np.median(error) < 1.0) == (True, True)


def test_nobody_pays_for_depth_that_was_not_asked_for():
    data = gdepth_jpeg(PICTURE, LEVELS, Format="of our own", **RANGE)
    assert read_image(data).depth is None
    assert load_photo(data, mask=np.ones((HEIGHT, WIDTH), np.float32), fov_deg=FOV_DEG).normals is None


def test_a_photo_without_depth_is_told():
    plain = depth_files.jpeg(PICTURE)
    for source in (plain, (PICTURE * 255).astype(np.uint8)):
        with pytest.raises(InvalidMask, match="expected a photo whose file carries depth, .*; leave out depth"):
            load_photo(source, depth="photo", mask=np.ones((HEIGHT, WIDTH), np.float32))


def test_a_clip_carries_none():
    with refused("depth"):
        MaskFollower({}, {}, {"depth": "photo"})


def test_commands_take_the_same_word(work, command):
    (work / "a.jpg").write_bytes(portrait())
    said = command("mask", "a.jpg", "--depth", "photo", "--near", "0.6", "--far", "2")
    assert (said.status, "by depth" in said.out) == (0, True)
    (work / "plain.jpg").write_bytes(depth_files.jpeg(PICTURE))
    for name in ("mask", "estimate"):
        line = command(name, "plain.jpg", "--depth", "photo", "--near", "0.6").complaint
        assert line.startswith("anyprobe: plain.jpg: --depth: expected a photo whose file carries depth")


# Faults

FAULTS = {
    "one along the rays": lambda: gdepth_jpeg(PICTURE, LEVELS, MeasureType="OpticRay", **RANGE),
    "one of format Cubic": lambda: gdepth_jpeg(PICTURE, LEVELS, Format="Cubic", **RANGE),
    "one without Far": lambda: gdepth_jpeg(PICTURE, LEVELS, Near="1"),
    "one from 3 to 3": lambda: gdepth_jpeg(PICTURE, LEVELS, Near="3", Far="3"),
    "one from -1 to 3": lambda: gdepth_jpeg(PICTURE, LEVELS, Near="-1", Far="3"),
    "one of kind segmentation": lambda: dynamic_depth_jpeg(PICTURE, LEVELS, ItemSemantic="Segmentation", **RANGE),
    "a damaged one": lambda: gdepth_jpeg(PICTURE, LEVELS, **RANGE).replace(b"iVBORw0KGgo", b"iVBORw0KGgA"),
    "one of values from 255 to 255": lambda: apple_portrait(
        PICTURE, LEVELS, AuxiliaryImageType="depth", **{**APPLE, "IntMinValue": "255"}
    ),
    "one of values from 2 to 0.25": lambda: apple_portrait(
        PICTURE, LEVELS, AuxiliaryImageType="depth", **{**APPLE, "FloatMinValue": "2", "FloatMaxValue": "0.25"}
    ),
    "XMP that defines entities": lambda: gdepth_jpeg(PICTURE, LEVELS, **RANGE).replace(
        b'<?xpacket begin=""', b"<!DOCTYPE a><?b    "
    ),
    "one that is missing from its container": lambda: dynamic_depth_jpeg(PICTURE, LEVELS, **RANGE).replace(
        b'URI="android/depthmap"', b'URI="android/depthmop"', 1
    ),
    "one whose values are of unknown meaning": lambda: heic_with_depth(PICTURE, LEVELS, None),
    "one whose values are of unknown meaning ": lambda: heic_with_depth(PICTURE, LEVELS, OTHER_DISPARITY, 1, 2),
    "one from 4 to 0.5": lambda: heic_with_depth(PICTURE, LEVELS, INVERSE_Z, FAR, NEAR),
}


@pytest.mark.parametrize("reason", FAULTS)
def test_what_cannot_be_used_is_one_line(reason):
    if "heic" in FAULTS[reason].__code__.co_names[0]:
        pytest.importorskip("pillow_heif")
    data = FAULTS[reason]()
    with pytest.raises(InvalidMask, match=rf"^depth bytes: .*, got {reason.strip()}.*; leave out depth") as error:
        read_image(data, with_depth=True)
    assert "\n" not in str(error.value)
    assert read_image(data).rgb.shape == PICTURE.shape


@pytest.mark.parametrize("name", ["HEIC, disparity", "GDepth", "Apple's JPEG"])
def test_a_depth_map_too_large_is_not_decoded(name, monkeypatch):
    monkeypatch.setattr("anyprobe.pictures.photo_depth.MOST_PIXELS", HEIGHT * WIDTH - 1)
    assert MOST_PIXELS > 1e7
    with refused("depth", source="bytes", naming="128 x 96", kind=InvalidMask):
        read_image(made(name), with_depth=True)


def test_depth_of_another_view_is_refused():
    data = gdepth_jpeg(PICTURE, LEVELS[:, :64], Format="RangeLinear", **RANGE)
    with refused("depth"):
        load_photo(data, depth="photo", near=0.6)


def test_a_depth_image_may_come_as_bytes(tmp_path):
    """As in a request."""
    np.save(tmp_path / "d.npy", LINEAR)
    np.testing.assert_allclose(read_depth((tmp_path / "d.npy").read_bytes()), LINEAR, rtol=1e-6)
    millimetres = np.round(1000 * LINEAR).astype(np.uint16)
    np.testing.assert_array_equal(read_depth(depth_files.png(millimetres)), millimetres)
    for data in (b"", b"no depth", b"\x93NUMPY\1\0"):
        with refused("depth"):
            read_depth(data)
