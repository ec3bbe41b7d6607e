"""Mitsuba judges inserted objects: their picture, their shadow, and what the object beside them does to both."""

from __future__ import annotations

import numpy as np
import pytest
from support.judged import made_map

from anyprobe.core.frames import rotation_x
from anyprobe.files.objects import open_object
from anyprobe.light.environment import rotate
from research.inserts import SETTINGS, insert

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("mi")]

MOST = 0.03
"""Largest root mean square of differences of display values."""


@pytest.mark.parametrize(
    ("shape", "material", "place"),
    [("vase", "plastic", "room"), ("solid", "gold", "studio"), ("block", "matte", "sky")],
)
def test_an_inserted_object_looks_as_path_traced(shape, material, place, tmp_path):
    setting = SETTINGS[0]
    light = np.maximum(rotate(made_map(place), rotation_x(np.radians(setting.pitch_deg))), 0.0).astype(np.float32)
    _, (changed, *_) = insert(setting, light, open_object(shape), material, tmp_path, shape)
    assert changed < MOST
