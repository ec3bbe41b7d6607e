"""Scenes: photos of several objects before a background, with each object's cover of every pixel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.core.color import REC709
from anyprobe.masks.networks import PADDING_GREY
from anyprobe_train.dataset.camera import blur, draw_shot, exposure, one_photo
from anyprobe_train.mask_network.backgrounds import PhotoGrid, draw_background, draw_flat, make_window
from anyprobe_train.mask_network.foregrounds import LitView, TexturePool

SCENE_PX = 256
"""Side of a scene's photo [pixels]: parts of it are as sharp as the mask network's input."""

EMPTY_SHARE = 0.04
"""Share of scenes without any object."""

WHITE = 0.8
"""Radiance below which most photos keep 60 % of their pixels."""

REFLECTING_SHARE = 0.12
"""Share of objects on a polished surface that mirrors them."""

HARD_LIGHT = 0.6
"""Share of objects that cast a shadow of their own shape, beside the dark contact that most have."""

PHOTO_ASPECTS = (1.0, 4 / 3, 3 / 2, 16 / 9, 3 / 4, 2 / 3, 9 / 16)


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """Photo of several objects.

    photo [3, S, S] display values, grey beyond the photo's borders; covers [N, S, S] of its N objects
    as far as they are seen; bounds: the photo's rows and columns.
    """

    photo: torch.Tensor
    covers: torch.Tensor
    bounds: tuple[int, int, int, int]


def draw_scene(rng: np.random.Generator, view: LitView, textures: TexturePool, size: int = SCENE_PX) -> Scene:
    """Draw up to four objects of a view and some flat things, before a background, through a camera.

    size: side of the picture; the same numbers of rng give the same scene at any size, but for its noise.
    """
    window = make_window(size, float(np.exp(rng.uniform(np.log(0.35), np.log(1.1)))))
    picture = draw_background(rng, view, window, textures)
    bounds = _draw_bounds(rng, size)
    top, bottom, left, right = bounds
    photo_area = torch.zeros(size, size)
    photo_area[top:bottom, left:right] = 1.0

    count = 0 if rng.random() < EMPTY_SHARE else int(rng.choice([1, 2, 3, 4], p=[0.5, 0.28, 0.15, 0.07]))
    places = [_place(rng, index, bounds, size) for index in range(count)]
    places.sort(key=lambda place: place.y + place.half)  # nearer objects stand lower in the picture
    order = rng.permutation(len(view.foregrounds))[:count]
    covers: list[torch.Tensor] = []
    for place, number in zip(places, order, strict=True):
        foreground = view.foregrounds[number]
        if rng.random() < REFLECTING_SHARE:
            picture = _reflect(rng, picture, foreground, place, window)
        picture = picture * _shadows(rng, foreground, place, view, window)
        layer = _warp(foreground, place, window)
        picture = picture * (1 - layer[3]) + layer[:3]
        covers = [cover * (1 - layer[3]) for cover in covers] + [layer[3]]
    for _ in range(int(rng.choice([0, 1, 2], p=[0.75, 0.2, 0.05]))):  # in front of everything
        color, cover = draw_flat(rng, view, window, textures)
        narrow = cover.mean() < 0.06
        picture = torch.lerp(picture, color, cover * narrow)
        covers = [other * (1 - cover * narrow) for other in covers]

    seen = torch.stack(covers) * photo_area if covers else torch.zeros(0, size, size)
    shot = draw_shot(rng)
    weights = torch.tensor(REC709)[:, None, None]
    bright = (picture * weights).sum(dim=0)
    subject = seen.amax(dim=0) if covers else photo_area
    on_object = float((bright * subject).sum() / subject.sum().clip(min=1.0))
    gain = exposure(shot, on_object, view.scene_log_mean)
    if rng.random() < 0.8:  # few photos are white in half of their area
        gain = min(gain, WHITE / max(float(bright[photo_area > 0].quantile(0.6)), 1e-6))
    sharper = 0.5 if rng.random() < 0.5 else 1.0
    shot = replace(shot, blur_px=shot.blur_px * sharper * size / SCENE_PX)
    light, everywhere = (picture * gain).permute(1, 2, 0).numpy(), np.ones((size, size), bool)
    photo = torch.from_numpy(one_photo(shot, light, everywhere, light, rng)).permute(2, 0, 1) / 255
    photo = torch.where(photo_area > 0, photo, torch.tensor(PADDING_GREY))
    return Scene(photo=photo, covers=seen, bounds=bounds)


@dataclass(frozen=True, kw_only=True, slots=True)
class _Place:
    """Placement of a foreground in the photo.

    centre and half size of a foreground's window in the photo's (-1, 1), y down; flipped left to right or not.
    """

    x: float
    y: float
    half: float
    flipped: bool


def _draw_bounds(rng: np.random.Generator, size: int) -> tuple[int, int, int, int]:
    aspect = float(rng.choice(PHOTO_ASPECTS))
    height, width = round(size * min(1.0, 1 / aspect)), round(size * min(1.0, aspect))
    top, left = (size - height) // 2, (size - width) // 2
    return top, top + height, left, left + width


def _place(rng: np.random.Generator, index: int, bounds: tuple[int, int, int, int], size: int) -> _Place:
    top, bottom, left, right = bounds
    tall, wide = (bottom - top) / size, (right - left) / size
    if index == 0:
        half = float(np.exp(rng.uniform(np.log(0.2), np.log(1.15)))) * min(tall, wide)
        spread = 0.3
    else:
        half = float(np.exp(rng.uniform(np.log(0.1), np.log(0.5)))) * min(tall, wide)
        spread = 0.8
    beyond = 0.3 if rng.random() < 0.2 else 0.8  # the former are often cut by the photo's border
    room_x, room_y = max(wide - beyond * half, 0.05), max(tall - beyond * half, 0.05)
    x = float(np.clip(rng.normal(0, spread), -1, 1)) * room_x
    y = float(np.clip(rng.normal(0.1, spread), -1, 1)) * room_y
    return _Place(x=x, y=y, half=half, flipped=rng.random() < 0.5)


def _warp(foreground: torch.Tensor, place: _Place, window: PhotoGrid) -> torch.Tensor:
    """Warp a foreground [C, S, S] to its place, [C, S, S], averaging first where it shrinks."""
    side = place.half * len(window.x)
    while foreground.shape[-1] >= 2 * side and foreground.shape[-1] > 16:
        foreground = F.avg_pool2d(foreground[None], 2)[0]
    x = (window.x - place.x) / place.half * (-1 if place.flipped else 1)
    grid = torch.stack([x, (window.y - place.y) / place.half], dim=-1)
    return F.grid_sample(foreground[None], grid[None], align_corners=False)[0]


def _reflect(
    rng: np.random.Generator, picture: torch.Tensor, foreground: torch.Tensor, place: _Place, window: PhotoGrid
) -> torch.Tensor:
    """Add an object's mirror image under its foot, fainter further down."""
    rows = torch.nonzero((foreground[3] > 0.5).any(dim=1)).flatten()
    if not len(rows):
        return picture
    foot = place.y + ((int(rows[-1]) + 1) / foreground.shape[-1] * 2 - 1) * place.half
    below = replace(place, y=2 * foot - place.y)
    mirrored = _warp(foreground.flip(-2), below, window)
    strength = float(rng.uniform(0.1, 0.6)) * torch.exp(-(window.y - foot).clip(min=0) / float(rng.uniform(0.1, 0.8)))
    return picture * (1 - 0.5 * strength * mirrored[3]) + strength * mirrored[:3]


