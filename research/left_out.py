"""Left out (adjective): training assets that no shipped weights learn from."""

from __future__ import annotations

from pathlib import Path

from anyprobe.errors import InputError
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store


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
