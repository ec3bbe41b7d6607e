"""A guest in someone's program: NumPy's errors as the host sets them, and files as they lie on its system."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from anyprobe.pictures.images import read_image

CASES = Path(__file__).parent / "cases"


def test_a_picture_in_lab_needs_no_profile(tmp_path):
    lab = ImageCms.createProfile("LAB")
    rgb = Image.open(CASES / "plain.png").convert("RGB")
    picture = ImageCms.profileToProfile(rgb, ImageCms.createProfile("sRGB"), lab, outputMode="LAB")
    picture.save(tmp_path / "a.tif", icc_profile=ImageCms.ImageCmsProfile(lab).tobytes())
    found = read_image(tmp_path / "a.tif")
    assert found.warnings == ()
    assert np.abs(found.rgb - np.asarray(rgb) / 255).mean() < 0.02


def test_of_several_heic_pictures_the_main_one_is_used(tmp_path):
    heif = pytest.importorskip("pillow_heif")
    burst = heif.HeifFile()
    for shade in (40, 200):
        burst.add_from_pillow(Image.new("RGB", (64, 64), (shade,) * 3))
    burst.save(tmp_path / "a.heic", primary_index=1)
    found = read_image(tmp_path / "a.heic")
    assert found.rgb.mean() > 0.7
    assert "the main one" in found.warnings[0]
