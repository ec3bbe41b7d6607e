"""Pairs to learn from: what the estimator knows of rendered photos, and the true light. Made in files, resumable."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch

from anyprobe.errors import AnyprobeError, InputError
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.photo import inputs_of, load_photo
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import rotate
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store
from anyprobe_train.light_graph.front import Front, Given
from anyprobe_train.whole_network.families import FAMILIES
from research.left_out import load_left_out
from research.scenes.camera import TakenPhoto, mirrored, take
from research.scenes.layouts import draw_family, draw_layout
from research.scenes.render import render_layout

PARTS = ("train", "left-out", "test")
"""Assets that shipped weights may learn from, training assets that their licence keeps from that, and test assets."""
OWN_SHAPES = 200
"""Shapes of our own among those that are learned from."""
SHOTS = 2
"""Photos of each scene: the second is another camera's, in a mirror."""
CUT_OUTS = 0.25
"""Share of the photos of which only the object is known."""
IN_FILE = 64
"""Scenes in a file."""
LN_LOW = -9.0
"""Of true radiance: darker is black."""
PLAINS = (0.0, 0.0, 1.0, 0.5, 0.92)
"""Display values behind cut-outs."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Known:
    """What is known of one photo, in the crop's frame.

    image: [128, 128, 4] uint8, the crop. context: [96, 96, 5] uint8 of estimate.photo.Crop. tan_half: of the crop.
    surroundings: [4, 64, 128] uint8. truth: [3, 64, 128] float16, ln radiance. up: [3].
    family: its number; scene: the scene's.
    """

    image: np.ndarray
    context: np.ndarray
    tan_half: np.ndarray
    surroundings: np.ndarray
    truth: np.ndarray
    up: np.ndarray
    family: np.ndarray
    scene: np.ndarray


def store_of(data: Path, part: str) -> AssetStore:
    """Return maps and shapes of a part; InputError of an unknown one."""
    if part == "train":
        return load_asset_store(data, "train", procedural_shapes=OWN_SHAPES)
    if part == "left-out":
        return load_left_out(data)
    if part == "test":
        return load_asset_store(data, "test", commercial_only=False)
    raise InputError(f"part {part!r}: expected one of {', '.join(PARTS)}")


def known_of(photo: TakenPhoto, up: np.ndarray, cut_out: bool, family: int, scene: int) -> Known:
    """Return what the estimator would know of a photo; up: [3] in the camera's frame."""
    picture = photo.picture
    if cut_out:
        picture = picture * photo.mask[..., None]
    given = {"surroundings": "none"} if cut_out else {"surroundings": "photo"}
    loaded = load_photo(picture, mask=photo.mask, fov_deg=photo.long_fov_deg, **given)
    front, inputs = Front(), Given.of([torch.from_numpy(one) for one in inputs_of(loaded).values()])
    framed = front.framed(inputs)
    turn, around = framed.camera_from_crop.numpy(), front.seen(inputs, framed, framed.camera_from_crop)
    turned = np.maximum(rotate(photo.truth, turn.T), 0.0)
    return Known(
        image=np.round(255 * framed.display.permute(1, 2, 0).numpy()).astype(np.uint8),
        context=np.round(255 * (not cut_out) * front.context(inputs, framed).permute(1, 2, 0).numpy()).astype(np.uint8),
        tan_half=np.array(float(framed.tan_half), np.float32),
        surroundings=np.round(255 * (not cut_out) * around[:4].numpy()).astype(np.uint8),
        truth=np.log(np.maximum(turned, np.exp(LN_LOW))).transpose(2, 0, 1).astype(np.float16),
        up=(turn.T @ up).astype(np.float32),
        family=np.array(family),
        scene=np.array(scene),
    )


def pairs_of(part: str, number: int, store: AssetStore) -> Iterator[Known]:
    """Yield the pairs of one scene."""
    family = draw_family(part, number)
    layout = draw_layout(family, part, number, store)
    render, phone = render_layout(layout), layout.phone
    rng = np.random.default_rng((number, 17))
    for shot in range(SHOTS):
        roll = -phone.roll_deg if shot else phone.roll_deg
        photo = take(mirrored(render) if shot else render, phone.long_fov_deg, rng)
        up, cut_out = up_of(phone.pitch_deg, roll), bool(rng.random() < CUT_OUTS)
        try:
            yield known_of(photo, up, cut_out, FAMILIES.index(family), number)
        except AnyprobeError:  # such as an object of too few pixels
            continue


def make_pairs(data: Path, out: Path, first: int, last: int, every: int = 1, part: str = "train") -> Iterator[Path]:
    """Make the files of scenes first to last that are missing in out, one of `every`; yield each file's path."""
    import drjit

    store = store_of(data, part)
    gc.collect()
    gc.freeze()  # else every collection after a scene walks over all assets
    drjit.set_thread_count(1)
    for start in range(first, last, IN_FILE * every):
        path = out / f"{part}-{start:06d}.npz"
        if path.is_file():
            continue
        rows = [row for k in range(start, start + IN_FILE) for row in pairs_of(part, k, store)]
        with atomic_path(path) as temporary, open(temporary, "wb") as stream:
            np.savez(stream, **{one.name: np.stack([getattr(row, one.name) for row in rows]) for one in fields(Known)})
        yield path
