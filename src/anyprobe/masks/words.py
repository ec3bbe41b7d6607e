"""A verdict on a found mask in words: it looks right, or why it may be wrong."""

from __future__ import annotations

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.masks.prompts import Point

RIGHT = "looks right"
WRONG = "may be wrong"
UNSURE = "the network is unsure of it"
COLORS = contract("mask")["colors"]
APART = COLORS["apart"]
"""Distance of two colours, shares of red, green and blue, from which on two things may touch."""
TIGHT = COLORS["tight"]
"""How far colours may spread about their own thing's, of that distance."""
SHARE = COLORS["share"]
"""Least share of the mask that the smaller of two objects covers."""
ASIDE = COLORS["aside"]
"""Least distance between the centres of two objects, in standard deviations of their pixels."""
LOCAL = COLORS["local"]
"""Share of the mask that looks like the place of a click, below which the click is on a small part of it."""
PIXELS = COLORS["pixels"]
"""Pixels of the mask that are sampled."""
NEAR = COLORS["near"]
"""Radius of a click's neighbourhood, in shares of the mask's mean side."""
ROUNDS = COLORS["rounds"]


def color_doubts(rgb: np.ndarray, mask: np.ndarray, clicks: tuple[Point, ...] = ()) -> list[str]:
    """Return what the colours [H, W, 3] in a mask [H, W] say against it, a few words each."""
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
        found.append("two things of different colours may touch in it")
    for x, y in clicks:
        near = np.hypot(*(places - (x, y)).T) <= max(2.0 * step, NEAR * np.sqrt(mask.sum()))
        if near.sum() < 3:
            continue
        here = np.median(shares[near], axis=0)
        alike = np.linalg.norm(shares - here, axis=1) < 0.5 * APART
        if alike.mean() < LOCAL:
            found.append("the click is on a small part of what was found: a box around what is meant helps")
            break
    return found


def _are_two(shares: np.ndarray, places: np.ndarray) -> bool:
    """Return whether colours [N, 3] fall into two kinds that lie apart in the photo [N, 2]."""
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
    within = float(np.sqrt(np.mean([shares[one].var(axis=0).sum() for one in (first, ~first)])))
    if apart < APART or within > TIGHT * apart:
        return False
    spread = np.sqrt(np.mean([places[one].var(axis=0).sum() / 2 for one in (first, ~first)]))
    return bool(np.linalg.norm(places[first].mean(axis=0) - places[~first].mean(axis=0)) > ASIDE * spread)


def verdict(doubts: list[str], *, is_doubtful: bool) -> str:
    """Return one phrase: that a mask looks right, or may be wrong and why."""
    if not (doubts or is_doubtful):
        return RIGHT
    return f"{WRONG}: {doubts[0] if doubts else UNSURE}"
