"""Every odd or broken picture that a user may hand in."""

from __future__ import annotations

import io

import numpy as np
import OpenEXR
import pytest
from PIL import Image, ImageCms
from support.refused import assert_one_line

from anyprobe.core.response import response
from anyprobe.errors import InvalidPhoto
from anyprobe.estimate.result import Light
from anyprobe.maps.radiance import write_exr, write_hdr
from anyprobe.pictures.images import read_image, write_png

HEIGHT, WIDTH = 40, 60


@pytest.fixture
def rgb() -> np.ndarray:
    """[H, W, 3] uint8, no two corners alike."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.stack([4 * x, 6 * y, 250 - 2 * x - 3 * y], axis=-1).astype(np.uint8)


def saved(image: Image.Image, format: str = "PNG", **options) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, format=format, **options)
    return buffer.getvalue()


def write_exr_channels(path, **channels) -> None:
    OpenEXR.File(
        {"compression": OpenEXR.ZIP_COMPRESSION},
        {key: np.ascontiguousarray(value, dtype=np.float32) for key, value in channels.items()},
    ).write(str(path))


# The same picture by every way in


def test_path_bytes_pillow_and_array_agree(tmp_path, rgb):
    path = tmp_path / "photo.png"
    Image.fromarray(rgb).save(path)
    expected = rgb / np.float32(255.0)
    for source in (path, str(path), path.read_bytes(), Image.fromarray(rgb), rgb):
        pixels = read_image(source)
        assert pixels.rgb.dtype == np.float32
        assert pixels.alpha is None
        assert pixels.long_fov_deg is None
        np.testing.assert_array_equal(pixels.rgb, expected)
    assert read_image(path).name == "photo.png"
    assert read_image(rgb, name="mine").name == "mine"


@pytest.mark.parametrize("format", ["JPEG", "PNG", "WEBP", "TIFF", "BMP", "GIF", "PPM"])
def test_every_common_format_is_read(rgb, format):
    pixels = read_image(saved(Image.fromarray(rgb), format))
    assert pixels.rgb.shape == (HEIGHT, WIDTH, 3)
    assert np.abs(pixels.rgb - rgb / 255.0).mean() < 0.05


# Modes


def test_color_with_alpha_is_not_premultiplied(rgb):
    alpha = np.full((HEIGHT, WIDTH), 100, dtype=np.uint8)
    pixels = read_image(saved(Image.fromarray(np.dstack([rgb, alpha]))))
    np.testing.assert_allclose(pixels.rgb, rgb / 255.0, atol=1e-6)
    np.testing.assert_allclose(pixels.alpha, 100 / 255.0, atol=1e-6)


def test_opaque_alpha_counts_as_none(rgb):
    opaque = np.full((HEIGHT, WIDTH), 255, dtype=np.uint8)
    assert read_image(saved(Image.fromarray(np.dstack([rgb, opaque])))).alpha is None
    assert read_image(np.dstack([rgb, opaque])).alpha is None


def test_sixteen_bit_grey_is_not_clipped():
    ramp = np.linspace(0, 65535, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH).astype(np.uint16)
    for format in ("PNG", "TIFF"):
        pixels = read_image(saved(Image.fromarray(ramp), format))
        np.testing.assert_allclose(pixels.rgb[..., 0], ramp / 65535.0, atol=1e-5)


def test_palette_with_transparency(rgb):
    image = Image.fromarray(rgb).quantize(8)
    index = np.asarray(image)
    pixels = read_image(saved(image, transparency=bytes([0] + [255] * 7)))
    np.testing.assert_array_equal(pixels.alpha, (index != 0).astype(np.float32))
    palette = np.asarray(image.getpalette()[:24]).reshape(-1, 3)
    np.testing.assert_allclose(pixels.rgb, palette[index] / 255.0, atol=1e-6)


def test_cmyk_jpeg_is_not_inverted(rgb):
    pixels = read_image(saved(Image.fromarray(rgb).convert("CMYK"), "JPEG", quality=95))
    assert np.abs(pixels.rgb - rgb / 255.0).mean() < 0.02


def test_animation_gives_its_first_frame():
    frames = [Image.new("RGB", (40, 40), color) for color in ("red", "lime", "blue")]
    for format in ("GIF", "PNG", "WEBP"):
        data = saved(frames[0], format, save_all=True, append_images=frames[1:])
        pixels = read_image(data)
        np.testing.assert_allclose(pixels.rgb.mean((0, 1)), [1.0, 0.0, 0.0], atol=0.02)
        assert "several frames" in pixels.warnings[0]
    assert read_image(saved(frames[0], "PNG")).warnings == ()


# Metadata


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_rotation_is_undone(rgb, orientation):
    upright = Image.fromarray(rgb)
    undo = {
        1: None,
        2: Image.Transpose.FLIP_LEFT_RIGHT,
        3: Image.Transpose.ROTATE_180,
        4: Image.Transpose.FLIP_TOP_BOTTOM,
        5: Image.Transpose.TRANSPOSE,
        6: Image.Transpose.ROTATE_90,  # stored a quarter turn to the left of upright
        7: Image.Transpose.TRANSVERSE,
        8: Image.Transpose.ROTATE_270,
    }[orientation]
    stored = upright if undo is None else upright.transpose(undo)
    exif = Image.Exif()
    exif[0x0112] = orientation
    pixels = read_image(saved(stored, exif=exif))
    np.testing.assert_allclose(pixels.rgb, rgb / 255.0, atol=1e-6)


@pytest.mark.filterwarnings("ignore:Corrupt EXIF")
def test_damaged_exif_is_ignored(rgb):
    data = saved(Image.fromarray(rgb), "JPEG", exif=b"Exif\0\0II*\0\x08\0\0\0\xff\xff" + b"\xee" * 40)
    assert read_image(data).rgb.shape == (HEIGHT, WIDTH, 3)


def profile_with_red_and_blue_swapped() -> bytes:
    """sRGB under another name, the tags of two primaries exchanged."""
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    profile = profile.replace("sRGB".encode("utf-16-be"), "swap".encode("utf-16-be"))
    return profile.replace(b"rXYZ", b"?XYZ").replace(b"bXYZ", b"rXYZ").replace(b"?XYZ", b"bXYZ")


def test_srgb_profile_changes_nothing(rgb):
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    pixels = read_image(saved(Image.fromarray(rgb), icc_profile=profile))
    np.testing.assert_array_equal(pixels.rgb, rgb / np.float32(255.0))


@pytest.mark.parametrize("kind", ["plain", "alpha", "palette"])
def test_other_profile_is_converted(rgb, kind):
    image = Image.fromarray(rgb)
    if kind == "alpha":
        image.putalpha(77)
    if kind == "palette":
        image = image.quantize(256)
    pixels = read_image(saved(image, icc_profile=profile_with_red_and_blue_swapped()))
    np.testing.assert_allclose(pixels.rgb, rgb[..., ::-1] / 255.0, atol=0.1 if kind == "palette" else 0.02)
    assert (pixels.alpha is not None) == (kind == "alpha")


def test_damaged_or_unfitting_profile_is_ignored(rgb):
    pixels = read_image(saved(Image.fromarray(rgb), icc_profile=b"\0" * 200))
    np.testing.assert_array_equal(pixels.rgb, rgb / np.float32(255.0))
    grey = read_image(saved(Image.fromarray(rgb[..., 0]), icc_profile=profile_with_red_and_blue_swapped()))
    np.testing.assert_allclose(grey.rgb[..., 0], rgb[..., 0] / 255.0, atol=1e-6)


# Arrays


@pytest.mark.parametrize("shape", [(40, 50), (40, 50, 1), (40, 50, 3), (40, 50, 4)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, ">u2", np.float16, np.float32, np.float64])
def test_array_shapes_and_types(shape, dtype):
    top = np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1.0
    values = (np.random.default_rng(0).random(shape) * top).astype(dtype)
    pixels = read_image(values)
    assert pixels.rgb.shape == (40, 50, 3)
    assert pixels.rgb.dtype == np.float32
    assert (pixels.alpha is not None) == (shape[2:] == (4,))
    first = values if values.ndim == 2 else values[..., 0]
    np.testing.assert_allclose(pixels.rgb[..., 0], first.astype(np.float64) / top, atol=1e-6)


@pytest.mark.parametrize(
    ("values", "word"),
    [
        (np.full((40, 40, 3), 255.0), "255"),
        (np.full((40, 40, 3), -0.5), "-0.5"),
        (np.full((40, 40, 3), np.nan), "NaN"),
        (np.full((40, 40, 3), np.inf), "infinity"),
        (np.zeros((40, 40, 3), dtype=np.int64), "int64"),
        (np.zeros((40, 40, 3), dtype=bool), "bool"),
        (np.zeros((40, 40, 2)), "(40, 40, 2)"),
        (np.zeros((3, 40, 40)), "(3, 40, 40)"),
        (np.zeros(40), "(40,)"),
        (np.zeros((1, 40, 40, 3)), "(1, 40, 40, 3)"),
        (np.zeros((0, 0, 3)), "0 x 0"),
        (np.zeros((16, 40, 3)), "40 x 16"),
    ],
)
def test_unusable_array(values, word):
    with pytest.raises(InvalidPhoto) as caught:
        read_image(values)
    assert_one_line(caught, word)


def test_reading_does_not_write_to_the_callers_array():
    values = np.random.default_rng(0).random((40, 40, 3)).astype(np.float32)
    kept = values.copy()
    read_image(values).rgb[...] = 0.0
    np.testing.assert_array_equal(values, kept)


# Float EXR photos


@pytest.fixture
def radiance() -> np.ndarray:
    return (np.random.default_rng(0).random((40, 50, 3)) * 2.0).astype(np.float32)


def test_exr_photo_goes_through_the_camera(tmp_path, radiance):
    path = tmp_path / "photo.exr"
    write_exr_channels(path, R=radiance[..., 0], G=radiance[..., 1], B=radiance[..., 2])
    for source in (path, path.read_bytes()):
        pixels = read_image(source)
        np.testing.assert_allclose(pixels.rgb, response(radiance), atol=1e-6)
        assert pixels.alpha is None


def test_exr_alpha_is_divided_out(tmp_path, radiance):
    alpha = np.full((40, 50), 0.5, dtype=np.float32)
    alpha[:10] = 0.0
    write_exr_channels(tmp_path / "cut.exr", RGBA=np.dstack([radiance * alpha[..., None], alpha]))
    pixels = read_image(tmp_path / "cut.exr")
    np.testing.assert_allclose(pixels.alpha, alpha)
    np.testing.assert_allclose(pixels.rgb[10:], response(radiance[10:]), atol=1e-5)


# Writing


def test_png_round_trip(tmp_path, rgb):
    path = tmp_path / "new" / "folder" / "preview.png"
    write_png(path, rgb)
    np.testing.assert_array_equal(read_image(path).rgb, rgb / np.float32(255.0))
    write_png(path, rgb / 255.0)
    np.testing.assert_array_equal(read_image(path).rgb, rgb / np.float32(255.0))
    assert [p.name for p in path.parent.iterdir()] == ["preview.png"]


def test_written_file_has_the_usual_permissions(tmp_path, rgb):
    (tmp_path / "plain").write_bytes(b"")
    write_png(tmp_path / "preview.png", rgb)
    assert (tmp_path / "preview.png").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_symbolic_link_is_written_through(tmp_path, rgb):
    (tmp_path / "real.png").write_bytes(b"old")
    (tmp_path / "link.png").symlink_to(tmp_path / "real.png")
    write_png(tmp_path / "link.png", rgb)
    assert (tmp_path / "link.png").is_symlink()
    assert (tmp_path / "real.png").stat().st_size > 3


@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
def test_own_map_is_no_photo(tmp_path, suffix):
    path = Light(radiance=np.ones((32, 64, 3), np.float32)).save(tmp_path / f"light{suffix}")
    with pytest.raises(InvalidPhoto, match="environment map that anyprobe wrote"):
        read_image(path)
    write = write_exr if suffix == ".exr" else write_hdr
    write(tmp_path / f"other{suffix}", np.ones((32, 64, 3), np.float32))
    assert read_image(tmp_path / f"other{suffix}").rgb.shape == (32, 64, 3)
