"""The same scene photographed again: mirrored, cropped, in other tones, by another phone. Far cheaper than a scene."""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.color import to_bytes
from anyprobe.dataset.camera import SUBSAMPLINGS, compress
from anyprobe.dataset.mask_scenes.composites import ASPECTS, GREY, Scene

MIRRORED_SHARE = 0.5

CROPPED_SHARE = 0.6
"""So many retakes show a part of the photo, of another shape; the rest its whole."""

SMALLEST_CROP = 0.5
"""Sides of a crop in those of the photo."""

CLOSE_SIDES = (1.3, 2.4)
"""Side of a second look in the object's longer sides."""


SHAKEN_SHARE, SHARPENED_SHARE, JPEG_SHARE = 0.1, 0.4, 0.4

Part = tuple[float, float, float, float]
"""x, y of the upper left corner, width and height of a part of a photo, in pixels of the square."""


def retake(rng: np.random.Generator, scene: Scene, size: int, part: Part | None = None) -> Scene:
    """Another photo of the same objects, `size` pixels across, with their covers; colours keep their order.

    part: what it shows; else CROPPED_SHARE of the retakes show a random part.
    """
    bounds = scene.bounds
    if part is None and rng.random() < CROPPED_SHARE:
        part = _draw_part(rng, bounds)
    if part is None:
        top, bottom, left, right = bounds
        part = float(left), float(top), float(right - left), float(bottom - top)
    photo, covers, bounds = _crop(scene.photo, scene.covers, part, size)
    if rng.random() < MIRRORED_SHARE:
        photo, covers = photo.flip(-1), covers.flip(-1)
        bounds = (bounds[0], bounds[1], size - bounds[3], size - bounds[2])
    top, bottom, left, right = bounds
    toned = torch.full_like(photo, GREY)
    inside = photo[:, top:bottom, left:right].clip(1e-4, 1.0)
    gain = torch.from_numpy(np.exp(rng.normal(0, 0.06, 3)).astype(np.float32))[:, None, None]
    inside = (gain * inside ** float(np.exp(rng.normal(0, 0.2)))).clip(0.0, 1.0)
    toned[:, top:bottom, left:right] = _by_a_phone(rng, inside)
    return Scene(photo=toned, covers=covers, bounds=bounds)


def _by_a_phone(rng: np.random.Generator, photo: torch.Tensor) -> torch.Tensor:
    """What a phone makes of a photo [3, H, W]: contrast, saturation, sharpening, shake, noise, JPEG; some of it."""
    if rng.random() < 0.5:
        grey = photo.mean(dim=0, keepdim=True)
        photo = grey + float(rng.uniform(0.6, 1.5)) * (photo - grey)
        photo = 0.5 + float(rng.uniform(0.8, 1.3)) * (photo - 0.5)
    if rng.random() < SHAKEN_SHARE:
        photo = _shake(rng, photo)
    elif rng.random() < SHARPENED_SHARE:
        smooth = F.avg_pool2d(F.pad(photo[None], (1, 1, 1, 1), mode="replicate"), 3, 1)[0]
        photo = photo + float(rng.uniform(0.3, 1.5)) * (photo - smooth)
    if rng.random() < 0.4:
        grain = rng.standard_normal(photo.shape, np.float32) * rng.uniform(0.005, 0.05)
        photo = photo + torch.from_numpy(grain)
    photo = photo.clip(0.0, 1.0)
    if rng.random() < JPEG_SHARE:
        picture = to_bytes(photo.permute(1, 2, 0).numpy())
        stored = compress(
            np.ascontiguousarray(picture), int(rng.integers(30, 96)), SUBSAMPLINGS[rng.integers(3)]
        )
        photo = torch.from_numpy(stored).permute(2, 0, 1) / 255.0
    return photo


def _shake(rng: np.random.Generator, photo: torch.Tensor) -> torch.Tensor:
    """Motion blur along a short line of random direction."""
    reach, angle = rng.uniform(1.0, 3.5), rng.uniform(0, np.pi)
    kernel = np.zeros((7, 7), np.float32)
    for along in np.linspace(-reach, reach, 15):
        kernel[round(3 + along * np.sin(angle)), round(3 + along * np.cos(angle))] += 1 / 15
    weights = torch.from_numpy(kernel).expand(3, 1, 7, 7)
    return F.conv2d(F.pad(photo[None], (3, 3, 3, 3), mode="replicate"), weights, groups=3)[0]


def part_around(rng: np.random.Generator, box: tuple[int, int, int, int], bounds: tuple[int, ...]) -> Part:
    """What a second look at a box x0, y0, x1, y1 shows: its surroundings within the photo, not quite centred."""
    top, bottom, left, right = bounds
    x0, y0, x1, y1 = box
    longer = max(x1 - x0, y1 - y0)
    side = longer * float(np.exp(rng.uniform(np.log(CLOSE_SIDES[0]), np.log(CLOSE_SIDES[1]))))
    width, height = min(side, right - left), min(side, bottom - top)
    x, y = (
        np.array([x0 + x1, y0 + y1]) / 2 + rng.normal(0.0, 0.08 * longer, 2) - np.array([width, height]) / 2
    )
    return float(np.clip(x, left, right - width)), float(np.clip(y, top, bottom - height)), width, height


def _draw_part(rng: np.random.Generator, bounds: tuple[int, int, int, int]) -> Part:
    top, bottom, left, right = bounds
    aspect = float(rng.choice(ASPECTS))
    longest = min((right - left) / min(1.0, aspect), (bottom - top) / min(1.0, 1 / aspect))
    longer = longest * float(rng.uniform(SMALLEST_CROP, 1.0))
    width, height = longer * min(1.0, aspect), longer * min(1.0, 1 / aspect)
    return float(rng.uniform(left, right - width)), float(rng.uniform(top, bottom - height)), width, height


def _crop(
    photo: torch.Tensor, covers: torch.Tensor, part: Part, size: int
) -> tuple[torch.Tensor, torch.Tensor, tuple[int, int, int, int]]:
    """A part of the photo brought to the square's full width or height, grey beside it."""
    stored = photo.shape[-1]
    x, y, width, height = part
    inner = [max(1, round(size * side / max(width, height))) for side in (height, width)]
    finer = 2 if max(width, height) > 1.3 * size else 1  # averaged where it shrinks
    fine = [finer * side for side in inner]
    columns = (x + (torch.arange(fine[1]) + 0.5) * width / fine[1]) / stored * 2 - 1
    rows = (y + (torch.arange(fine[0]) + 0.5) * height / fine[0]) / stored * 2 - 1
    grid = torch.stack(torch.meshgrid(columns, rows, indexing="xy"), dim=-1)
    both = F.grid_sample(torch.cat([photo, covers])[None], grid[None], align_corners=False)
    both = F.avg_pool2d(both, finer)[0] if finer > 1 else both[0]
    start = (size - inner[0]) // 2, (size - inner[1]) // 2
    inside = (slice(start[0], start[0] + inner[0]), slice(start[1], start[1] + inner[1]))
    square = photo.new_full((3, size, size), GREY)
    square[(slice(None), *inside)] = both[:3]
    seen = covers.new_zeros(len(covers), size, size)
    seen[(slice(None), *inside)] = both[3:]
    return square, seen, (start[0], start[0] + inner[0], start[1], start[1] + inner[1])
