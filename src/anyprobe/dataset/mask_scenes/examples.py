"""Training examples: photos with prompts as a user would give them, and which pixels the object meant covers.

Batch number k is a function of (seed, k) alone, as for pairs: a run that was killed
goes on with exactly the scenes it would have seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from anyprobe.dataset.camera import blur
from anyprobe.dataset.mask_scenes.augment import part_around, retake
from anyprobe.dataset.mask_scenes.composites import Scene, draw_scene
from anyprobe.dataset.mask_scenes.foregrounds import LitView, ViewSource
from anyprobe.masks.prompts import draw_prompts

SIZE = 160
"""Side of the examples' pictures: that of the mask network's input."""

CLEAR_LEAD = 1.4
"""Without a prompt the first object must weigh so much more than the second, or it would be anybody's guess."""

MIN_TARGET_PX = 60
"""Area below which an object is no target."""

CENTRE_SIGMA = 0.35
"""Of the weight around the picture's centre, in sides."""

PROMPTS = {"none": 0.45, "click": 0.25, "clicks": 0.1, "box": 0.2}
"""Shares of the kinds of prompts: nothing, a click, up to three and some beside the object, a loose box."""

CLOSE_SHARE = 0.4
"""So many photos are second looks: the object fills much of them, and there is always a prompt."""

CLOSE_PROMPTS = {"click": 0.3, "clicks": 0.15, "box": 0.55}


@dataclass(frozen=True, kw_only=True, slots=True)
class SceneConfig:
    """batch: photos a step, each a retake of a random scene, with `prompts` prompts each; scenes kept, and how many
    of them are new at each step; views kept, and how many scenes one new view serves; textures: patterns drawn at the
    start."""

    batch: int = 16
    prompts: int = 2
    scenes: int = 320
    fresh: int = 1
    views: int = 40
    scenes_per_view: int = 12
    textures: int = 240
    seed: int = 0


@dataclass(frozen=True, kw_only=True, slots=True)
class Batch:
    """photo [B, 3, S, S]; of each P examples: prompt channel [B, P, S, S] and the target's cover, mask [B, P, S, S]."""

    photo: torch.Tensor
    prompt: torch.Tensor
    mask: torch.Tensor


class SceneSource:
    """Endless batches; `batch(k)` for consecutive k is fast."""

    def __init__(self, views: ViewSource, config: SceneConfig) -> None:
        self.config, self.views = config, views
        self._views: dict[int, LitView] = {}
        self._scenes: dict[int, Scene] = {}

    @torch.no_grad()
    def batch(self, step: int) -> Batch:
        """The examples of step number `step`."""
        config = self.config
        first = step * config.fresh
        scenes = _slide(self._scenes, range(first, first + config.scenes), self._draw)
        rng = np.random.default_rng((config.seed, 5, step))
        photos, prompts, masks = [], [], []
        for which in rng.integers(len(scenes), size=config.batch):
            photo, examples = _examples(rng, scenes[which], config.prompts)
            photos.append(photo)
            prompts.append(torch.from_numpy(np.stack([prompt for prompt, _ in examples])))
            masks.append(torch.stack([mask for _, mask in examples]))
        return Batch(photo=torch.stack(photos), prompt=torch.stack(prompts), mask=torch.stack(masks))

    def _draw(self, number: int) -> Scene:
        """Scene number `number`, of one of the views then kept."""
        oldest = number // self.config.scenes_per_view
        views = _slide(self._views, range(oldest, oldest + self.config.views), self.views.view)
        rng = np.random.default_rng((self.config.seed, 2, number))
        return draw_scene(rng, views[rng.integers(len(views))], self.views.textures)


def _slide(kept: dict, wanted: range, make: Callable[[int], object]) -> list:
    """The things of the wanted numbers, made when not kept yet; the others are forgotten."""
    for number in [number for number in kept if number not in wanted]:
        del kept[number]
    for number in wanted:
        if number not in kept:
            kept[number] = make(number)
    return [kept[number] for number in wanted]


def unasked_target(scene: Scene) -> int | None:
    """The object meant without a prompt: most cover weighted towards the photo's centre.

    None where there is none, or where a second one weighs nearly as much.
    """
    top, bottom, left, right = scene.bounds
    size = scene.photo.shape[-1]
    weight = torch.from_numpy(
        np.outer(_centre_weight(size, (top + bottom) / 2), _centre_weight(size, (left + right) / 2)).astype(
            np.float32
        )
    )
    if not len(scene.covers):
        return None
    scores = (scene.covers * weight).sum(dim=(1, 2)).numpy()
    order = np.argsort(-scores)
    best = int(order[0])
    if scene.covers[best].sum() < MIN_TARGET_PX * (size / SIZE) ** 2:
        return None
    if len(order) > 1 and scores[best] < CLEAR_LEAD * scores[order[1]]:
        return None
    return best


