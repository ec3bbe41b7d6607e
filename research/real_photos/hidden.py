"""The hidden ring: an estimate from the middle of a real photo, compared with the rest of the photo.

A photo is cropped about its middle to KEPT of its sides. The camera's frame stays: tan of half the crop's field of
view is KEPT times the photo's. The ring is those pixels of the map that the photo shows, that the crop does not show,
and that the object does not touch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import inverse_response, response
from anyprobe.errors import InputError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import load_photo
from anyprobe.estimate.result import CAMERA
from anyprobe.estimate.sheet import draw_overlay
from anyprobe.inputs.hints import NONE
from anyprobe.light.environment import MAP_HEIGHT, reduced
from anyprobe.pictures.images import read_image
from anyprobe_train.evaluate.metrics import rmse
from anyprobe_train.evaluate.standard_errors import rounded
from research.clustered import with_error
from research.real_photos.lamps import ALONE, DEFAULT
from research.real_photos.sheet import strip

FOV_DEG, KEPT = 60.0, 0.6
"""Of the longer side of the whole photo, which no file says; share of its sides that the crop has."""
FINE = 8
"""Points across a pixel of the map, whose mean the pixel's colour is."""
LEAST = 24
"""Pixels of a ring, and of its parts above and below, that are enough to compare."""
LEAST_OBJECT = 0.01
"""Share of the crop that the object covers at least."""
PLAIN = 2 / 255
"""Range of display values up to which a ring shows no place."""
DARK = 1e-3
"""Luminance that brightness is compared from."""
MEAN, BORDER, OWN = "crop's mean colour", "nearest pixel of the crop's border", "ring's own mean colour"
BESIDE = f"{BORDER} beside the object"
"""Three baselines, and what no flat colour is nearer than."""
PANORAMA = "panorama of the default"
"""The picture of the place that is drawn from the default estimate."""
DRAWN = 256
"""Its rows."""
FRONT = slice(12, 52), slice(34, 94)
"""Rows and columns of the map around any ring, for pictures."""
COLUMNS = {
    "rmse": "RMSE, median",
    "ahead_of_mean": "ahead of the crop's mean in",
    "ahead_of_border": "of the border in",
    "ahead_of_beside": "of the border beside the object in",
    "tilt_abs": "log2 above / below: abs",
    "tilt_bias": "bias, median",
}


@dataclass(frozen=True, kw_only=True, slots=True)
class Ring:
    """A photo's ring.

    crop: [h, w, 3] uint8, and its mask [h, w] uint8. fov_deg: of the crop's longer side. where: [64, 128] bool, the
    ring's pixels. shown, border, beside: [64, 128, 3] display values of the photo, of the nearest pixel of the crop's
    border, and of the nearest one that is not the object's; 0 off the ring. mean: [3] of the crop beside the object.
    picture: [H, W, 3] uint8, the photo with the crop framed.
    """

    crop: np.ndarray
    mask: np.ndarray
    fov_deg: float
    where: np.ndarray
    shown: np.ndarray
    border: np.ndarray
    beside: np.ndarray
    mean: np.ndarray
    picture: np.ndarray


def load_ring(path: Path, mask: Path) -> Ring | str:
    """Return the ring of a photo, or why it has none."""
    pixels = read_image(path)
    with Image.open(mask) as opened:
        given = np.asarray(opened.convert("L"))
    if given.shape != pixels.rgb.shape[:2]:
        raise InputError(
            f"{mask}: expected the photo's size {pixels.rgb.shape[:2]}, got {given.shape}; use its own mask"
        )
    if pixels.alpha is not None and (pixels.alpha < 0.5).any():
        return "transparent, a cut-out"
    return ring_of(pixels.rgb, given)


