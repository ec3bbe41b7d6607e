"""Training examples: photos with prompts as users give them, and the cover of the object meant.

MaskBatch number k is a function of (seed, k) alone, as for pairs: a run that was killed resumes with exactly the same
scenes. Photographing a scene again is far cheaper than a new scene: mirrored, cropped, in other tones, by another
phone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.color import to_bytes
from anyprobe.masks.networks import PADDING_GREY, SMALL_PX
from anyprobe.masks.prompts import draw_prompts
from anyprobe_train.dataset.camera import SUBSAMPLINGS, blur, compress
from anyprobe_train.mask_network.composites import PHOTO_ASPECTS, Scene, draw_scene
from anyprobe_train.mask_network.foregrounds import LitView, ViewSource

CLEAR_LEAD = 1.4
"""Smallest ratio of the first object's weight to the second's at which the first is meant without a prompt."""

MIN_TARGET_PX = 60
"""Smallest area of a target [pixels]."""

CENTRE_SIGMA = 0.35
"""Standard deviation of the weight around the picture's centre [sides]."""

PROMPTS = {"none": 0.45, "click": 0.25, "clicks": 0.1, "box": 0.2}
"""Shares of the kinds of prompts: none, one click, up to three with some beside the object, a loose box."""

CLOSE_SHARE = 0.4
"""Share of photos that are close-ups of an object, which always have a prompt."""

CLOSE_PROMPTS = {"click": 0.3, "clicks": 0.15, "box": 0.55}


@dataclass(frozen=True, kw_only=True, slots=True)
class SceneConfig:
    """Number of scenes, views and prompts.

    batch: photos a step, each a retake of a random scene, with `prompts` prompts each; scenes kept, and how many
    of them are new at each step; views kept, and how many scenes one new view serves; textures: patterns drawn at the
    start.
    """

    batch: int = 16
    prompts: int = 2
    scenes: int = 320
    fresh: int = 1
    views: int = 40
    scenes_per_view: int = 12
    textures: int = 240
    seed: int = 0


@dataclass(frozen=True, kw_only=True, slots=True)
class MaskBatch:
    """MaskBatch of training examples, as tensors.

    photo [B, 3, S, S]; of each P examples: prompt channel [B, P, S, S] and the target's cover, mask [B, P, S, S].
    """

    photo: torch.Tensor
    prompt: torch.Tensor
    mask: torch.Tensor


def slide(cache: dict, numbers: range, make: Callable[[int], Any]) -> list:
    """Return the items of the wanted numbers, made unless cached; items of other numbers are dropped."""
    for number in cache.keys() - set(numbers):
        del cache[number]
    return [cache[number] if number in cache else cache.setdefault(number, make(number)) for number in numbers]


class SceneSource:
    """Endless batches; `batch(k)` for consecutive k is fast."""

    def __init__(self, views: ViewSource, config: SceneConfig) -> None:
        self.config, self.views = config, views
        self._views: dict[int, LitView] = {}
        self._scenes: dict[int, Scene] = {}

    @torch.no_grad()
    def batch(self, step: int) -> MaskBatch:
        """Make the examples of step number `step`."""
        config = self.config
        first = step * config.fresh
        scenes = slide(self._scenes, range(first, first + config.scenes), self._draw)
        rng = np.random.default_rng((config.seed, 5, step))
        photos, prompts, masks = [], [], []
        for number in rng.integers(len(scenes), size=config.batch):
            photo, examples = _examples(rng, scenes[number], config.prompts)
            photos.append(photo)
            prompts.append(torch.from_numpy(np.stack([prompt for prompt, _ in examples])))
            masks.append(torch.stack([mask for _, mask in examples]))
        return MaskBatch(photo=torch.stack(photos), prompt=torch.stack(prompts), mask=torch.stack(masks))

    def _draw(self, number: int) -> Scene:
        """Draw scene number `number`, of one of the views kept at that time."""
        oldest = number // self.config.scenes_per_view
        views = slide(self._views, range(oldest, oldest + self.config.views), self.views.view)
        rng = np.random.default_rng((self.config.seed, 2, number))
        return draw_scene(rng, views[rng.integers(len(views))], self.views.textures)


