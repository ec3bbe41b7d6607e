"""Clips of a real photo's object that sways before a wall, made from the photo and its mask.

The object moves by up to 20 pixels, turns by up to 5 degrees, grows and shrinks by 7 %, the camera brightens by 12 %
and darkens; two units of 255 of noise. CLIPS: before its own background, filled in where the object was; before a
bright wall; and one in which the object is turned by 90 degrees in the picture, and with it the light on it, halfway.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

FPS, SECONDS = 15, 4.0
WIDE, HIGH = 640, 480
OBJECT_PX = 290
"""Longer side of the object."""

SHIFT_PX, TURN_DEG, GROWS, BRIGHTENS, NOISE = (20.0, 8.0), 5.0, 0.07, 0.12, 2.0
HERTZ = {"x": 0.5, "y": 0.37, "turn": 0.41, "grows": 0.3, "brightens": 0.23}
WALL = 225.0
"""Display value of the bright wall, 15 more at its right."""

JUMP_S = SECONDS / 2
CLIPS = ("own background", "bright wall", "light turns")

DEVELOPED_ON = ("clay_teapot", "elephant_jug", "round_owl", "silver_hen", "018", "020")
"""The photos that the numbers of registration and filter were chosen on."""

OTHERS = ("white_fox", "mannequin", "metal_bunny", "orange_teapot", "014", "016", "025")
"""Looked at at the end."""


@dataclass(frozen=True, kw_only=True)
class Cutout:
    """A photo: rgb [H, W, 3] uint8, mask [H, W] uint8, 255 on the object, and the background behind it."""

    name: str
    rgb: np.ndarray
    mask: np.ndarray
    background: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A frame, the object's cover in it [H, W] in [0, 1], and frame_from_photo [2, 3]: x, y in pixels, a pixel's centre
    at .5."""

    time_s: float
    rgb: np.ndarray
    cover: np.ndarray
    frame_from_photo: np.ndarray


def read_cutouts(data: Path | None, only: list[str] | None = None) -> list[Cutout]:
    """The photos of DEVELOPED_ON and OTHERS that are there; without data, the one that is shipped."""
    if data is None:
        picture = Image.open(Path(__file__).parents[1] / "examples" / "vase.png")
        return [cut_out("vase", picture.convert("RGB"), picture.getchannel("A"))]
    found = []
    for name in only or (*DEVELOPED_ON, *OTHERS):
        for folder, suffix in (("photos", ".png"), ("real_masks", ".jpg")):
            if (data / folder / f"{name}{suffix}").is_file():
                mask = Image.open(data / folder / f"{name}_mask.png").convert("L")
                found.append(cut_out(name, Image.open(data / folder / f"{name}{suffix}").convert("RGB"), mask))
    return found


def cut_out(name: str, picture: Image.Image, mask: Image.Image) -> Cutout:
    """At the size that the clips have it."""
    left, top, right, bottom = mask.point(lambda v: 255 * (v > 127)).getbbox()
    share = OBJECT_PX / max(right - left, bottom - top)
    size = [max(1, round(length * share)) for length in picture.size]
    rgb, cover = (np.asarray(one.resize(size, Image.Resampling.LANCZOS)) for one in (picture, mask))
    return Cutout(name=name, rgb=rgb, mask=cover, background=_filled(rgb, cover))


def _filled(rgb: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The picture [HIGH, WIDE, 3] behind the object: what lies beside it, blurred wider the further that is."""
    apart = np.asarray(Image.fromarray(mask).resize((WIDE, HIGH), Image.Resampling.BOX)) < 3
    picture = np.asarray(Image.fromarray(rgb).resize((WIDE, HIGH), Image.Resampling.LANCZOS)).astype(np.float32)
    known = apart[..., None].astype(np.float32)
    filled, left = picture * known, 1.0 - known
    for cells in (240, 120, 60, 30, 15, 7, 3, 1):
        size = cells * 4 // 3 or 1, cells
        small = [
            np.asarray(Image.fromarray(plane).resize(size, Image.Resampling.BOX))
            for plane in np.moveaxis(np.concatenate([picture * known, known], axis=-1), -1, 0)
        ]
        wide = np.stack(
            [np.asarray(Image.fromarray(p).resize((WIDE, HIGH), Image.Resampling.BICUBIC)) for p in small], axis=-1
        )
        here = left * np.clip(4.0 * wide[..., 3:], 0.0, 1.0)
        filled += here * wide[..., :3] / np.maximum(wide[..., 3:], 1e-3)
        left = left - here
    return np.clip(filled, 0.0, 255.0).astype(np.uint8)


def frames(cutout: Cutout, clip: str, seconds: float = SECONDS) -> Iterator[Shown]:
    """The frames of a clip in order, the same whenever they are asked for."""
    rng = np.random.default_rng([CLIPS.index(clip), *cutout.name.encode()])
    background = cutout.background.astype(np.float32)
    if clip != "own background":
        background = np.full((HIGH, WIDE, 3), WALL, np.float32)
        background += np.linspace(0.0, 15.0, WIDE, dtype=np.float32)[:, None]
    rows, columns = np.nonzero(cutout.mask > 127)
    middle = np.array([(columns.min() + columns.max() + 1) / 2, (rows.min() + rows.max() + 1) / 2])
    for index in range(round(seconds * FPS)):
        time_s = index / FPS
        wave = {name: np.sin(2 * np.pi * hertz * time_s) for name, hertz in HERTZ.items()}
        angle = np.radians(TURN_DEG * wave["turn"])
        if clip == "light turns" and time_s >= JUMP_S - 1e-6:
            angle += np.pi / 2
        scale = 1.0 + GROWS * wave["grows"]
        turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        place = np.array([WIDE / 2 + SHIFT_PX[0] * wave["x"], HIGH / 2 + SHIFT_PX[1] * wave["y"]])
        matrix = np.concatenate([turn, (place - turn @ middle)[:, None]], axis=1)
        cover = _moved(cutout.mask, matrix) / np.float32(255.0)
        # as far as the mask's edge holds background: the colour there is the object's next to it
        rgb = cover[..., None] * _moved(cutout.rgb, matrix) + (1.0 - cover[..., None]) * background
        rgb = rgb * np.float32(1.0 + BRIGHTENS * wave["brightens"])
        rgb = np.round(rgb + rng.normal(0.0, NOISE, rgb.shape).astype(np.float32))
        rgb = np.clip(rgb, 0, 255).astype(np.uint8)
        yield Shown(time_s=time_s, rgb=rgb, cover=cover, frame_from_photo=matrix)


def _moved(picture: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """[HIGH, WIDE] or [HIGH, WIDE, 3] float32 of a picture, zero beside it."""
    inverse = np.linalg.inv(np.vstack([matrix, [0.0, 0.0, 1.0]]))[:2]
    image = Image.fromarray(picture).transform(
        (WIDE, HIGH), Image.Transform.AFFINE, tuple(inverse.ravel()), Image.Resampling.BICUBIC
    )
    return np.asarray(image).astype(np.float32)


def click_on(cutout: Cutout, clip: str) -> tuple[float, float]:
    """A pixel of the first frame well inside the object, as a user clicks it."""
    cover = next(frames(cutout, clip)).cover
    inside = cover > 0.5
    left = inside
    while left.any():
        inside, padded = left, np.pad(left, 1)
        left = left & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    rows, columns = np.nonzero(inside)
    return float(columns[0]), float(rows[0])
