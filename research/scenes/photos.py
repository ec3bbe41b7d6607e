"""Photos to judge by: each family under maps and with shapes that no shipped weights learned from, kept as renders."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe_train.dataset.asset_store import AssetStore
from research.scenes.camera import take
from research.scenes.layouts import FAMILIES, draw_layout
from research.scenes.parts import store_of
from research.scenes.render import render_layout
from research.world.whole_photos import WholePhoto, read_render, write_render

COUNTS = {"ground": 100, "table": 30, "things": 30, "dark": 20, "procedural": 20}
"""Photos of each family in a part."""
CUT_OUTS = 0.2
PLAINS = (1.0, 1.0, 0.5, 0.0)
QUALITY = 4
"""Times the paths of what is learned from."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Key:
    """What a photo is named by, in the place of a recipe."""

    key: str


def scene_photos(data: Path, part: str, kept: Path, families: tuple[str, ...] = FAMILIES) -> Iterator[WholePhoto]:
    """Yield the photos of a part that show their object; those that kept / scenes-part lacks are rendered and put
    there."""
    store = store_of(data, part)
    for family in families:
        for number in range(COUNTS[family]):
            photo = _photo(store, part, family, number, kept / f"scenes-{part}" / f"{family}-{number:03d}.npz")
            if photo.mask.any():
                yield photo


def _photo(store: AssetStore, part: str, family: str, number: int, path: Path) -> WholePhoto:
    layout = draw_layout(family, f"{part} photos", number, store)
    if not path.is_file():
        write_render(path, render_layout(layout, QUALITY))
    rng = np.random.default_rng((zlib.crc32(f"{part} {family}".encode()), number))
    phone = layout.phone
    taken = take(read_render(path), phone.long_fov_deg, rng)
    cut_out = ("alpha", "plain")[rng.integers(2)] if rng.random() < CUT_OUTS else ""
    picture, inside = taken.picture, taken.true_mask
    if cut_out == "alpha":
        picture = np.dstack([picture * inside[..., None], (255 * inside).astype(np.uint8)])
    elif cut_out == "plain":
        plain = np.uint8(round(255 * PLAINS[rng.integers(len(PLAINS))]))
        picture = np.where(inside[..., None], picture, plain)
    contact = phone.pixels(np.zeros(3))
    return WholePhoto(
        recipe=Key(key=path.stem),  # type: ignore[arg-type]
        picture=picture,
        mask=inside,
        truth=taken.truth,
        long_fov_deg=phone.long_fov_deg,
        fov_known=taken.long_fov_deg is not None,
        pitch_deg=phone.pitch_deg,
        roll_deg=phone.roll_deg,
        contact=(float(contact[0]), float(contact[1])),
        cut_out=cut_out,
        map_name=layout.map_name,
        shape_name=layout.shape_name,
        family=family,
    )
