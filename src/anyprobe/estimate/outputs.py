"""Files of one photo: panorama, map, sidecar and preview, all or none, and the picture that shows a mask."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFilter, ImageFont

from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.detail.place_picture import DRAWN_ROWS, Panorama
from anyprobe.estimate.photo import Photo
from anyprobe.estimate.result import LEVEL, Light
from anyprobe.files.atomic import atomic_files
from anyprobe.light.environment import rotate
from anyprobe.masks.prompts import Point
from anyprobe.pictures.images import write_png
from anyprobe.render.spheres import sphere_images

if TYPE_CHECKING:
    from jaxtyping import Float

    from anyprobe.match.ranking import MatchedMap

SPHERES = {"diffuse": "matte", "silver": "satin", "mirror": "mirror"}
"""Names of materials by those of render.spheres."""
ROW, PANORAMA_ROW = 256, 512
_MATTE = 0.7
"""Radiance of the bright side of a matte sphere in the median row of matches."""
_SPHERE = 128
GAP = 8
CAPTION = 20
BACKGROUND, CAPTION_COLOR = (20, 20, 20), (220, 220, 220)
Captioned = tuple[str, np.ndarray]


def draw_preview(photo: Photo, light: Light, panorama: Panorama | None = None) -> Float[np.ndarray, "H W 3"]:
    """Return a display picture [H, W, 3] in [0, 1]: the panorama over photo, mask and spheres, with captions.

    The spheres share one exposure, a whole or half EV at which the matte one does not clip, 0 at most.

    Args:
        panorama: of the light; None: made here.
    """
    picture = _fit(photo.rgb, ROW)
    given: list[Captioned] = [("photo", picture), ("mask", draw_overlay(picture, _fit(photo.mask, ROW)))]
    return _sheet(light, light.panorama() if panorama is None else panorama, given)


def draw_light(light: Light) -> Float[np.ndarray, "H W 3"]:
    """Return the same sheet of a light alone."""
    return _sheet(light, light.panorama(), [])


def _sheet(light: Light, panorama: Panorama, given: list[Captioned]) -> np.ndarray:
    in_camera = panorama.radiance
    if panorama.is_level:
        in_camera = np.maximum(rotate(panorama.radiance, panorama.frame_from_camera.T), 0.0)
    spheres = sphere_images(in_camera, _SPHERE)
    ev = min(0.0, math.floor(-2 * math.log2(max(spheres["diffuse"].max(), 1e-6))) / 2)
    row = [*given]
    for name, sphere in spheres.items():
        row.append((f"{SPHERES[name]}, {_stops(ev)}", _fit(response(sphere * 2.0**ev), ROW)))
    caption = f"panorama, {'level' if panorama.is_level else 'in the frame of the camera'}, highlights compressed"
    return _captioned([[(caption, _fit(panorama.display(), PANORAMA_ROW))], row])


def draw_matches(photo: Photo, light: Light, matches: Sequence[tuple[MatchedMap, np.ndarray]]) -> np.ndarray:
    """Return a display picture [H, W, 3] in [0, 1]: photo and mask, then a row for the estimate and for each match,
    each with the photo, spheres at one exposure for all, and its map in the light's frame."""
    rows = [("estimate", light.panorama(256, frame="camera").radiance)]
    rows += [(f"{one.rank + 1}: {one.name}", radiance) for one, radiance in matches]
    drawn = [(caption, sphere_images(radiance, _SPHERE), radiance) for caption, radiance in rows]
    level = float(np.median([np.percentile(spheres["diffuse"].max(axis=-1), 90) for _, spheres, _ in drawn]))
    gain = 2.0 ** (round(2 * math.log2(_MATTE / max(level, 1e-6))) / 2)
    picture = _fit(photo.rgb, ROW)
    sheet: list[list[Captioned]] = [[("photo", picture), ("mask", draw_overlay(picture, _fit(photo.mask, ROW)))]]
    for caption, spheres, radiance in drawn:
        shown = [("photo", picture)]
        shown += [(SPHERES[name], _fit(response(sphere * gain), ROW)) for name, sphere in spheres.items()]
        sheet.append([*shown, (caption, _fit(response(radiance * gain), ROW))])
    return _captioned(sheet)


def _stops(ev: float) -> str:
    return f"{ev:+g} EV" if ev else "0 EV"


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
    image = Image.fromarray(np.round(np.clip(picture, 0, 1) * 255).astype(np.uint8))
    resized = image.resize((min(width, 4 * height), height), Image.Resampling.BICUBIC)
    return np.asarray(resized, dtype=np.float32) / 255


OUTPUT_SUFFIXES = ("_panorama.exr", "_origin.png", ".exr", ".hdr", ".json", ".png")


def write_results(
    photo: Photo,
    light: Light,
    folder: Path,
    stem: str,
    colorspace: str = "rec709",
    *,
    size: int = DRAWN_ROWS,
    frame: str = LEVEL,
) -> dict[str, Path]:
    """Write OUTPUT_SUFFIXES of a photo into folder, replacing older ones; every .exr in a colorspace of Light.save.

    Args:
        size, frame: of the panorama, see Light.panorama.
    Returns:
        What a file is ("panorama", "origin", "exr", "hdr", "json", "png") -> path.
    Raises:
        OutputError: the folder cannot be made or written; what was there stays as it was.
    """
    panorama = light.panorama(size, frame=frame)
    with atomic_files(folder) as scratch:
        panorama.save(scratch / f"{stem}_panorama.exr", colorspace=colorspace)
        panorama.save_origin(scratch / f"{stem}_origin.png")
        light.save(scratch / f"{stem}.exr", colorspace=colorspace)
        for kind in ("hdr", "json"):
            light.save(scratch / f"{stem}.{kind}")
        write_png(scratch / f"{stem}.png", draw_preview(photo, light, panorama))
    return {_kind(suffix): folder / f"{stem}{suffix}" for suffix in OUTPUT_SUFFIXES}


def _kind(suffix: str) -> str:
    """Return write_results' name of a file."""
    return suffix[1:].partition(".")[0] if suffix.startswith("_") else suffix[1:]


EDGE = (0.1, 1.0, 0.4)
OFF = (1.0, 0.15, 0.1)
BEYOND = (0.03, 0.03, 0.12)
"""Display colours of the edge and clicks on the object, of clicks beside it, of the surroundings' tint."""


def draw_overlay(rgb: np.ndarray, mask: np.ndarray, on: Sequence[Point] = (), off: Sequence[Point] = ()) -> np.ndarray:
    """Display picture [H, W, 3] of a photo [H, W, 3] and its mask [H, W], both in [0, 1]."""
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