def unasked_target(scene: Scene) -> int | None:
    """Return the object meant without a prompt: the largest cover, weighted towards the photo's centre.

    None where there is none, or where a second one weighs nearly as much.
    """
    if not len(scene.covers):
        return None
    top, bottom, left, right = scene.bounds
    size = scene.photo.shape[-1]
    weight = np.outer(_centre_weight(size, (top + bottom) / 2), _centre_weight(size, (left + right) / 2))
    scores = (scene.covers * torch.from_numpy(weight.astype(np.float32))).sum(dim=(1, 2)).numpy()
    order = np.argsort(-scores)
    best = int(order[0])
    if scene.covers[best].sum() < MIN_TARGET_PX * (size / SMALL_PX) ** 2:
        return None
    if len(order) > 1 and scores[best] < CLEAR_LEAD * scores[order[1]]:
        return None
    return best


def _examples(
    rng: np.random.Generator, scene: Scene, count: int
) -> tuple[torch.Tensor, list[tuple[np.ndarray, torch.Tensor]]]:
    """Draw a retake's photo [3, S, S], and `count` prompts of different kinds with their answers."""
    target = _draw_target(rng, scene)
    if target is None or rng.random() >= CLOSE_SHARE:
        scene, target, shares = retake(rng, scene, SMALL_PX), None, PROMPTS
    else:
        part = part_around(rng, cover_box(scene.covers[target]), scene.bounds)
        scene, shares = retake(rng, scene, SMALL_PX, part), CLOSE_PROMPTS
    kinds = rng.choice(list(shares), size=count, replace=False, p=list(shares.values()))
    return scene.photo, [ask(rng, scene, str(kind), target) for kind in kinds]


def _draw_target(rng: np.random.Generator, scene: Scene) -> int | None:
    """Draw an object large enough to be meant, large ones more often; None if there is none."""
    areas = scene.covers.sum(dim=(1, 2)).numpy() if len(scene.covers) else np.zeros(0)
    possible = np.flatnonzero(areas >= MIN_TARGET_PX)
    if not len(possible):
        return None
    return int(rng.choice(possible, p=areas[possible] ** 0.5 / (areas[possible] ** 0.5).sum()))


def ask(
    rng: np.random.Generator, scene: Scene, kind: str, target: int | None = None
) -> tuple[np.ndarray, torch.Tensor]:
    """Draw a prompt of a kind of PROMPTS and its answer: channel [S, S], target's cover [S, S].

    A prompt "none" becomes a click where no object stands out. target: the object meant; else a random one.
    """
    if target is None:
        target = _draw_target(rng, scene)
    if target is None:
        return np.zeros((SMALL_PX, SMALL_PX), np.float32), torch.zeros(SMALL_PX, SMALL_PX)
    if kind == "none":
        best = unasked_target(scene)
        if best is not None:
            return np.zeros((SMALL_PX, SMALL_PX), np.float32), scene.covers[best]
        kind = "click"
    cover = scene.covers[target]
    if kind == "box":
        box = cover_box(cover)
        reach = 0.08 * max(box[2] - box[0], box[3] - box[1])
        moved = np.array(box, np.float64) + rng.normal(0.0, reach, 4) + reach * np.array([-1, -1, 1, 1])
        return draw_prompts(SMALL_PX, box=np.clip(moved, 0, SMALL_PX).tolist()), cover
    on = [inside_click(rng, cover)]
    off = []
    if kind == "clicks":
        on += [inside_click(rng, cover) for _ in range(int(rng.integers(0, 3)))]
        off = [_click_beside(rng, scene, target) for _ in range(int(rng.integers(0, 3)))]
    return draw_prompts(SMALL_PX, on, off), cover


