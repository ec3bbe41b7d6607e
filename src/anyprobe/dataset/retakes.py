"""The same scene photographed again: mirrored, cropped, in other tones. Far cheaper than another scene."""

from __future__ import annotations

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.dataset.scenes import ASPECTS, GREY, Scene

MIRRORED_SHARE = 0.5

CROPPED_SHARE = 0.6
"""So many retakes show a part of the photo, of another shape; the rest its whole."""

SMALLEST_CROP = 0.45
"""Sides of a crop in those of the photo."""

CLOSE_SIDES = (1.3, 2.4)
"""Side of a second look in the object's longer sides."""


Part = tuple[float, float, float, float]
"""x, y of the upper left corner, width and height of a part of a photo, in pixels of the square."""


def retake(rng: np.random.Generator, scene: Scene, part: Part | None = None) -> Scene:
    """Another photo of the same objects, with their covers; colours keep their order.

    part: what it shows; else CROPPED_SHARE of the retakes show a random part.
    """
    photo, covers, bounds = scene.photo, scene.covers, scene.bounds
    size = photo.shape[-1]
    if part is None and rng.random() < CROPPED_SHARE:
        part = _draw_part(rng, bounds)
    if part is not None:
        photo, covers, bounds = _crop(photo, covers, part)
    if rng.random() < MIRRORED_SHARE:
        photo, covers = photo.flip(-1), covers.flip(-1)
        bounds = (bounds[0], bounds[1], size - bounds[3], size - bounds[2])
    top, bottom, left, right = bounds
    toned = torch.full_like(photo, GREY)
    inside = photo[:, top:bottom, left:right].clip(1e-4, 1.0)
    gain = torch.from_numpy(np.exp(rng.normal(0, 0.06, 3)).astype(np.float32))[:, None, None]
    toned[:, top:bottom, left:right] = (gain * inside ** float(np.exp(rng.normal(0, 0.2)))).clip(0.0, 1.0)
    return Scene(photo=toned, covers=covers, uniform=scene.uniform, bounds=bounds)


def part_surroundings(
    rng: np.random.Generator, box: tuple[int, int, int, int], bounds: tuple[int, ...]
) -> Part:
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
    photo: torch.Tensor, covers: torch.Tensor, part: Part
) -> tuple[torch.Tensor, torch.Tensor, tuple[int, int, int, int]]:
    """A part of the photo brought to the square's full width or height, grey beside it."""
    size = photo.shape[-1]
    x, y, width, height = part
    inner = [max(1, round(size * side / max(width, height))) for side in (height, width)]
    columns = (x + (torch.arange(inner[1]) + 0.5) * width / inner[1]) / size * 2 - 1
    rows = (y + (torch.arange(inner[0]) + 0.5) * height / inner[0]) / size * 2 - 1
    grid = torch.stack(torch.meshgrid(columns, rows, indexing="xy"), dim=-1)
    both = F.grid_sample(torch.cat([photo, covers])[None], grid[None], align_corners=False)[0]
    start = (size - inner[0]) // 2, (size - inner[1]) // 2
    inside = (slice(start[0], start[0] + inner[0]), slice(start[1], start[1] + inner[1]))
    square = torch.full_like(photo, GREY)
    square[(slice(None), *inside)] = both[:3]
    seen = torch.zeros_like(covers)
    seen[(slice(None), *inside)] = both[3:]
    return square, seen, (start[0], start[0] + inner[0], start[1], start[1] + inner[1])
