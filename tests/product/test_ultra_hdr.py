"""Ultra HDR: written so that our own reader, and three.js's loader by its fixed places of bytes, find the light
again."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from PIL import Image

from anyprobe.export.targets import export
from anyprobe.pictures.file_parts import jpeg_pictures
from anyprobe.pictures.gain_map import find_gain_map, write_ultra_hdr


def smooth_light() -> np.ndarray:
    """[64, 128, 3] from 0.02 to 60."""
    y, x = np.mgrid[:64, :128]
    level = np.exp(-((x - 40) ** 2 + (y - 20) ** 2) / 200.0)
    return (0.02 + 60.0 * level[..., None] * np.array([1.0, 0.8, 0.5])).astype(np.float32)


def test_our_reader_finds_the_light_again(tmp_path):
    radiance = smooth_light()
    most = write_ultra_hdr(tmp_path / "a.jpg", radiance)
    assert most == pytest.approx(radiance.max(), rel=1e-4)
    data = (tmp_path / "a.jpg").read_bytes()
    with Image.open(tmp_path / "a.jpg") as picture:
        display = np.asarray(picture.convert("RGB"), np.float32) / 255
    found = find_gain_map(data)
    assert found is not None
    error = np.abs(np.log2((found.radiance(display) + 0.05) / (radiance + 0.05)))
    assert np.median(error) < 0.05
    assert error.max() < 0.5


def test_the_places_of_bytes_that_three_js_reads(tmp_path):
    """60 bytes behind the segment's length: size and offset of the first picture, 16 further those of the second, which
    counts from the byte order's mark."""
    write_ultra_hdr(tmp_path / "a.jpg", smooth_light())
    data = (tmp_path / "a.jpg").read_bytes()
    first, second = list(jpeg_pictures(data))
    at = data.index(b"MPF\0") - 2
    size, offset = struct.unpack_from("<II", data, at + 60)
    assert (size, offset) == (len(first), 0)
    size, offset = struct.unpack_from("<II", data, at + 76)
    assert data[at + 6 + offset :][:size] == second
    assert size == len(second)
    # its reader takes all up to the next marker for XMP: one must follow at once
    for picture in (first, second):
        start = picture.index(b"\xff\xe1")
        after = start + 2 + struct.unpack_from(">H", picture, start + 2)[0]
        assert picture[after] == 0xFF
        assert picture[after + 1] in (0xE0, 0xE2)


def test_the_target_says_what_it_holds(tmp_path):
    names = sorted(path.name for path in export(smooth_light(), "ultrahdr", tmp_path, "a"))
    assert names == ["a_ultrahdr.jpg", "a_ultrahdr.json"]
