"""Training examples: photos with prompts as users give them, and the cover of the object meant.

Batch number k is a function of (seed, k) alone, as for pairs: a run that was killed resumes with exactly the same
scenes. Photographing a scene again is far cheaper than a new scene: mirrored, cropped, by another phone.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from anyprobe.masks.check import object_box
from anyprobe.masks.networks import SMALL_PX
from anyprobe.masks.prompts import draw_prompts
from anyprobe_train.dataset.camera import blur
from anyprobe_train.mask_network.scenes import MaskPhoto, Scene, draw_scene, photograph
from anyprobe_train.world.batch import World
from anyprobe_train.world.windows import Window

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

MIRRORED_SHARE = 0.5

PHOTO_ASPECTS = (1.0, 4 / 3, 3 / 2, 16 / 9, 3 / 4, 2 / 3, 9 / 16)

CROPPED_SHARE = 0.6
"""Share of photos that show a part of the scene, of another aspect; the rest show all of it."""

SMALLEST_CROP = 0.5
"""Smallest side of a crop [sides of the scene's photo]."""

CLOSE_SIDES = (1.3, 2.4)
"""Range of the side of a close-up [longer sides of the object]."""


MaskBatch = tuple[torch.Tensor, ...]
"""Photos [B, 3, S, S]; of each P examples: prompt channel [B, P, S, S] and the target's cover [B, P, S, S]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MaskRunConfig:
    """Settings of a run.

    seed, batch, prompts, scenes, fresh: how much is drawn, all by a seed: photos a step, each of a random scene with so
    many prompts; scenes that are kept, and how many of them are new at each step.

    name: of the run's folder; the learning rate rises over warmup steps and falls over the last cooldown share.

    small: side of the pictures in the first small_steps steps, which cost a third there and teach what an
    object is as well; the rest are at full size and teach its edge. averaged: decay of the running mean of the
    weights, which is what is exported. views: files of views of the world that the first scenes are drawn from.
    """

    seed: int = 5
    batch: int = 16
    prompts: int = 2
    scenes: int = 320
    fresh: int = 1
    name: str = "mask"
    steps: int = 9_000
    small: int = 96
    small_steps: int = 4_500
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    warmup: int = 50
    cooldown: float = 0.7
    averaged: float = 0.998
    views: int = 32


def mask_batches(world: World, config: MaskRunConfig, first: int, last: int) -> Iterator[MaskBatch]:
    """Yield the examples of steps from a first to a last: each a function of its number."""
    scenes: dict[int, Scene] = {}
    for step in range(first, last):
        begin = step * config.fresh
        wanted = range(begin, begin + config.scenes)
        scenes = {k: scenes.get(k) or draw_scene(world, config.seed, k) for k in wanted}
        rng = np.random.default_rng((config.seed, 5, step))
        photos, prompts, masks = [], [], []
        for number in rng.integers(config.scenes, size=config.batch):
            photo, asked = _examples(rng, scenes[begin + int(number)], config.prompts)
            photos.append(photo.transpose(2, 0, 1))
            prompts.append([prompt for prompt, _ in asked])
            masks.append([mask for _, mask in asked])
        yield tuple(torch.from_numpy(np.array(one, np.float32)) for one in (photos, prompts, masks))


def unasked_target(shot: MaskPhoto) -> int | None:
    """Return the object meant without a prompt: the largest cover, weighted towards the photo's centre.

    None where there is none, or where a second one weighs nearly as much.
    """
    if not len(shot.covers):
        return None
    top, bottom, left, right = shot.bounds
    size = len(shot.photo)
    weight = np.outer(_centre_weight(size, (top + bottom) / 2), _centre_weight(size, (left + right) / 2))
    scores = (shot.covers * weight).sum(axis=(1, 2))
    order = np.argsort(-scores)
    best = int(order[0])
    if shot.covers[best].sum() < MIN_TARGET_PX * (size / SMALL_PX) ** 2:
        return None
    if len(order) > 1 and scores[best] < CLEAR_LEAD * scores[order[1]]:
        return None
    return best


def _examples(
    rng: np.random.Generator, scene: Scene, count: int
) -> tuple[np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
    """Draw a photo [S, S, 3] of a scene, and `count` prompts of different kinds with their answers."""
    target, shares, part = _draw_target(rng, scene.covers), PROMPTS, scene.whole
    if target is not None and rng.random() < CLOSE_SHARE:
        shares, part = CLOSE_PROMPTS, part_around(rng, scene, target)
    else:
        target = None
        if rng.random() < CROPPED_SHARE:
            part = _draw_part(rng, scene)
    shot = photograph(rng, scene, part, SMALL_PX)
    kinds = rng.choice(list(shares), size=count, replace=False, p=list(shares.values()))
    asked = [ask(rng, shot, str(kind), target) for kind in kinds]
    if rng.random() < MIRRORED_SHARE:
        return shot.photo[:, ::-1], [(prompt[:, ::-1], cover[:, ::-1]) for prompt, cover in asked]
    return shot.photo, asked


def _draw_target(rng: np.random.Generator, covers: np.ndarray) -> int | None:
    """Draw an object large enough to be meant, large ones more often; None if there is none."""
    areas = covers.sum(axis=(1, 2))
    possible = np.flatnonzero((areas >= MIN_TARGET_PX) & (covers > 0.5).any(axis=(1, 2)))
    if not len(possible):
        return None
    return int(rng.choice(possible, p=areas[possible] ** 0.5 / (areas[possible] ** 0.5).sum()))


def ask(
    rng: np.random.Generator, shot: MaskPhoto, kind: str, target: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Draw a prompt of a kind of PROMPTS and its answer: channel [S, S], target's cover [S, S].

    A prompt "none" becomes a click where no object stands out. target: the object meant; else, or where it covers no
    pixel by half, a random one.
    """
    nothing = np.zeros((SMALL_PX, SMALL_PX), np.float32)
    if target is None or shot.covers[target].max() <= 0.5:
        target = _draw_target(rng, shot.covers)
    if target is None:
        return nothing, nothing
    if kind == "none":
        best = unasked_target(shot)
        if best is not None:
            return nothing, shot.covers[best]
        kind = "click"
    cover = shot.covers[target]
    if kind == "box":
        box = object_box(cover)
        reach = 0.08 * max(box[2] - box[0], box[3] - box[1])
        moved = np.array(box, np.float64) + rng.normal(0.0, reach, 4) + reach * np.array([-1, -1, 1, 1])
        return draw_prompts(SMALL_PX, box=np.clip(moved, 0, SMALL_PX).tolist()), cover
    on = [inside_click(rng, cover)]
    off = []
    if kind == "clicks":
        on += [inside_click(rng, cover) for _ in range(int(rng.integers(0, 3)))]
        off = [_click_beside(rng, shot, target) for _ in range(int(rng.integers(0, 3)))]
    return draw_prompts(SMALL_PX, on, off), cover


def _centre_weight(size: int, centre: float) -> np.ndarray:
    return np.exp(-0.5 * ((np.arange(size) + 0.5 - centre) / (CENTRE_SIGMA * size)) ** 2).astype(np.float32)


def inside_click(rng: np.random.Generator, cover: np.ndarray) -> tuple[float, float]:
    """Draw a point on the object, mostly well inside it."""
    inside = cover > 0.5
    if rng.random() < 0.8:
        soft = blur(cover, 3.0)
        inside = inside & (soft >= np.quantile(soft[inside], 0.4))
    return _pixel(rng, inside)


def _click_beside(rng: np.random.Generator, shot: MaskPhoto, target: int) -> tuple[float, float]:
    """Draw a point off the target: on another object, else around it, else anywhere in the photo."""
    top, bottom, left, right = shot.bounds
    photo = np.zeros(shot.photo.shape[:2], bool)
    photo[top:bottom, left:right] = True
    off = photo & (shot.covers[target] < 0.1)
    others: Sequence[int] = [i for i in range(len(shot.covers)) if i != target]
    if others and rng.random() < 0.6:
        return _pixel(rng, off & (shot.covers[int(rng.choice(others))] > 0.5), off)
    return _pixel(rng, off & (blur(shot.covers[target], 5.0) > 0.03), off)


def _pixel(rng: np.random.Generator, *choices: np.ndarray) -> tuple[float, float]:
    """Draw a pixel's centre x, y in the first choice that is not empty; the middle if all are."""
    for choice in choices:
        rows, columns = np.nonzero(choice)
        if len(rows):
            number = int(rng.integers(len(rows)))
            return float(columns[number]) + 0.5, float(rows[number]) + 0.5
    return SMALL_PX / 2, SMALL_PX / 2


def part_around(rng: np.random.Generator, scene: Scene, target: int) -> Window:
    """Draw the part that a close-up of an object shows: within the photo, not quite centred."""
    tangents, pixel = np.array(scene.frame.tangents), 2 * scene.frame.most / len(scene.radiance)
    x0, y0, x1, y1 = object_box(scene.covers[target])
    middle = np.array([x0 + x1, -y0 - y1]) / 2 * pixel + np.array([-1, 1]) * scene.frame.most
    longer = max(x1 - x0, y1 - y0) * pixel
    half = np.minimum(longer * np.exp(rng.uniform(*np.log(CLOSE_SIDES))) / 2, tangents)
    return _window(np.clip(middle + rng.normal(0.0, 0.08 * longer, 2), half - tangents, tangents - half), half)


def _draw_part(rng: np.random.Generator, scene: Scene) -> Window:
    """Draw a part of the photo."""
    tangents, aspect = np.array(scene.frame.tangents), float(rng.choice(PHOTO_ASPECTS))
    sides = np.array([min(1.0, aspect), min(1.0, 1 / aspect)])
    half = sides * (tangents / sides).min() * rng.uniform(SMALLEST_CROP, 1.0)
    return _window(rng.uniform(-1, 1, 2) * (tangents - half), half)


def _window(middle: np.ndarray, half: np.ndarray) -> Window:
    (x, y), (a, b) = middle.tolist(), half.tolist()
    return x - a, x + a, y + b, y - b
