"""Left out (adjective): training assets that no shipped weights learn from, and pairs of them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from anyprobe.errors import InputError
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.dataset.recipe import balanced_recipes, world_recipes
from research.kept_pairs import kept_pairs

PAIRS = 240
SEED = 78
WORLD_PAIRS = 200


def load_left_out(data: Path) -> AssetStore:
    """The training assets whose licence keeps shipped weights from learning of them: to choose by, not to learn from.

    Maps with made-up light sources are not among them: choosing by them would favour the same invention.

    Raises:
        InputError: there are none.
    """
    everything, learned = (load_asset_store(data, "train", commercial_only=only) for only in (False, True))
    maps = [asset for key, asset in everything.maps.items() if key not in learned.maps and not asset.lifted]
    shapes = [asset for key, asset in everything.shapes.items() if key not in learned.shapes]
    if not maps or not shapes:
        raise InputError(
            f"expected maps and shapes that shipped weights do not learn from, "
            f"got {len(maps)} maps and {len(shapes)} shapes; leave the calibration out",
            source=data,
        )
    return AssetStore(maps, shapes)


def left_out_pairs(data: Path, kept: Path | None = None, conditions: int = 0) -> Iterable[Pair]:
    """Pairs of the training assets that no shipped weights learn from; InputError where there are none.

    conditions: 0 for clean photos, 1 as the world gives them.
    """
    store = load_left_out(data)
    return kept_pairs(balanced_recipes(store, PAIRS, SEED, conditions), store, kept)


def left_out_world_pairs(data: Path, kept: Path | None = None) -> Iterable[Pair]:
    """The same under dataset.distributions, looked up rather than path-traced."""
    store = load_left_out(data)
    return kept_pairs(world_recipes(store, WORLD_PAIRS, SEED), store, kept)