def ring_of(rgb: np.ndarray, mask: np.ndarray) -> Ring | str:
    """Return the ring of display values [H, W, 3] around an object [H, W] uint8, or why it has none."""
    height, width = mask.shape
    top, left = (round(side * (1 - KEPT) / 2) for side in (height, width))
    window = slice(top, height - top), slice(left, width - left)
    if (mask[window] > 127).mean() < LEAST_OBJECT:
        return "too little of the object in its middle"
    # columns and rows of each point; the photo's middle is where the camera looks
    d = pixel_directions(FINE * MAP_HEIGHT).astype(np.float64)
    focal = max(height, width) / 2 / np.tan(np.radians(FOV_DEG) / 2)
    front = d[..., 2] < -0.1
    depth = np.where(front, -d[..., 2], 1.0)
    x, y = width / 2 + focal * d[..., 0] / depth, height / 2 - focal * d[..., 1] / depth
    inside = front & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    column, row = (np.where(inside, one, 0).astype(int) for one in (x, y))
    in_crop = inside & (x >= left) & (x < width - left) & (y >= top) & (y < height - top)
    on_object = inside & (mask[row, column] > 127)
    where = _at_centers(inside & ~in_crop) & ~(_blocks(on_object[..., None]).max(axis=(1, 3))[..., 0] > 0)
    if where.sum() < LEAST:
        return "the object covers what the crop hides"
    seen = inside & ~in_crop
    nearest = row.clip(top, height - top - 1), column.clip(left, width - left - 1)
    free = _free_border(nearest, seen, mask, window)
    shown, border, beside = (
        _means(colors, seen) * where[..., None] for colors in (rgb[row, column], rgb[nearest], rgb[free])
    )
    if np.ptp(shown[where], axis=0).max() < PLAIN:
        return "of one colour beside the object, a cut-out"
    crop, around = rgb[window], mask[window] <= 127
    tan_half = max(crop.shape[:2]) / max(height, width) * np.tan(np.radians(FOV_DEG) / 2)
    picture = np.round(255 * draw_overlay(rgb, mask / np.float32(255))).astype(np.uint8)
    for edge in ((top, window[1]), (height - top - 1, window[1]), (window[0], left), (window[0], width - left - 1)):
        picture[edge] = (255, 255, 0)
    return Ring(
        crop=np.round(255 * crop).astype(np.uint8),
        mask=mask[window],
        fov_deg=float(2 * np.degrees(np.arctan(tan_half))),
        where=where,
        shown=shown,
        border=border,
        beside=beside,
        mean=crop[around].mean(axis=0) if around.any() else crop.mean(axis=(0, 1)),
        picture=picture,
    )


def maps_of(ring: Ring, estimator: Estimator) -> dict[str, np.ndarray]:
    """Return display maps [64, 128, 3] by row: baselines, the estimates from the crop with
    its mask given, and the panorama of the second."""
    flat = np.ones((*ring.where.shape, 3))
    maps = {OWN: flat * ring.shown[ring.where].mean(axis=0), MEAN: flat * ring.mean}
    maps |= {BORDER: ring.border, BESIDE: ring.beside}
    for name, surroundings in ((ALONE, {"surroundings": NONE}), (DEFAULT, {})):
        photo = load_photo(ring.crop, mask=ring.mask, fov_deg=ring.fov_deg, **surroundings)
        light = estimator.from_photo(photo)
        maps[name] = response(light.radiance)
    picture = light.panorama(DRAWN, frame=CAMERA).radiance
    return {**maps, PANORAMA: reduced(response(picture), MAP_HEIGHT)}


def score_ring(ring: Ring, maps: Mapping[str, np.ndarray]) -> dict[str, dict[str, float]]:
    """Return each row's RMSE on the ring, and its error of the tilt, where enough of the ring is above and below.

    Tilt is log2 of the luminance above the photo's middle line over that below [stops].
    """
    rise = pixel_directions(MAP_HEIGHT)[..., 1]
    parts = ring.where & (rise > 0), ring.where & (rise < 0)
    scores = {}
    for name, one in maps.items():
        scores[name] = {"rmse": round(rmse(one[ring.where], ring.shown[ring.where]), 4)}
        if min(part.sum() for part in parts) >= LEAST / 2:
            scores[name]["tilt"] = round(_tilt(one, *parts) - _tilt(ring.shown, *parts), 3)
    return scores


