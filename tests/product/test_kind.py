"""The odds that panoramas and estimates are of places outdoors."""

from __future__ import annotations

import numpy as np

from anyprobe.cli.match import kind_doubts
from anyprobe.core.latlong import pixel_directions
from anyprobe.match.ranking import MISJUDGED, MISJUDGED_ESTIMATE, log_odds, same_kind


def place(upper: tuple[float, float, float], lower: tuple[float, float, float]) -> np.ndarray:
    """[64, 128, 3]: one colour above the horizon, another below."""
    return np.where(pixel_directions(64)[..., 1:2] > 0, upper, lower).astype(np.float32)


GRASS, ROOM = place((0.5, 0.7, 1.0), (0.15, 0.2, 0.08)), place((1.0, 0.95, 0.85), (0.3, 0.22, 0.15))


def test_a_blue_sky_over_grass_is_outdoors_and_a_bright_ceiling_is_not():
    overcast, grey = place((0.9, 0.95, 1.1), (0.1, 0.13, 0.06)), place((0.6, 0.6, 0.6), (0.3, 0.3, 0.3))
    for gain in (0.01, 1.0, 100.0):
        assert (log_odds(gain * np.stack([GRASS, overcast, ROOM, grey])) > 0).tolist() == [True, True, False, False]


def test_maps_of_the_other_kind_are_less_likely_and_none_is_excluded():
    likely = same_kind(1.0, np.array([50.0, 0.0, -50.0]))
    own, theirs = 1 - MISJUDGED_ESTIMATE, 1 - MISJUDGED
    np.testing.assert_allclose(likely, [own * theirs + (1 - own) * (1 - theirs), 0.5, 1 - likely[0]], atol=1e-6)
    np.testing.assert_allclose(same_kind(0.0, np.array([50.0, -50.0])), likely[[2, 0]], atol=1e-6)
    np.testing.assert_allclose(same_kind(None, np.array([50.0, -50.0])), 0.5)


def test_a_panorama_of_the_other_kind_is_doubted():
    wood = place((0.6, 0.4, 0.2), (0.5, 0.3, 0.15))
    cases = ((0.95, GRASS, 0), (0.05, wood, 0), (None, GRASS, 0), (0.95, wood, 1), (0.05, GRASS, 1))
    for outdoors, radiance, doubted in cases:
        assert [one.code for one in kind_doubts(outdoors, radiance, "map")] == ["match-kind"] * doubted
