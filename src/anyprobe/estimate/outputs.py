"""What one photo leaves on disk: .exr, .hdr, .json and .png, all four or none, and the picture that shows a mask."""

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
from anyprobe.estimate.photo import Photo
from anyprobe.estimate.result import Light
from anyprobe.files.atomic import atomic_files
from anyprobe.files.images import write_png
from anyprobe.masks.prompts import Point
from anyprobe.render.spheres import sphere_images

if TYPE_CHECKING:
    from jaxtyping import Float

    from anyprobe.detail.matching import MatchedMap

EXPOSURES_EV = (-2.0, 0.0, 2.0)
SPHERES = {"diffuse": "matte", "silver": "silver", "mirror": "mirror"}
ROW = 256
_SPHERE = 128
GAP = 8
CAPTION = 20
BACKGROUND, CAPTION_COLOR = (20, 20, 20), (220, 220, 220)
Captioned = tuple[str, np.ndarray]


def draw_preview(photo: Photo, light: Light) -> Float[np.ndarray, "H W 3"]:
    """Display picture [H, W, 3] in [0, 1]: photo | its mask | spheres over the map at three exposures, with captions.

    The spheres share one exposure, a whole or half EV at which the matte one does not clip, 0 at most.
    """
    picture = _fit(photo.rgb, ROW)
    first: list[Captioned] = [("photo", picture), ("mask", draw_overlay(picture, _fit(photo.mask, ROW)))]
    spheres = sphere_images(light.radiance, _SPHERE)
    ev = min(0.0, math.floor(-2 * math.log2(max(spheres["diffuse"].max(), 1e-6))) / 2)
    for name, sphere in spheres.items():
        first.append((f"{SPHERES[name]}, {_stops(ev)}", _fit(response(sphere * 2.0**ev), ROW)))
    maps = [(f"map, {_stops(ev)}", _fit(response(light.radiance * 2.0**ev), ROW)) for ev in EXPOSURES_EV]
    return _captioned([first, maps])


def draw_matches(photo: Photo, light: Light, matches: Sequence[tuple[MatchedMap, np.ndarray]]) -> np.ndarray:
    """Display picture [H, W, 3] in [0, 1]: photo, then a row for the estimate and for each match with its map in the
    light's frame: spheres, all at one exposure, and the map."""
    rows = [("estimate", light.radiance)]
    rows += [(f"{one.rank + 1}: {one.name}", radiance) for one, radiance in matches]
    drawn = [(caption, sphere_images(radiance, _SPHERE), radiance) for caption, radiance in rows]
    brightest = max(spheres["diffuse"].max() for _, spheres, _ in drawn)
    gain = 2.0 ** min(0.0, math.floor(-2 * math.log2(max(brightest, 1e-6))) / 2)
    picture = _fit(photo.rgb, ROW)
    sheet: list[list[Captioned]] = [[("photo", picture), ("mask", draw_overlay(picture, _fit(photo.mask, ROW)))]]
    for caption, spheres, radiance in drawn:
        shown = [(SPHERES[name], _fit(response(sphere * gain), ROW)) for name, sphere in spheres.items()]
        sheet.append([*shown, (caption, _fit(response(radiance * gain), ROW))])
    return _captioned(sheet)


def _stops(ev: float) -> str:
    return f"{ev:+g} EV" if ev else "0 EV"


def _captioned(rows: list[list[Captioned]]) -> np.ndarray:
    """Rows of pictures ROW high, each above its caption."""
    font = ImageFont.load_default(14)
    placed, widest = [], 0
    for index, row in enumerate(rows):
        left = GAP
        for text, picture in row:
            caption = _drawable(text)
            placed.append((left, GAP + index * (ROW + CAPTION + GAP), caption, picture))
            left += max(picture.shape[1], round(font.getlength(caption))) + GAP
        widest = max(widest, left)
    canvas = Image.new("RGB", (widest, GAP + len(rows) * (ROW + CAPTION + GAP)), BACKGROUND)
    for left, top, caption, picture in placed:
        canvas.paste(Image.fromarray(to_bytes(picture)), (left, top))
        ImageDraw.Draw(canvas).text((left, top + ROW + 2), caption, CAPTION_COLOR, font)
    return np.asarray(canvas, np.float32) / 255


def _drawable(text: str) -> str:
    """A text in ASCII, which is what Pillow's font has: letters lose their accents, others become question marks."""
    letters = (one for one in unicodedata.normalize("NFKD", text) if not unicodedata.combining(one))
    return "".join(one if one.isascii() and one.isprintable() else "?" for one in letters)


def _fit(picture: np.ndarray, height: int) -> np.ndarray:
    """Scale a display picture to a height, its shape kept."""
    width = max(1, round(picture.shape[1] * height / picture.shape[0]))
    image = Image.fromarray(np.round(np.clip(picture, 0, 1) * 255).astype(np.uint8))
    resized = image.resize((min(width, 4 * height), height), Image.Resampling.BICUBIC)
    return np.asarray(resized, dtype=np.float32) / 255


OUTPUT_SUFFIXES = (".exr", ".hdr", ".json", ".png")


def write_results(photo: Photo, light: Light, folder: Path, stem: str, colorspace: str = "rec709") -> dict[str, Path]:
    """Write <stem>.exr, .hdr, .json and .png into folder, replacing older ones; the .exr in a colorspace of Light.save.

    Returns:
        Suffix without dot -> path.
    Raises:
        OutputError: the folder cannot be made or written; what was there stays as it was.
    """
    with atomic_files(folder) as scratch:
        light.save(scratch / f"{stem}.exr", colorspace=colorspace)
        for kind in ("hdr", "json"):
            light.save(scratch / f"{stem}.{kind}")
        write_png(scratch / f"{stem}.png", draw_preview(photo, light))
    return {suffix[1:]: folder / f"{stem}{suffix}" for suffix in OUTPUT_SUFFIXES}


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
