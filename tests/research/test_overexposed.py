"""Photos exposed longer: as they were at 0 stops, clipped at many, brighter between."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from research import overexposed


@pytest.fixture
def pair(monkeypatch):
    monkeypatch.setattr(overexposed, "replace", lambda pair, photo: SimpleNamespace(photo=photo))
    grey = np.full((8, 8, 4), 100, np.uint8)
    grey[:, :4, 3] = 0
    return SimpleNamespace(photo=grey)


def test_stops_are_of_radiance_and_leave_the_mask(pair):
    shown = [overexposed.brighter(pair, stops).photo for stops in overexposed.STOPS]
    levels = [int(photo[0, 0, 0]) for photo in shown]
    assert abs(levels[0] - 100) <= 1
    assert levels == sorted(levels)
    assert levels[-1] == 255
    for photo in shown:
        np.testing.assert_array_equal(photo[..., 3], pair.photo[..., 3])
        assert photo.dtype == np.uint8
