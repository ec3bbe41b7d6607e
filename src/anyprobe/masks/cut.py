"""The object cut out where a rough mask says it is: what its colours and the photo's edges add to that.

A colour model of either side (mixtures of Gaussians, as in GrabCut, Rother et al. 2004) and the rough mask vote for
each pixel; votes are gathered along the photo's own edges by a guided filter in the place of GrabCut's graph cut,
which makes this a mean-field form of it (Kraehenbuehl and Koltun 2011) that numpy alone computes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anyprobe.masks.prompts import Point
from anyprobe.masks.refine import guided, refine, resize
from anyprobe.masks.regions import grow, one_object

LONG_PX = 448
"""Longer side of the window that is worked on."""

MARGIN = 0.15
"""Of that window around the rough mask, in its longer sides."""

COLORS, CLUSTER_ROUNDS, SAMPLES = 5, 4, 12_000
"""Gaussians of either side, rounds of clustering, and pixels that they are fitted to."""

LEAST_VARIANCE = 2e-4
"""Of display values within one Gaussian."""

SURE = 3.5
"""Largest vote of the rough mask, a log-odds; clicks and what is outside a box vote twice that."""

COLOR_VOTES, COLOR_MOST = (1.5, 0.4), 4.0
"""Weight of a colour's log-odds where the two sides' colours are told apart perfectly, and its bound. The second
weight is for photos whose colours would move the mask far: a part of the object looks like what is beside it."""

MOVED = 0.75
"""IoU with the rough mask below which that is so."""

ROUNDS, GATHER, RADIUS, EPSILON = 3, 1.5, 0.012, 1e-3
"""Rounds of gathering votes, the gathered ones' weight, the filter's window in longer sides, and its epsilon."""

CLICK_REACH = 0.02
"""Radius that a click speaks for, in longer sides of the window."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Cut:
    """mask [H, W] in [0, 1]: one part without pinholes; loose: share of the area found that was left out as
    other parts; told_apart: how well the colours of the two sides differ, 0 to 1."""

    mask: np.ndarray
    loose: float
    told_apart: float


def cut_out(
    rgb: np.ndarray,
    cover: np.ndarray,
    on: Sequence[Point] = (),
    off: Sequence[Point] = (),
    box: Sequence[float] | None = None,
) -> Cut | None:
    """One object near a rough mask, or None where nothing is.

    Args:
        rgb: [H, W, 3] display values in [0, 1].
        cover: [h, w] in [0, 1] of the same extent: how likely each pixel is the object's.
        on, off: clicks x, y on the object and beside it, in pixels of rgb.
        box: x0, y0, x1, y1 that the object is inside of.
    """
    window = _window(cover, rgb.shape[:2], on)
    if window is None:
        return None
    x0, y0, x1, y1 = window
    scale = min(1.0, LONG_PX / max(x1 - x0, y1 - y0))
    width, height = max(1, round((x1 - x0) * scale)), max(1, round((y1 - y0) * scale))
    picture = resize(rgb[y0:y1, x0:x1], width, height)
    rough = _part_of(cover, rgb.shape[:2], window, width, height)
    votes, fixed = _votes(rough, window, scale, on, off, box)
    for color_vote in COLOR_VOTES:
        share, told_apart = _gathered(picture, votes, fixed, color_vote)
        found = share > 0.5
        object_ = one_object(found, share + 1e3 * (fixed > 0)) & (fixed >= 0)
        if (object_ & (rough > 0.5)).sum() >= MOVED * (object_ | (rough > 0.5)).sum():
            break
    if not object_.any() or told_apart == 0.0:  # the latter in a blank picture alone
        return None
    canvas, near = np.zeros(rgb.shape[:2], np.float32), grow(grow(object_))
    soft = np.where(object_, np.maximum(share, 0.6), np.minimum(share, 0.4) * near)
    canvas[y0:y1, x0:x1] = refine(rgb[y0:y1, x0:x1], soft.astype(np.float32), RADIUS / 2)
    canvas[y0:y1, x0:x1] *= resize(near.astype(np.float32), x1 - x0, y1 - y0) > 0.25
    loose = 1.0 - float((found & object_).sum() / max(found.sum(), 1))
    return Cut(mask=canvas, loose=loose, told_apart=told_apart)