def summary(scores: Mapping[str, Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, float | None]]:
    """Return figures by row over photos, with standard errors by bootstrap over photos."""
    photos = list(scores)
    rows: dict[str, dict[str, float | None]] = {}
    for name in scores[photos[0]] if photos else ():
        column = {
            one: np.array([scores[photo][one]["rmse"] for photo in photos]) for one in (name, MEAN, BORDER, BESIDE)
        }
        tilted = [photo for photo in photos if "tilt" in scores[photo][name]]
        tilt = np.array([scores[photo][name]["tilt"] for photo in tilted])
        figures = {
            "rmse": with_error(np.median, photos, column[name]),
            "ahead_of_mean": with_error(np.mean, photos, column[name] < column[MEAN]),
            "ahead_of_border": with_error(np.mean, photos, column[name] < column[BORDER]),
            "ahead_of_beside": with_error(np.mean, photos, column[name] < column[BESIDE]),
            "tilt_abs": with_error(np.mean, tilted, np.abs(tilt)),
            "tilt_bias": with_error(np.median, tilted, tilt),
        }
        rows[name] = {
            key: rounded(number, 4)
            for figure, (value, error) in figures.items()
            for key, number in ((figure, value), (f"{figure}_error", error))
        }
    return rows


def draw(name: str, ring: Ring, maps: Mapping[str, np.ndarray]) -> Image.Image:
    """Return a line of pictures: the photo and its crop, its ring on the map, and what each row has there."""

    def front(one: np.ndarray) -> np.ndarray:
        return np.where(ring.where[..., None], one, 0.25)[FRONT]

    tiles = [(name, ring.picture / 255), ("what the crop hides", front(ring.shown))]
    for row in (BORDER, ALONE, DEFAULT):
        picture = front(maps[row]) if row == BORDER else maps[row]
        tiles.append((f"{row}: RMSE {rmse(maps[row][ring.where], ring.shown[ring.where]):.3f}", picture))
    return strip([tiles])


def _free_border(
    nearest: tuple[np.ndarray, np.ndarray], seen: np.ndarray, mask: np.ndarray, window: tuple[slice, slice]
) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the border's pixels nearest to those pixels of it that are not the object's, for points seen;
    those themselves where the object covers the whole border."""
    row, column = (one.copy() for one in nearest)
    edge = np.zeros(mask.shape, bool)
    edge[window] = True
    edge[window[0].start + 1 : window[0].stop - 1, window[1].start + 1 : window[1].stop - 1] = False
    free = np.argwhere(edge & (mask <= 127))
    moved = seen & (mask[row, column] > 127)
    if len(free):
        points = np.stack([row[moved], column[moved]], axis=-1)
        which, inverse = np.unique(points, axis=0, return_inverse=True)
        closest = [np.square(free - point).sum(axis=1).argmin() for point in which]
        row[moved], column[moved] = free[closest][inverse.ravel()].T
    return row, column


def _at_centers(fine: np.ndarray) -> np.ndarray:
    """Return what is true at the middle of each pixel of the map, of points [64 FINE, 128 FINE] bool."""
    blocks = _blocks(fine[..., None])[..., 0]
    half = FINE // 2
    return blocks[:, half - 1 : half + 1, :, half - 1 : half + 1].mean(axis=(1, 3)) > 0.5


def _blocks(fine: np.ndarray) -> np.ndarray:
    return fine.reshape(MAP_HEIGHT, FINE, 2 * MAP_HEIGHT, FINE, -1)


def _means(colors: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Means [64, 128, 3] of the valid ones of points [64 FINE, 128 FINE, 3]; 0 where there are none."""
    weight = valid[..., None].astype(np.float64)
    count = _blocks(weight).sum(axis=(1, 3))
    return (_blocks(colors * weight).sum(axis=(1, 3)) / np.maximum(count, 1)).astype(np.float32)


def _tilt(display: np.ndarray, above: np.ndarray, below: np.ndarray) -> float:
    """Log2 of the mean luminance above over that below, clipped at the photo's white, [stops]."""
    bright = luminance(inverse_response(np.asarray(display, np.float64)))
    return float(np.log2(max(bright[above].mean(), DARK) / max(bright[below].mean(), DARK)))