def cover_box(cover: torch.Tensor) -> tuple[int, int, int, int]:
    """Return the bounding box x0, y0, x1, y1 of cover > 0.5."""
    rows = torch.nonzero((cover > 0.5).any(dim=1)).flatten()
    columns = torch.nonzero((cover > 0.5).any(dim=0)).flatten()
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def _centre_weight(size: int, centre: float) -> np.ndarray:
    return np.exp(-0.5 * ((np.arange(size) + 0.5 - centre) / (CENTRE_SIGMA * size)) ** 2)


def inside_click(rng: np.random.Generator, cover: torch.Tensor) -> tuple[float, float]:
    """Draw a point on the object, mostly well inside it."""
    inside = cover.numpy()
    if rng.random() < 0.8:
        soft = blur(cover, 3.0).numpy()
        inside = np.where(soft >= np.quantile(soft[inside > 0.5], 0.4), inside, 0.0)
    return _pixel(rng, inside > 0.5)


def _click_beside(rng: np.random.Generator, scene: Scene, target: int) -> tuple[float, float]:
    """Draw a point off the target: on another object, else around it, else anywhere in the photo."""
    top, bottom, left, right = scene.bounds
    photo = np.zeros((SMALL_PX, SMALL_PX), bool)
    photo[top:bottom, left:right] = True
    off = photo & (scene.covers[target].numpy() < 0.1)
    others: Sequence[int] = [i for i in range(len(scene.covers)) if i != target]
    if others and rng.random() < 0.6:
        return _pixel(rng, off & (scene.covers[int(rng.choice(others))].numpy() > 0.5), off)
    is_near = blur(scene.covers[target], 5.0).numpy() > 0.03
    return _pixel(rng, off & is_near, off)


def _pixel(rng: np.random.Generator, *choices: np.ndarray) -> tuple[float, float]:
    """Draw a pixel's centre x, y in the first choice that is not empty; the middle if all are."""
    for choice in choices:
        rows, columns = np.nonzero(choice)
        if len(rows):
            number = int(rng.integers(len(rows)))
            return float(columns[number]) + 0.5, float(rows[number]) + 0.5
    return SMALL_PX / 2, SMALL_PX / 2


MIRRORED_SHARE = 0.5

CROPPED_SHARE = 0.6
"""Share of retakes that show a part of the photo, of another aspect; the rest show all of it."""

SMALLEST_CROP = 0.5
"""Smallest side of a crop [sides of the photo]."""

CLOSE_SIDES = (1.3, 2.4)
"""Range of the side of a close-up [longer sides of the object]."""


SHAKEN_SHARE, SHARPENED_SHARE, JPEG_SHARE = 0.1, 0.4, 0.4

PhotoPart = tuple[float, float, float, float]
"""Part of a photo: x, y of the upper left corner, width and height, in pixels of the square."""


def retake(rng: np.random.Generator, scene: Scene, size: int, part: PhotoPart | None = None) -> Scene:
    """Photograph the same objects again, `size` pixels across, with their covers; colours keep their order.

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
    toned = torch.full_like(photo, PADDING_GREY)
    inside = photo[:, top:bottom, left:right].clip(1e-4, 1.0)
    gain = torch.from_numpy(np.exp(rng.normal(0, 0.06, 3)).astype(np.float32))[:, None, None]
    inside = (gain * inside ** float(np.exp(rng.normal(0, 0.2)))).clip(0.0, 1.0)
    toned[:, top:bottom, left:right] = _by_a_phone(rng, inside)
    return Scene(photo=toned, covers=covers, bounds=bounds)


def _by_a_phone(rng: np.random.Generator, photo: torch.Tensor) -> torch.Tensor:
    """Apply some of a phone's processing to a photo [3, H, W]: contrast, saturation, sharpening, shake, noise, JPEG."""
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
        stored = compress(np.ascontiguousarray(picture), int(rng.integers(30, 96)), SUBSAMPLINGS[rng.integers(3)])
        photo = torch.from_numpy(stored).permute(2, 0, 1) / 255.0
    return photo


