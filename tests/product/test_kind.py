"""Whether panoramas and photos are taken for places indoors or outdoors."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anyprobe.core.camera import PinholeCamera
from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.fit_warnings import kind_doubts
from anyprobe.match.kind import is_outdoors, photo_outdoors, prices
from anyprobe.match.library import Library
from anyprobe.notices import Notice
from anyprobe.place.plate import keep_plate


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


GRASS, ROOM = place((0.5, 0.7, 1.0), (0.15, 0.2, 0.08)), place((1.0, 0.95, 0.85), (0.3, 0.22, 0.15))


def test_a_photo_of_one_colour_behind_its_object_is_a_studios_and_a_cut_out_says_nothing():
    assert photo_outdoors(None, [Notice("plain", code="plain-backdrop")]) is False
    assert photo_outdoors(None, [Notice("dark", code="object-dark")]) is None
    mask = np.zeros((60, 80), np.float32)
    mask[20:40, 30:50] = 1
    for color, outdoors in (((0.2, 0.5, 0.1), True), ((0.5, 0.4, 0.3), False)):
        rgb = np.broadcast_to(np.float32(color), (60, 80, 3))
        assert photo_outdoors(keep_plate(rgb, mask, PinholeCamera.of_fov(80, 60, 40.0)), []) is outdoors


def test_panoramas_of_the_other_kind_cost_more():
    maps = np.stack([GRASS[::2, ::2], ROOM[::2, ::2]])
    none = np.zeros(2)
    library = Library(
        path=Path("maps.zip"),
        names=("a", "b"),
        features=none,
        richness=none,
        lights=maps,
        levels=none,
        files=(Path("a"), Path("b")),
    )
    assert prices(False, library, 0.5).tolist() == [0.5, 0.0]
    assert prices(True, library, 0.5).tolist() == [0.0, 0.5]
    assert prices(None, library, 0.5).tolist() == [0.0, 0.0]


def test_a_panorama_outdoors_is_doubted_unless_the_photo_is():
    assert kind_doubts(True, GRASS, "map") == []
    assert kind_doubts(False, ROOM, "map") == kind_doubts(None, ROOM, "map") == []
    for outdoors, radiance, words in (
        (False, GRASS, "neither sky nor plants"),
        (None, GRASS, "nothing of its place"),
        (True, ROOM, "looks indoors"),
    ):
        (doubt,) = kind_doubts(outdoors, radiance, "map")
        assert doubt.code == "match-kind"
        assert words in doubt
