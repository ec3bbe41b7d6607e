"""Whether panoramas are taken for places indoors or outdoors."""

from __future__ import annotations

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.match.kind import is_outdoors


def place(upper: tuple[float, float, float], lower: tuple[float, float, float]) -> np.ndarray:
    """[64, 128, 3]: one colour above the horizon, another below."""
    return np.where(pixel_directions(64)[..., 1:2] > 0, upper, lower).astype(np.float32)


def test_a_blue_sky_over_grass_is_outdoors_and_a_bright_ceiling_is_not():
    assert is_outdoors(place((0.5, 0.7, 1.0), (0.15, 0.2, 0.08)))
    assert is_outdoors(place((0.9, 0.95, 1.1), (0.1, 0.13, 0.06)))  # overcast, over grass
    assert not is_outdoors(place((1.0, 0.95, 0.85), (0.3, 0.22, 0.15)))
    assert not is_outdoors(place((0.6, 0.6, 0.6), (0.3, 0.3, 0.3)))


def test_exposure_does_not_matter():
    for gain in (0.01, 100.0):
        assert is_outdoors(gain * place((0.5, 0.7, 1.0), (0.15, 0.2, 0.08)))
        assert not is_outdoors(gain * place((1.0, 0.95, 0.85), (0.3, 0.22, 0.15)))
