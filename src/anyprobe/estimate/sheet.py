"""Pictures that show a result: a mask, and sheets with captions of an estimate and of panoramas that match a photo."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFilter, ImageFont

from anyprobe.core import Float
from anyprobe.core.color import to_bytes
from anyprobe.core.latlong import direction_to_uv
from anyprobe.core.response import response
from anyprobe.estimate.photo import Photo
from anyprobe.light.environment import rotate
from anyprobe.masks.prompts import Point
from anyprobe.place.panorama import Panorama
from anyprobe.render.spheres import sphere_images, spheres_ev

SPHERES = {"diffuse": "matte", "silver": "satin", "mirror": "mirror"}
"""Names of materials by those of render.spheres."""
ROW, PANORAMA_ROW = 256, 512
_MATTE = 0.7
"""Radiance of the bright side of a matte sphere in the median row of matches."""
_SPHERE = 128
RING = 14
"""Radius of the ring around the dominant light [px]."""
GAP = 8
CAPTION = 20
BACKGROUND, CAPTION_COLOR = "black", "gainsboro"
Captioned = tuple[str, np.ndarray]

EDGE = (0.1, 1.0, 0.4)
OFF = (1.0, 0.15, 0.1)
BEYOND = (0.03, 0.03, 0.12)
"""Display colours of the edge and clicks on the object, of clicks beside it, of the surroundings' tint."""


def draw_overlay(rgb: np.ndarray, mask: np.ndarray, on: Sequence[Point] = (), off: Sequence[Point] = ()) -> np.ndarray:
    """Return a display picture [H, W, 3] of a photo [H, W, 3] and its mask [H, W], both in [0, 1].

    The object is as it is, its surroundings are dark, its edge is green; on, off: clicks, which are marked.
    """
    height, width = mask.shape
    weight = mask[..., None]
    picture = rgb * (0.2 + 0.8 * weight) + np.array(BEYOND) * (1 - weight)
    thickness = max(1, round(max(height, width) / 500))
    inside = Image.fromarray((mask > 0.5).astype(np.uint8))
    most, least = (inside.filter(one(2 * thickness + 1)) for one in (ImageFilter.MaxFilter, ImageFilter.MinFilter))
    picture[np.asarray(most) > np.asarray(least)] = EDGE
    y, x = np.ogrid[:height, :width]
    for points, color in ((on, EDGE), (off, OFF)):
        for column, row in points:
            distance = np.hypot(x + 0.5 - column, y + 0.5 - row) / thickness
            picture[distance < 6] = 1.0
            picture[distance < 4.5] = color
    return np.clip(picture, 0.0, 1.0).astype(np.float32)


def draw_preview(
    panorama: Panorama, photo: Photo | None = None, direction: np.ndarray | None = None
) -> Float[np.ndarray, "H W 3"]:
    """Return a display picture [H, W, 3] in [0, 1]: the panorama over photo, mask and spheres, with captions.

    The spheres share one exposure, see spheres_ev. direction: [3] towards the dominant light in the camera's frame,
    which a ring in the panorama marks.
    """
    in_camera = panorama.radiance
    if panorama.is_level:
        in_camera = np.maximum(rotate(panorama.radiance, panorama.frame_from_camera.T), 0.0)
    spheres = sphere_images(in_camera, _SPHERE)
    ev = spheres_ev(spheres["diffuse"])
    row = [] if photo is None else _photo_and_mask(photo)
    for name, sphere in spheres.items():
        row.append((f"{SPHERES[name]}, {f'{ev:+g}' if ev else 0} EV", _fit(response(sphere * 2.0**ev), ROW)))
    caption = f"panorama, {'level' if panorama.is_level else 'in the frame of the camera'}, highlights compressed"
    place = _fit(panorama.display(), PANORAMA_ROW)
    if direction is not None:
        caption += ", the ring: the dominant light"
        place = _ringed(place, panorama.frame_from_camera @ direction)
    return _captioned([[(caption, place)], row])


def _ringed(picture: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return a map's picture [H, 2H, 3] with a ring around a direction [3], black in white, over its edge too."""
    height, width = picture.shape[:2]
    column, row = direction_to_uv(direction / np.linalg.norm(direction)) * (width, height)
    canvas = Image.fromarray(to_bytes(picture))
    draw = ImageDraw.Draw(canvas)
    for left in (column - width, column, column + width):
        for radius, color, line in ((RING + 1, "white", 4), (RING, "black", 2)):
            draw.ellipse((left - radius, row - radius, left + radius, row + radius), outline=color, width=line)
    return np.asarray(canvas, np.float32) / 255


def draw_matches(photo: Photo, rows: Sequence[Captioned]) -> np.ndarray:
    """Return a display picture [H, W, 3] in [0, 1]: photo and mask, then a row for each map, with its caption.

    A row has the photo, spheres at one exposure for all, and the map. rows: maps [R, 2R, 3] in the camera's frame.
    """
    drawn = [(caption, sphere_images(radiance, _SPHERE), radiance) for caption, radiance in rows]
    level = float(np.median([np.percentile(spheres["diffuse"].max(axis=-1), 90) for _, spheres, _ in drawn]))
    gain = 2.0 ** (round(2 * math.log2(_MATTE / max(level, 1e-6))) / 2)
    given = _photo_and_mask(photo)
    sheet = [given]
    for caption, spheres, radiance in drawn:
        shown = {f"{SPHERES[name]}, {math.log2(gain):+g} EV": sphere for name, sphere in spheres.items()}
        shown[caption] = radiance
        sheet.append([*given[:1], *((text, _fit(response(one * gain), ROW)) for text, one in shown.items())])
    return _captioned(sheet)


def _photo_and_mask(photo: Photo) -> list[Captioned]:
    picture = _fit(photo.rgb, ROW)
    return [("photo", picture), ("mask", draw_overlay(picture, _fit(photo.mask, ROW)))]


def _captioned(rows: list[list[Captioned]]) -> np.ndarray:
    """Return rows of pictures, each above its caption."""
    font = ImageFont.load_default(14)
    placed, widest, top = [], 0, GAP
    for row in rows:
        left = GAP
        for text, picture in row:
            caption = _drawable(text)
            placed.append((left, top, caption, picture))
            left += max(picture.shape[1], round(font.getlength(caption))) + GAP
        widest = max(widest, left)
        top += max((len(picture) for _, picture in row), default=0) + CAPTION + GAP
    canvas = Image.new("RGB", (widest, top), BACKGROUND)
    for left, top, caption, picture in placed:
        canvas.paste(Image.fromarray(to_bytes(picture)), (left, top))
        ImageDraw.Draw(canvas).text((left, top + len(picture) + 2), caption, CAPTION_COLOR, font)
    return np.asarray(canvas, np.float32) / 255


def _drawable(text: str) -> str:
    """Return a text in ASCII, which is what Pillow's font has: letters lose their accents, others become question
    marks."""
    letters = (one for one in unicodedata.normalize("NFKD", text) if not unicodedata.combining(one))
    return "".join(one if one.isascii() and one.isprintable() else "?" for one in letters)


def _fit(picture: np.ndarray, height: int) -> np.ndarray:
    """Scale a display picture to a height, its shape kept."""
    width = max(1, round(picture.shape[1] * height / picture.shape[0]))
    size = min(width, 4 * height), height
    return np.asarray(Image.fromarray(to_bytes(picture)).resize(size, Image.Resampling.BICUBIC), dtype=np.float32) / 255