def _gathered(picture: np.ndarray, votes: np.ndarray, fixed: np.ndarray, color_vote: float) -> tuple[np.ndarray, float]:
    """How likely each pixel is the object's after all rounds, [h, w], and how well colours tell the sides apart."""
    share = _share(votes)
    reach = max(1, round(RADIUS * max(share.shape)))
    for _ in range(ROUNDS):
        colors, told_apart = _color_votes(picture, share)
        odds = votes + color_vote * told_apart * np.clip(colors, -COLOR_MOST, COLOR_MOST)
        gathered = np.clip(guided(picture, _share(odds), reach, EPSILON), 0.02, 0.98)
        share = _share(odds + GATHER * np.log(gathered / (1 - gathered)) + fixed)
    return share, told_apart


def tidy(rgb: np.ndarray, cover: np.ndarray) -> Cut | None:
    """Another segmenter's cover [H, W] as it is, but one part of it, without pinholes; None where nothing is."""
    found = cover > 0.5
    if not found.any():
        return None
    part = one_object(found, cover)
    scale = min(1.0, LONG_PX / max(found.shape))
    size = max(1, round(found.shape[1] * scale)), max(1, round(found.shape[0] * scale))
    _, told_apart = _color_votes(resize(rgb, *size), resize(part.astype(np.float32), *size))
    return Cut(
        mask=np.where(part, np.maximum(cover, 0.51), cover * grow(grow(part))).astype(np.float32),
        loose=1.0 - float((found & part).sum() / found.sum()),
        told_apart=told_apart,
    )


def _share(odds: np.ndarray) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-np.clip(odds, -20.0, 20.0)))


def _window(cover: np.ndarray, shape: tuple[int, int], on: Sequence[Point]) -> tuple[int, int, int, int] | None:
    """x0, y0, x1, y1 in the photo around cover > 0.5 and the clicks on the object, with a margin."""
    rows, columns = np.nonzero(cover > 0.5)
    across, down = shape[1] / cover.shape[1], shape[0] / cover.shape[0]
    x = [*(columns * across), *((columns + 1) * across), *(point[0] for point in on)]
    y = [*(rows * down), *((rows + 1) * down), *(point[1] for point in on)]
    if not x:
        return None
    more = MARGIN * max(max(x) - min(x), max(y) - min(y), 16)
    x0, y0 = max(0, int(min(x) - more)), max(0, int(min(y) - more))
    return x0, y0, min(shape[1], round(max(x) + more) + 1), min(shape[0], round(max(y) + more) + 1)


def _part_of(cover: np.ndarray, shape: tuple[int, int], window, width: int, height: int) -> np.ndarray:
    """The rough mask in the window, [height, width]."""
    x0, y0, x1, y1 = window
    columns = (x0 + (np.arange(width) + 0.5) * (x1 - x0) / width) * cover.shape[1] / shape[1] - 0.5
    rows = (y0 + (np.arange(height) + 0.5) * (y1 - y0) / height) * cover.shape[0] / shape[0] - 0.5
    for axis, at in enumerate((rows, columns)):
        at = np.clip(at, 0, cover.shape[axis] - 1)
        low = np.minimum(at.astype(int), max(cover.shape[axis] - 2, 0))
        part = (at - low).reshape((-1, 1) if axis == 0 else (1, -1))
        high = np.minimum(low + 1, cover.shape[axis] - 1)
        cover = cover.take(low, axis) * (1 - part) + cover.take(high, axis) * part
    return cover


