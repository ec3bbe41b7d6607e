"""What the Blender extension's own process computes, without Blender."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from anyprobe.core.frames import is_rotation
from anyprobe.estimate.ground import up_of

WORKER = Path(__file__).parents[2] / "integrations" / "blender" / "light_from_photo" / "worker.py"


@pytest.fixture(scope="module")
def worker():
    spec = importlib.util.spec_from_file_location("light_from_photo_worker", WORKER)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.ci
@pytest.mark.parametrize(("pitch", "roll"), [(0, 0), (25, 0), (25, 12), (-10, -8), (90, 0)])
def test_a_camera_is_headed_as_asked_and_level_in_spite_of_its_pitch_and_roll(worker, pitch, roll):
    turn = worker.turned(30.0, up_of(pitch, roll))
    assert is_rotation(turn)
    np.testing.assert_allclose(turn @ up_of(pitch, roll), (0, 0, 1), atol=1e-9)
    ahead = turn @ (0, 0, -1)
    np.testing.assert_allclose(ahead[2], -np.sin(np.radians(pitch)), atol=1e-9)
    if pitch < 90:
        assert np.degrees(np.arctan2(-ahead[0], ahead[1])) == pytest.approx(30)


def test_a_pitch_alone_turns_about_the_picture_s_row(worker):
    """Looking down by 20 degrees towards +Y: the picture's right stays Blender's +X."""
    np.testing.assert_allclose(worker.turned(0.0, up_of(20)) @ (1, 0, 0), (1, 0, 0), atol=1e-9)
