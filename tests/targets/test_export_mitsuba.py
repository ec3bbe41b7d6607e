"""Mitsuba 3 loads the exported scene: its emitter, direction by direction, and its picture."""

from __future__ import annotations

import numpy as np
import pytest
from support.two_phase import assert_same_way_round, probe_directions, two_phase

from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.export.targets import export

pytestmark = pytest.mark.slow


def scene_of(mi, radiance, folder):
    paths = export(radiance, "mitsuba", folder, "two phase")
    return mi.load_file(str(next(path for path in paths if path.suffix == ".xml")), spp=4)


def test_emitter_is_turned_or_mirrored(mi, tmp_path):
    radiance = two_phase(64)
    scene = scene_of(mi, radiance, tmp_path)
    d = probe_directions(200)
    at = mi.SurfaceInteraction3f()
    at.wi = mi.Vector3f(*(-d.T))  # it comes from there
    seen = np.array(scene.environment().eval(at)).T
    assert_same_way_round(seen, d, degrees=0.5)
    np.testing.assert_allclose(seen, bilinear(radiance, direction_to_uv(d)), atol=2e-3)


def test_picture_shows_the_front_behind_the_spheres(mi, tmp_path):
    """The camera looks along -Z: the picture's corners are our map's front, left is left."""
    scene = scene_of(mi, two_phase(64), tmp_path)
    picture = np.array(mi.render(scene, spp=4))
    height, width = picture.shape[:2]
    tan = np.tan(np.radians(13))
    for row, column in [(5, 5), (5, width - 6), (height - 6, 5), (height - 6, width - 6)]:
        y = (1 - 2 * (row + 0.5) / height) * tan
        x = (2 * (column + 0.5) / width - 1) * tan * width / height
        d = np.array([[x, y, -1.0]])
        d /= np.linalg.norm(d)
        assert_same_way_round(picture[row, column][None], d, degrees=1)


def test_furnace(mi, tmp_path):
    """White spheres vanish in even light, but for what the rough metal of 0.8 takes."""
    scene = scene_of(mi, np.ones((16, 32, 3), np.float32), tmp_path)
    picture = np.array(mi.render(scene, spp=16))
    np.testing.assert_allclose(np.median(picture), 1, atol=0.01)
    assert picture[90, 102].mean() == pytest.approx(1, abs=0.05)  # the matt one
    assert picture[90, 378].mean() == pytest.approx(1, abs=0.05)  # the mirror
