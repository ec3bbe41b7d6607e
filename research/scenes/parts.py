"""Which maps and shapes scenes are made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anyprobe.errors import InputError
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store
from anyprobe_train.dataset.catalog import normalize_map
from anyprobe_train.world.lights import LIGHT_ROWS, draw_light
from anyprobe_train.world.maps import Maps, open_maps
from research.left_out import load_left_out

PARTS = ("train", "left-out", "test")
"""Assets that shipped weights may learn from, training assets that their licence keeps from that, and test assets."""
OWN_SHAPES = 200
"""Shapes of our own among those that are learned from."""


class VariedStore(AssetStore):
    """Training assets whose lights are drawn as the fast world draws them: joined, stretched, their sources moved."""

    def __init__(self, store: AssetStore, lights: Maps) -> None:
        super().__init__(store.maps.values(), store.shapes.values())
        self.lights = lights

    def light(self, rng: np.random.Generator, kind: str) -> tuple[str, np.ndarray]:
        """Return the name of a light's first map and the light [256, 512, 3]; kind: of world.lights.draw_light."""
        drawn = draw_light(rng, self.lights, kind)
        radiance = drawn.sky[: 2 * LIGHT_ROWS**2].reshape(LIGHT_ROWS, 2 * LIGHT_ROWS, 3)
        return drawn.name, normalize_map(radiance.astype(np.float32))


def store_of(data: Path, part: str, cache: Path | None = None) -> AssetStore:
    """Return maps and shapes of a part; InputError of an unknown one.

    cache: folder of the fast world's maps; with it training lights are varied.
    """
    if part == "train":
        store = load_asset_store(data, "train", procedural_shapes=OWN_SHAPES)
        return store if cache is None else VariedStore(store, open_maps(data, cache, "train"))
    if part == "left-out":
        return load_left_out(data)
    if part == "test":
        return load_asset_store(data, "test", commercial_only=False)
    raise InputError(f"part {part!r}: expected one of {', '.join(PARTS)}")