def _shake(rng: np.random.Generator, photo: torch.Tensor) -> torch.Tensor:
    """Blur a photo along a short line of random direction."""
    reach, angle = rng.uniform(1.0, 3.5), rng.uniform(0, np.pi)
    kernel = np.zeros((7, 7), np.float32)
    for along in np.linspace(-reach, reach, 15):
        kernel[round(3 + along * np.sin(angle)), round(3 + along * np.cos(angle))] += 1 / 15
    weights = torch.from_numpy(kernel).expand(3, 1, 7, 7)
    return F.conv2d(F.pad(photo[None], (3, 3, 3, 3), mode="replicate"), weights, groups=3)[0]


def part_around(rng: np.random.Generator, box: tuple[int, int, int, int], bounds: tuple[int, ...]) -> PhotoPart:
    """Draw the window of a close-up of a box x0, y0, x1, y1: within the photo, not quite centred."""
    top, bottom, left, right = bounds
    x0, y0, x1, y1 = box
    longer = max(x1 - x0, y1 - y0)
    side = longer * float(np.exp(rng.uniform(np.log(CLOSE_SIDES[0]), np.log(CLOSE_SIDES[1]))))
    width, height = min(side, right - left), min(side, bottom - top)
    x, y = np.array([x0 + x1, y0 + y1]) / 2 + rng.normal(0.0, 0.08 * longer, 2) - np.array([width, height]) / 2
    return float(np.clip(x, left, right - width)), float(np.clip(y, top, bottom - height)), width, height


def _draw_part(rng: np.random.Generator, bounds: tuple[int, int, int, int]) -> PhotoPart:
    top, bottom, left, right = bounds
    aspect = float(rng.choice(PHOTO_ASPECTS))
    longest = min((right - left) / min(1.0, aspect), (bottom - top) / min(1.0, 1 / aspect))
    longer = longest * float(rng.uniform(SMALLEST_CROP, 1.0))
    width, height = longer * min(1.0, aspect), longer * min(1.0, 1 / aspect)
    return float(rng.uniform(left, right - width)), float(rng.uniform(top, bottom - height)), width, height


def _crop(
    photo: torch.Tensor, covers: torch.Tensor, part: PhotoPart, size: int
) -> tuple[torch.Tensor, torch.Tensor, tuple[int, int, int, int]]:
    """Crop a part of the photo and scale it to the square's full width or height, grey beside it."""
    stored = photo.shape[-1]
    x, y, width, height = part
    inner = [max(1, round(size * side / max(width, height))) for side in (height, width)]
    factor = 2 if max(width, height) > 1.3 * size else 1  # averaged where it shrinks
    sampled = [factor * side for side in inner]
    columns = (x + (torch.arange(sampled[1]) + 0.5) * width / sampled[1]) / stored * 2 - 1
    rows = (y + (torch.arange(sampled[0]) + 0.5) * height / sampled[0]) / stored * 2 - 1
    grid = torch.stack(torch.meshgrid(columns, rows, indexing="xy"), dim=-1)
    both = F.grid_sample(torch.cat([photo, covers])[None], grid[None], align_corners=False)
    both = F.avg_pool2d(both, factor)[0] if factor > 1 else both[0]
    start = (size - inner[0]) // 2, (size - inner[1]) // 2
    inside = (slice(start[0], start[0] + inner[0]), slice(start[1], start[1] + inner[1]))
    square = photo.new_full((3, size, size), PADDING_GREY)
    square[(slice(None), *inside)] = both[:3]
    seen = covers.new_zeros(len(covers), size, size)
    seen[(slice(None), *inside)] = both[3:]
    return square, seen, (start[0], start[0] + inner[0], start[1], start[1] + inner[1])
