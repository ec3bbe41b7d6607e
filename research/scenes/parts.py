"""Which maps and shapes scenes are made of."""

from __future__ import annotations

from pathlib import Path

from anyprobe.errors import InputError
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store
from research.left_out import load_left_out

PARTS = ("train", "left-out", "test")
"""Assets that shipped weights may learn from, training assets that their licence keeps from that, and test assets."""
OWN_SHAPES = 200
"""Shapes of our own among those that are learned from."""


def store_of(data: Path, part: str) -> AssetStore:
    """Return maps and shapes of a part; InputError of an unknown one."""
    if part == "train":
        return load_asset_store(data, "train", procedural_shapes=OWN_SHAPES)
    if part == "left-out":
        return load_left_out(data)
    if part == "test":
        return load_asset_store(data, "test", commercial_only=False)
    raise InputError(f"part {part!r}: expected one of {', '.join(PARTS)}")
