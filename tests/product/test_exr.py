"""Colours of OpenEXR files of other programs: their channels' names and types, parts, tiles, windows, primaries."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from support.refused import refused

from anyprobe.errors import InputError
from anyprobe.maps.exr import read_exr
from anyprobe.maps.radiance import read_radiance

CASES = Path(__file__).parent / "cases"
RGB = np.random.default_rng(0).random((40, 64, 3), np.float32)
ALPHA = np.random.default_rng(1).random((40, 64), np.float32)
XYZ_FROM_RGB = np.array(
    [[0.4123908, 0.3575843, 0.1804808], [0.2126390, 0.7151687, 0.0721923], [0.0193308, 0.1191948, 0.9505322]]
)
"""ITU-R BT.709 with white D65."""


def named(pixels: np.ndarray, names) -> dict[str, np.ndarray]:
    return {name: np.ascontiguousarray(pixels[..., k]) for k, name in enumerate(names)}


def exr(channels: dict[str, np.ndarray], **header) -> bytes:
    stream = io.BytesIO()
    told = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(told, dict(channels)).write(stream)
    return stream.getvalue()


def read(data: bytes, *, rec709: bool = True) -> np.ndarray:
    return read_exr(data, "a.exr", InputError, 10**6, rec709=rec709)


@pytest.mark.parametrize(
    "names",
    ["RGB", "rgb", ("Red", "Green", "Blue"), [f"view.{c}" for c in "RGB"], [f"ViewLayer.Combined.{c}" for c in "rgb"]],
)
def test_colours_have_many_names(names):
    channels = named(RGB, names) | {"Depth.Z": ALPHA, "Normal.X": ALPHA, "Normal.Y": ALPHA, "Normal.Z": ALPHA}
    np.testing.assert_array_equal(read(exr(channels)), RGB)


def test_tristimulus_channels_are_colours():
    found = read_radiance(CASES / "map_channels_xyz.exr")
    np.testing.assert_allclose(found, read_radiance(CASES / "map_channels_rgb_reference.exr"), rtol=1e-3)
    xyz = (RGB @ XYZ_FROM_RGB.T).astype(np.float32)
    for names in ("XYZ", "xyz"):
        found = read(exr(named(xyz, names) | {"A": ALPHA}))
        np.testing.assert_allclose(found, np.dstack([RGB, ALPHA]), rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(read(exr(named(xyz, "XYZ")), rec709=False), xyz)  # normals, say


@pytest.mark.parametrize("white", [(1 / 3, 1 / 3), (0.3127, 0.3290)])
def test_primaries_that_are_the_axes_of_xyz_are_not_adapted(white):
    """R, G, B hold shares of the white's X, Y, Z."""
    x, y = white
    xyz = RGB @ XYZ_FROM_RGB.T / np.array([x / y, 1.0, (1 - x - y) / y])
    data = exr(named(xyz.astype(np.float32), "RGB"), chromaticities=(1.0, 0.0, 0.0, 1.0, 0.0, 0.0, x, y))
    np.testing.assert_allclose(read(data), RGB, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("kinds", ["eee", "fff", "efe", "III", "eIf"])
def test_halves_floats_and_whole_numbers(kinds):
    """Mixed in one file too: a whole number is its value."""
    pixels = np.round(RGB * 9)
    channels = {c: np.ascontiguousarray(pixels[..., k], kinds[k]) for k, c in enumerate("RGB")}
    np.testing.assert_array_equal(read(exr(channels)), pixels)


def test_numbers_of_cryptomatte_are_no_colours():
    numbers = named(RGB, [f"ViewLayer.CryptoObject00.{c}" for c in "rgb"])
    with refused(naming="CryptoObject00"):
        read(exr(numbers))
    np.testing.assert_array_equal(read(exr(numbers | named(1 - RGB, [f"beauty_2.{c}" for c in "RGB"]))), 1 - RGB)


@pytest.mark.parametrize("grey", [{"Y": ALPHA}, {"Y": ALPHA, "A": ALPHA}])
def test_luminance_alone_is_grey(grey):
    found = read(exr(grey))
    np.testing.assert_array_equal(found, np.repeat(ALPHA[..., None], 2 + len(grey) if len(grey) > 1 else 3, axis=-1))


def test_the_first_part_with_colours_is_the_picture():
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part(dict(header), {"Z": ALPHA}, "depth"),
        OpenEXR.Part(dict(header), named(RGB, "RGB"), "beauty"),
        OpenEXR.Part(dict(header), named(1 - RGB, "RGB"), "other"),
    ]
    stream = io.BytesIO()
    OpenEXR.File(parts).write(stream)
    np.testing.assert_array_equal(read(stream.getvalue()), RGB)
    stream = io.BytesIO()
    OpenEXR.File(parts[:1]).write(stream)
    with refused(source="a.exr", naming="got Z"):
        read(stream.getvalue())


def test_tiles_and_mipmaps(tmp_path):
    import OpenImageIO

    buffer = OpenImageIO.ImageBuf(RGB)
    buffer.set_write_tiles(16, 16)
    assert buffer.write(str(tmp_path / "tiles.exr"))
    assert OpenImageIO.ImageBufAlgo.make_texture(OpenImageIO.MakeTxTexture, buffer, str(tmp_path / "mip.exr"))
    for name in ("tiles.exr", "mip.exr"):
        np.testing.assert_array_equal(read((tmp_path / name).read_bytes()), RGB)


def windowed(x0: int, y0: int, x1: int, y1: int) -> bytes:
    corners = np.array([x0, y0], np.int32), np.array([x1, y1], np.int32)
    return exr(named(RGB, "RGB"), dataWindow=corners, displayWindow=(np.zeros(2, np.int32), np.full(2, 49, np.int32)))


@pytest.mark.parametrize("window", [(-5, 3, 58, 42), (10, -20, 73, 19), (49, 49, 112, 88), (-3, -3, 60, 36)])
def test_data_lies_in_the_display_window(window):
    x0, y0, x1, y1 = window
    data = windowed(*window)
    wide = np.zeros((300, 600, 3), np.float32)
    wide[100 + y0 : 101 + y1, 100 + x0 : 101 + x1] = RGB
    np.testing.assert_array_equal(read(data), wide[100:150, 100:150])


@pytest.mark.parametrize("window", [(200, 0, 263, 39), (-64, 0, -1, 39), (0, 50, 63, 89), (0, -40, 63, -1)])
def test_data_outside_the_display_window_is_refused(window):
    with refused(naming="outside"):
        read(windowed(*window))


@pytest.mark.parametrize("compression", ["NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"])
def test_each_compression(compression):
    smooth = np.cumsum(np.cumsum(RGB, 0), 1) / 1000
    data = exr(named(smooth, "RGB"), compression=getattr(OpenEXR, f"{compression}_COMPRESSION"))
    exact = compression in ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "B44", "B44A")  # B44 packs halves alone
    np.testing.assert_allclose(read(data), smooth, rtol=0 if exact else 0.03, atol=0 if exact else 2e-3)