def _shadows(
    rng: np.random.Generator, foreground: torch.Tensor, place: _Place, view: LitView, window: PhotoGrid
) -> torch.Tensor:
    """Draw the factor [S, S] on what is behind an object: a dark contact, and a shadow cast to one side."""
    factor = torch.ones_like(window.x)
    rows = torch.nonzero((foreground[3] > 0.5).any(dim=1)).flatten()
    if not len(rows) or rng.random() < 0.2:
        return factor
    size = foreground.shape[-1]
    foot = place.y + ((int(rows[-1]) + 1) / size * 2 - 1) * place.half
    flat = float(np.clip(np.sin(max(view.elevation, 0.1)), 0.1, 0.9))
    middle = foreground[3, int(rows[-1]) - size // 10 : int(rows[-1]) + 1].sum(dim=0)
    across = torch.arange(size) / size * 2 - 1
    centre = float((middle * across).sum() / middle.sum().clip(min=1e-3)) * (-1 if place.flipped else 1)
    width = place.half * rng.uniform(0.3, 0.9)
    dx = (window.x - place.x - centre * place.half) / width
    dy = (window.y - foot + flat * width * 0.4) / (width * flat)
    factor = factor * (1 - float(rng.uniform(0.2, 0.85)) * torch.exp(-((dx**2 + dy**2) * 1.5)))
    if rng.random() < HARD_LIGHT:
        lean, stretch = (float(rng.uniform(-1.5, 1.5)), float(rng.uniform(0.15, 1.0) * rng.choice([-1, 1])) * flat)
        height = (window.y - foot) / stretch if abs(stretch) > 0.03 else (window.y - foot) / 0.03
        x = (window.x - place.x + lean * height) / place.half * (-1 if place.flipped else 1)
        y = (height + foot - place.y) / place.half
        shadow = F.grid_sample(foreground[None, 3:], torch.stack([x, y], -1)[None], align_corners=False)[0, 0]
        softness = float(np.exp(rng.uniform(np.log(0.7), np.log(8.0)))) / SCENE_PX
        shadow = blur(shadow, softness * len(window.x))
        factor = factor * (1 - float(rng.uniform(0.15, 0.8)) * shadow.clip(0, 1))
    return factor
