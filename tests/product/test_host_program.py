"""A guest in someone's program: NumPy's errors as the host sets them, and files as they lie on its system."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from anyprobe.export.targets import TARGETS, export
from anyprobe.files.objects import draw_under
from anyprobe.pictures.images import read_image

CASES = Path(__file__).parent / "cases"


def test_numpy_s_errors_may_be_exceptions(estimator, tmp_path):
    with np.errstate(all="raise"):
        for name in ("cicp_pq.png", "ball_c.exr", "light_probe.hdr", "exif.jxl", "rgb16_ramp.jp2", "lga.png"):
            read_image(CASES / name)
        light = estimator(CASES / "plain.png", mask=CASES / "plain_mask.png")
        light.dominant_light()
        light.panorama()
        light.save(tmp_path / "light.exr")
        for target in TARGETS:
            export(light.radiance, target, tmp_path / target)
        for material in ("gold", "matte", "mirror"):
            draw_under(light.radiance, "sphere", material, size=64)


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


def test_an_animated_picture_is_not_still(tmp_path):
    pytest.importorskip("av")
    from anyprobe.video.pyav import _not_opened

    frames = [Image.new("RGB", (48, 32), (shade, 0, 0)) for shade in (0, 200)]
    frames[0].save(tmp_path / "a.webp", save_all=True, append_images=frames[1:])
    frames[0].save(tmp_path / "b.webp")
    assert "animated" in str(_not_opened(tmp_path / "a.webp"))
    assert "still picture" in str(_not_opened(tmp_path / "b.webp"))
