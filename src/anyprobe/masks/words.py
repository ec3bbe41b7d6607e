"""Verdicts on found masks in words: that a mask looks right, or why it may be wrong."""

from __future__ import annotations

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.masks.prompts import Point

RIGHT = "looks right"
WRONG = "may be wrong"
UNSURE = "the network is unsure of it"
COLORS = contract("mask")["colors"]
APART = COLORS["apart"]
"""Smallest distance of two colours, as shares of red, green and blue, that suggests two objects."""
TIGHT = COLORS["tight"]
"""Largest spread of colours around their own object's, as a share of that distance."""
SHARE = COLORS["share"]
"""Smallest share of the mask that the smaller of two objects covers."""
ASIDE = COLORS["aside"]
"""Smallest distance between the centres of two objects, in standard deviations of their pixels' places."""
LOCAL = COLORS["local"]
"""Share of the mask with the colour at a click below which the click is on a small part of it."""
PIXELS = COLORS["pixels"]
"""Approximate number of the mask's pixels that are sampled."""
NEAR = COLORS["near"]
"""Radius of a click's neighbourhood, in square roots of the mask's area."""
ROUNDS = COLORS["rounds"]
"""Number of rounds of two-means clustering."""


def color_doubts(rgb: np.ndarray, mask: np.ndarray, clicks: tuple[Point, ...] = ()) -> list[str]:
    """Return doubts about a mask [H, W] from the colours [H, W, 3] inside it, a few words each."""
    step = max(1, int(np.sqrt((mask > 0.5).sum() / PIXELS)))
    inside = mask[::step, ::step] > 0.9
    rows, columns = np.nonzero(inside)
    if len(rows) < 50:
        return []
    colors = rgb[::step, ::step][inside].astype(np.float64)
    shares = (colors + 0.03) / (colors + 0.03).sum(axis=1, keepdims=True)
    places = np.stack([columns, rows], axis=-1) * float(step)
    found = []
    if _are_two(shares, places):
        found.append("it may contain two objects of different colours")
    for x, y in clicks:
        near = np.hypot(*(places - (x, y)).T) <= max(2.0 * step, NEAR * np.sqrt(mask.sum()))
        if near.sum() < 3:
            continue
        here = np.median(shares[near], axis=0)
        alike = np.linalg.norm(shares - here, axis=1) < 0.5 * APART
        if alike.mean() < LOCAL:
            found.append("the click is on a small part of what was found; a box around the object helps")
            break
    return found


def _are_two(shares: np.ndarray, places: np.ndarray) -> bool:
    """Return whether colours [N, 3] fall into two groups whose places [N, 2] in the photo lie apart."""
    axis = np.linalg.svd(shares - shares.mean(axis=0), full_matrices=False)[2][0]
    along = shares @ axis
    middles = shares[[int(np.argmin(along)), int(np.argmax(along))]]
    first = np.zeros(len(shares), bool)
    for _ in range(ROUNDS):
        first = np.linalg.norm(shares - middles[0], axis=1) < np.linalg.norm(shares - middles[1], axis=1)
        if not SHARE <= first.mean() <= 1 - SHARE:
            return False
        middles = np.stack([shares[first].mean(axis=0), shares[~first].mean(axis=0)])
    apart = float(np.linalg.norm(middles[0] - middles[1]))
    within = float(np.sqrt(np.mean([shares[group].var(axis=0).sum() for group in (first, ~first)])))
    if apart < APART or within > TIGHT * apart:
        return False
    spread = np.sqrt(np.mean([places[group].var(axis=0).sum() / 2 for group in (first, ~first)]))
    return bool(np.linalg.norm(places[first].mean(axis=0) - places[~first].mean(axis=0)) > ASIDE * spread)


def verdict(doubts: list[str], *, is_doubtful: bool) -> str:
    """Return a phrase: RIGHT, or WRONG and the first doubt."""
    if not (doubts or is_doubtful):
        return RIGHT
    return f"{WRONG}: {doubts[0] if doubts else UNSURE}"