def _votes(rough: np.ndarray, window, scale: float, on, off, box) -> tuple[np.ndarray, np.ndarray]:
    """Log-odds of the rough mask, and those of clicks and the box, [h, w] each."""
    likely = np.clip(rough, 1e-3, 1 - 1e-3)
    votes = np.clip(np.log(likely / (1 - likely)), -SURE, SURE)
    fixed = np.zeros_like(votes)
    y, x = np.ogrid[: votes.shape[0], : votes.shape[1]]
    x, y = x + 0.5, y + 0.5
    if box is not None:
        left, top, right, bottom = ((side - window[i % 2]) * scale for i, side in enumerate(box))
        fixed[~((x >= left) & (x <= right) & (y >= top) & (y <= bottom))] = -2 * SURE
    for points, sign in ((on, 1.0), (off, -1.0)):
        for column, row in points:
            distance = np.hypot(x - (column - window[0]) * scale, y - (row - window[1]) * scale)
            fixed[distance < CLICK_REACH * max(votes.shape)] = sign * 2 * SURE
    return votes + fixed, fixed


def _color_votes(picture: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, float]:
    """How much likelier each pixel's colour is inside than outside, ln, [h, w]; and how well that tells the sides
    apart: 0 where it is no better than a coin, 1 where it agrees with the rough mask everywhere."""
    colors = picture.reshape(-1, 3).astype(np.float64)
    weight = share.ravel()
    odds = color_odds(colors, weight, 1 - weight)
    right = [
        float((side * (sign * odds > 0)).sum() / max(side.sum(), 1e-6))
        for side, sign in ((weight, 1), (1 - weight, -1))
    ]
    return odds.reshape(share.shape), float(np.clip(sum(right) - 1.0, 0.0, 1.0))


def color_odds(colors: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """How much likelier colours [N, 3] are on one side than on the other, ln, [N]; one, other: [N] weights there."""
    every = max(1, len(colors) // SAMPLES)
    first, second = (_ln_density(colors, _mixture(colors[::every], side[::every])) for side in (one, other))
    return first - second


def _mixture(colors: np.ndarray, weight: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Share, mean [3] and covariance [3, 3] of each Gaussian of weighted colours [N, 3]."""
    centres = _spread_centres(colors, weight)
    for _ in range(CLUSTER_ROUNDS):
        nearest = ((colors[:, None] - centres) ** 2).sum(axis=-1).argmin(axis=1)
        for k in range(len(centres)):
            mine = weight * (nearest == k)
            if mine.sum() > 1e-6:
                centres[k] = (mine[:, None] * colors).sum(axis=0) / mine.sum()
    parts = []
    for k in range(len(centres)):
        mine = weight * (nearest == k)
        total = mine.sum()
        if total <= 1e-3 * weight.sum():
            continue
        mean = (mine[:, None] * colors).sum(axis=0) / total
        away = colors - mean
        covariance = (mine[:, None] * away).T @ away / total + LEAST_VARIANCE * np.eye(3)
        parts.append((total / weight.sum(), mean, covariance))
    return parts


def _spread_centres(colors: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """COLORS starting centres [K, 3], each the colour that counts most by weight and distance from those before."""
    centres = [(weight[:, None] * colors).sum(axis=0) / max(weight.sum(), 1e-6)]
    distance = ((colors - centres[0]) ** 2).sum(axis=1)
    for _ in range(COLORS - 1):
        centres.append(colors[int((weight * distance).argmax())])
        distance = np.minimum(distance, ((colors - centres[-1]) ** 2).sum(axis=1))
    return np.array(centres)


def _ln_density(colors: np.ndarray, parts: list[tuple[float, np.ndarray, np.ndarray]]) -> np.ndarray:
    """ln of the mixture's density at colours [N, 3], and of a little evenly spread over all of them."""
    density = np.full(len(colors), 1e-2)
    for share, mean, covariance in parts:
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        away = (colors - mean) @ whiten.T
        density += share * np.linalg.det(whiten) / (2 * np.pi) ** 1.5 * np.exp(-0.5 * (away**2).sum(axis=1))
    return np.log(density)
