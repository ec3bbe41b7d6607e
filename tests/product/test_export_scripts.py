"""The scripts that engines run: what they do where the engine itself cannot be asked here."""

from __future__ import annotations

import re
import runpy
import sys
from unittest.mock import MagicMock

import numpy as np
import pytest

from anyprobe.export.targets import export
from anyprobe.maps.radiance import read_radiance


def map_like(value: float) -> np.ndarray:
    return np.full((8, 16, 3), value, np.float32)


class BlendersImages:
    """bpy.data.images, all packed: a file that is open is not read again, unless asked to."""

    def __init__(self):
        self.open = {}

    def load(self, path, check_existing):
        if not check_existing or path not in self.open:
            self.open[path] = BlendersImage(path)
        return self.open[path]


class BlendersImage:
    def __init__(self, path):
        self.path = path
        self.colorspace_settings = MagicMock()
        self.reload()

    def reload(self):
        self.pixels = read_radiance(self.path)


def test_blender_shows_the_new_map_when_run_again(tmp_path, monkeypatch):
    bpy = MagicMock()
    bpy.data.images = BlendersImages()
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    monkeypatch.setitem(sys.modules, "mathutils", MagicMock())
    for value in (0.25, 0.75):
        script = next(p for p in export(map_like(value), "blender", tmp_path) if p.suffix == ".py")
        runpy.run_path(str(script))
        (image,) = bpy.data.images.open.values()
        np.testing.assert_allclose(image.pixels, value)


def test_a_name_beyond_the_first_plane_is_found_again(tmp_path, monkeypatch):
    """Letters of more than 16 bits, which JSON's escapes make two of there."""
    bpy = MagicMock()
    bpy.data.images = BlendersImages()
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    monkeypatch.setitem(sys.modules, "mathutils", MagicMock())
    stem = 'sun\N{SUNRISE} "é"'
    script = next(p for p in export(map_like(0.5), "blender", tmp_path, stem) if p.suffix == ".py")
    assert runpy.run_path(str(script))["NAME"] == f"{stem}_blender"
    for target, suffix in (("three", ".js"), ("three", ".html"), ("ktx2", ".js")):
        paths = export(map_like(0.5), target, tmp_path, stem)
        text = next(p for p in paths if p.suffix == suffix).read_text(encoding="utf-8")
        assert f'NAME = "sun\N{SUNRISE} \\"é\\"_{target}";' in text


@pytest.fixture
def unity(tmp_path):
    """Apply() of Unity's component, one space between words."""
    script = next(p for p in export(map_like(0.5), "unity", tmp_path) if p.suffix == ".cs")
    text = re.sub(r"//.*", "", script.read_text())
    return " ".join(text[text.index("public void Apply()") :].split())


def test_unity_takes_the_intensity_as_linear(unity):
    """Else .198 goes through the sRGB curve and lights like .032."""
    assert "GraphicsSettings.lightsUseLinearIntensity = true;" in unity
    assert "Sun.useColorTemperature = false;" in unity


def test_unity_mirrors_the_sky_without_the_dominant_light_beside_a_sun(unity):
    assert "Texture map = Sun != null ? AmbientMap : FullMap;" in unity
    assert 'sky.SetTexture("_MainTex", map);' in unity
    sky, update = unity.index("RenderSettings.skybox = sky;"), unity.index("DynamicGI.UpdateEnvironment();")
    assert sky < update
    refused = unity[: unity.index("return;")]
    assert "if (Sun != null && FullMap != null && AmbientMap == null)" in refused
    assert "Debug.LogError(" in refused
