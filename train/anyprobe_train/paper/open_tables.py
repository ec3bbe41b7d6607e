"""Which maps and shapes the tables of a reproduction hold."""

from collections.abc import Callable
from pathlib import Path

from anyprobe_train.dataset.asset_store import load_asset_store
from anyprobe_train.paper.settings import Setting
from anyprobe_train.paper.tables import FRAMES, Tables, build_tables, read_tables

OWN_SHAPES = 8
"""Procedural shapes of a split that has no others."""
SPLITS = {"train": ("sphere",), "test": FRAMES}
"""Tables by name, and what fills their pictures."""


def open_tables(
    data: Path | None, runs: Path, setting: Setting, split: str, report: Callable[[str], None] | None = None
) -> Tables:
    """Open one of SPLITS from runs/tables/<split>, shaded first if it is not there.

    data: folder with hdri/ and meshes/; without it all maps and shapes are procedural.
    """

    folder, training = runs / "tables" / split, split != "test"
    if not (folder / "about.json").is_file():
        store = load_asset_store(
            data,
            "train" if training else "test",
            commercial_only=training,
            procedural_maps=setting.own_maps if training or data is None else 0,
            procedural_shapes=OWN_SHAPES if data is None else 0,
            report=report,
        )
        measured = [asset for asset in store.maps.values() if asset.licence != "own"][: setting.most]
        own = [asset for asset in store.maps.values() if asset.licence == "own"]
        shapes = list(store.shapes.values())[: setting.most]
        if report is not None:
            report(f"{split}: shading {len(measured)} measured and {len(own)} procedural maps, {len(shapes)} shapes")
        build_tables(folder, setting, measured + own, shapes, SPLITS[split])
    return read_tables(folder)
