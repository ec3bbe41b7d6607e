"""Pairs for WholeNet: what the estimator knows of path-traced photos of training assets, and the true light."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from PIL import Image, ImageFilter

from anyprobe.errors import AnyprobeError, InputError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.photo import crop_object, load_photo
from anyprobe.estimate.runtime import PHOTO_SIZE, lift_inputs
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import rotate
from research.world.whole_photos import WholePhoto, photograph, renders, store_of

SHOTS = 2
"""Photos of each scene: the second is another exposure of it, mirrored."""
CUT_OUTS = 0.15
"""Share of the photos of which only the object is known."""
MASK_ERRORS = 0.5
"""Share of the masks that are a pixel too wide or too narrow."""
LN_LOW = -9.0
"""Of true radiance: darker is black."""
AT_ONCE = 256
"""Scenes in a file."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Known:
    """Of one photo, in the crop's frame.

    context: [96, 96, 5] uint8 of estimate.context. tan_half: of the crop. lift: [7, 64, 128] float16, what the first
    network answers: ln radiance expected (3) and with light sources (3), and confidence. posterior: [7].
    surroundings: [4, 64, 128] uint8. truth: [3, 64, 128] float16, ln radiance. up: [3].
    """

    context: np.ndarray
    tan_half: np.ndarray
    lift: np.ndarray
    posterior: np.ndarray
    surroundings: np.ndarray
    truth: np.ndarray
    up: np.ndarray


def known_of(photo: WholePhoto, estimator: Estimator, rng: np.random.Generator, mirrored: bool, cut_out: bool) -> Known:
    """What the estimator would know of a photo."""
    picture, mask, truth = photo.picture[..., :3], (255 * photo.mask).astype(np.uint8), photo.truth
    roll_deg = photo.roll_deg
    if mirrored:
        picture, mask, truth = (np.ascontiguousarray(one[:, ::-1]) for one in (picture, mask, truth))
        roll_deg = -roll_deg
    if rng.random() < MASK_ERRORS:
        way = ImageFilter.MaxFilter(3) if rng.random() < 0.5 else ImageFilter.MinFilter(3)
        changed = np.asarray(Image.fromarray(mask).filter(way))
        mask = changed if (changed > 0).sum() > 60 else mask
    if cut_out:
        picture = picture * (mask > 0)[..., None]
    fov_deg = photo.long_fov_deg if photo.fov_known else None
    given = {"surroundings": "none"} if cut_out else {}
    loaded = load_photo(picture, mask=mask, fov_deg=fov_deg, **given)
    crop = crop_object(loaded, PHOTO_SIZE)
    values = lift_inputs(crop.image, crop.tan_half, None, crop.surroundings_map, None)
    _, drawn, confidence, _, spread, posterior = estimator.models._run["light"](*values.values())
    context = np.zeros((96, 96, 5), np.float32) if crop.context is None else crop.context
    turned = np.maximum(rotate(truth, crop.camera_from_crop.T), 0.0)
    surroundings = np.zeros((64, 128, 4), np.float32) if crop.surroundings_map is None else crop.surroundings_map
    return Known(
        context=np.round(255 * context).astype(np.uint8),
        tan_half=np.array(crop.tan_half, np.float32),
        lift=np.concatenate([spread[0], drawn[0], confidence[0]]).clip(-15, 11).astype(np.float16),
        posterior=posterior[0].astype(np.float32),
        surroundings=np.round(255 * surroundings[..., :4].transpose(2, 0, 1)).astype(np.uint8),
        truth=np.log(np.maximum(turned, np.exp(LN_LOW))).transpose(2, 0, 1).astype(np.float16),
        up=(crop.camera_from_crop.T @ up_of(photo.pitch_deg, roll_deg)).astype(np.float32),
    )


def make_pairs(data: Path, kept: Path, out: Path, scenes: int, part: str = "train", first: int = 0) -> Iterator[Path]:
    """Files in out of AT_ONCE scenes each, from number `first` on, made where they are missing; kept: of
    research.world; part: train, lamps."""
    if first % AT_ONCE or (scenes % AT_ONCE and scenes > AT_ONCE):
        raise InputError(
            f"--first {first} --scenes {scenes}: expected multiples of {AT_ONCE}, which a file holds, got others"
        )
    store, estimator = store_of(data, part), Estimator(threads=1)
    for start in range(first, scenes, AT_ONCE):
        path, last = out / f"{part}-{start:06d}.npz", min(start + AT_ONCE, scenes)
        if path.is_file():
            continue
        rows = []
        for recipe, scene, render in renders(store, part, kept, last, start):
            for shot in range(SHOTS):
                photo = photograph(recipe, scene, render, store, shot)
                rng = np.random.default_rng((int(recipe.key, 16), shot))
                try:
                    rows.append(known_of(photo, estimator, rng, shot == 1, bool(rng.random() < CUT_OUTS)))
                except AnyprobeError:  # such as an object of too few pixels
                    continue
        with atomic_path(path) as temporary, open(temporary, "wb") as stream:
            np.savez(stream, **{one.name: np.stack([getattr(row, one.name) for row in rows]) for one in fields(Known)})
        yield path
