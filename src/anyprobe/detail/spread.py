"""Colours spread from where they are seen over a whole panorama, along rows more than across them.

Pull and push (Gortler et al. 1996, "The Lumigraph", sec. 3.4): weighted means over ever wider areas, each filling what
the finer ones leave open. An area is three times as wide as high at first, and ever wider.
"""

from __future__ import annotations

import numpy as np

FINEST_DEG = 1.4
"""Width [degrees] of the finest areas: nothing finer is spread, or pixels at the border would become streaks."""
ACROSS = 3
"""Number of halvings of columns to one of rows."""
FULL = 0.5
"""Share of an area that must be seen for its own mean to count fully."""


def spread(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Spread values [R, 2R, C] from where their weights [R, 2R] in [0, 1] are: [R, 2R, C], smooth everywhere."""
    rows = len(values)
    layers = [np.concatenate([values * weight[..., None], weight[..., None]], axis=-1).astype(np.float32)]
    halved: list[tuple[bool, bool]] = []
    while max(layers[-1].shape[:2]) > 1:
        height, width = layers[-1].shape[:2]
        across = width > 1
        down = height > 1 and (not across or len(halved) % ACROSS == ACROSS - 1)
        halved.append((across, down))
        layers.append(_halved(layers[-1], across=across, down=down))
    finest = max(0, round(np.log2(FINEST_DEG * rows / 180.0)))
    filled = _mean(layers.pop())
    for level in range(len(halved) - 1, -1, -1):
        across, down = halved[level]
        filled = _doubled(filled, across=across, down=down)
        if level >= finest:
            share = np.clip(layers[level][..., -1:] / FULL, 0.0, 1.0)
            filled = filled + share * (_mean(layers[level]) - filled)
    return filled


def _mean(layer: np.ndarray) -> np.ndarray:
    """Return the weighted means [H, W, C] of a layer [H, W, C + 1]."""
    return layer[..., :-1] / np.maximum(layer[..., -1:], 1e-6)


def _halved(layer: np.ndarray, *, across: bool, down: bool) -> np.ndarray:
    """Halve columns, which wrap, and rows of [H, W, C] by the weights 1 3 3 1."""
    if across:
        before, after = np.roll(layer, 1, axis=1)[:, ::2], np.roll(layer, -1, axis=1)[:, 1::2]
        layer = (before + after + 3 * (layer[:, ::2] + layer[:, 1::2])) / 8
    if down:
        padded = np.concatenate([layer[:1], layer, layer[-1:]])
        layer = (padded[:-2:2] + padded[3::2] + 3 * (layer[::2] + layer[1::2])) / 8
    return layer


def _doubled(layer: np.ndarray, *, across: bool, down: bool) -> np.ndarray:
    """Double rows and columns of [H, W, C] by linear interpolation."""
    if down:
        padded = np.concatenate([layer[:1], layer, layer[-1:]])
        layer = np.stack([layer * 0.75 + padded[:-2] * 0.25, layer * 0.75 + padded[2:] * 0.25], axis=1)
        layer = layer.reshape(-1, *layer.shape[2:])
    if across:
        left, right = np.roll(layer, 1, axis=1), np.roll(layer, -1, axis=1)
        layer = np.stack([layer * 0.75 + left * 0.25, layer * 0.75 + right * 0.25], axis=2)
        layer = layer.reshape(len(layer), -1, layer.shape[-1])
    return layer