def _examples(
    rng: np.random.Generator, scene: Scene, count: int
) -> tuple[torch.Tensor, list[tuple[np.ndarray, torch.Tensor]]]:
    """A retake's photo [3, S, S], and `count` prompts of different kinds with their answers."""
    which = _draw_target(rng, scene)
    if which is None or rng.random() >= CLOSE_SHARE:
        scene, which, shares = retake(rng, scene, SIZE), None, PROMPTS
    else:
        part = part_around(rng, cover_box(scene.covers[which]), scene.bounds)
        scene, shares = retake(rng, scene, SIZE, part), CLOSE_PROMPTS
    kinds = rng.choice(list(shares), size=count, replace=False, p=list(shares.values()))
    return scene.photo, [ask(rng, scene, str(kind), which) for kind in kinds]


def _draw_target(rng: np.random.Generator, scene: Scene) -> int | None:
    """An object large enough to be meant, large ones more often; None where there is none."""
    areas = scene.covers.sum(dim=(1, 2)).numpy() if len(scene.covers) else np.zeros(0)
    possible = np.flatnonzero(areas >= MIN_TARGET_PX)
    if not len(possible):
        return None
    return int(rng.choice(possible, p=areas[possible] ** 0.5 / (areas[possible] ** 0.5).sum()))


def ask(
    rng: np.random.Generator, scene: Scene, kind: str, which: int | None = None
) -> tuple[np.ndarray, torch.Tensor]:
    """A prompt of a kind of PROMPTS and the answer to it: channel [S, S], target's cover [S, S].

    Where there is none but no object stands out, there is a click after all.

    which: the object meant; else a random one.
    """
    if which is None:
        which = _draw_target(rng, scene)
    if which is None:
        return np.zeros((SIZE, SIZE), np.float32), torch.zeros(SIZE, SIZE)
    if kind == "none":
        best = unasked_target(scene)
        if best is not None:
            return np.zeros((SIZE, SIZE), np.float32), scene.covers[best]
        kind = "click"
    cover = scene.covers[which]
    if kind == "box":
        box = cover_box(cover)
        reach = 0.08 * max(box[2] - box[0], box[3] - box[1])
        moved = np.array(box, np.float64) + rng.normal(0.0, reach, 4) + reach * np.array([-1, -1, 1, 1])
        return draw_prompts(SIZE, box=np.clip(moved, 0, SIZE)), cover
    on = [inside_click(rng, cover)]
    off: list[tuple[float, float]] = []
    if kind == "clicks":
        on += [inside_click(rng, cover) for _ in range(int(rng.integers(0, 3)))]
        for _ in range(int(rng.integers(0, 3))):
            off.append(_click_beside(rng, scene, which))
    return draw_prompts(SIZE, on, off), cover


def cover_box(cover: torch.Tensor) -> tuple[int, int, int, int]:
    """Bounding box x0, y0, x1, y1 of cover > 0.5."""
    rows = torch.nonzero((cover > 0.5).any(dim=1)).flatten()
    columns = torch.nonzero((cover > 0.5).any(dim=0)).flatten()
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def _centre_weight(size: int, centre: float) -> np.ndarray:
    return np.exp(-0.5 * ((np.arange(size) + 0.5 - centre) / (CENTRE_SIGMA * size)) ** 2)


def inside_click(rng: np.random.Generator, cover: torch.Tensor) -> tuple[float, float]:
    """A point on the object, mostly well inside it."""
    inside = cover.numpy()
    if rng.random() < 0.8:
        soft = blur(cover, 3.0).numpy()
        inside = np.where(soft >= np.quantile(soft[inside > 0.5], 0.4), inside, 0.0)
    return _pixel(rng, inside > 0.5)


def _click_beside(rng: np.random.Generator, scene: Scene, which: int) -> tuple[float, float]:
    """A point off the target: on another object, else around it, else anywhere in the photo."""
    top, bottom, left, right = scene.bounds
    photo = np.zeros((SIZE, SIZE), bool)
    photo[top:bottom, left:right] = True
    off = photo & (scene.covers[which].numpy() < 0.1)
    others: Sequence[int] = [i for i in range(len(scene.covers)) if i != which]
    if others and rng.random() < 0.6:
        return _pixel(rng, off & (scene.covers[int(rng.choice(others))].numpy() > 0.5), off)
    near = blur(scene.covers[which], 5.0).numpy() > 0.03
    return _pixel(rng, off & near, off)


def _pixel(rng: np.random.Generator, *choices: np.ndarray) -> tuple[float, float]:
    """A random pixel's centre x, y in the first choice that is not empty; the middle if all are."""
    for choice in choices:
        rows, columns = np.nonzero(choice)
        if len(rows):
            at = int(rng.integers(len(rows)))
            return float(columns[at]) + 0.5, float(rows[at]) + 0.5
    return SIZE / 2, SIZE / 2
