"""Inpainting of the object's place from around it, coarse to fine, with patches of what is seen.

After Wexler et al. 2007: every pixel of the hole is the mean of its value in the patches that cover it, each replaced
by the nearest seen patch. Patches at the same height in the picture are preferred, which keeps a ground's perspective
and the horizon. Coarse levels compare with all patches, finer ones with those around the last match.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.resample import resample

PATCH = 3
"""Pixels from a patch's centre to its sides."""
COARSE_PX = 56
"""Longer side of the coarsest level [px]."""
LEVEL_STEP = 1.6
"""Ratio of one level's size to the next coarser one's."""
ROUNDS = 2
"""Number of patch searches on each level."""
MOST_PATCHES = 1500
"""Largest number of seen patches that are compared with."""
ROW_PRICE = 6.0
"""Squared distance of two patches one picture height apart, in mean squared ln radiance of a pixel."""
FLOOR = 0.02
"""Radiance added before its logarithm."""
NEIGHBORS = ((0, 0), (0, 2), (0, -2), (2, 0), (-2, 0))
"""Rows down and columns across to the pixels whose matches are tried."""


def fill_hole(radiance: np.ndarray, hole: np.ndarray) -> np.ndarray:
    """Fill the pixels of a hole [H, W] in linear radiance [H, W, 3] with plausible background."""
    if not hole.any() or hole.all():
        return radiance
    ln = np.log(np.maximum(radiance, 0.0) + FLOOR).astype(np.float32)
    sizes = _sizes(hole.shape)
    filled = np.zeros(0)
    source = np.zeros((0, 2))
    for level, (width, height) in enumerate(sizes):
        cover = resample((~hole).astype(np.float32)[..., None], (width, height))
        known = cover[..., 0] > 0.999
        if not known.any():
            known = cover[..., 0] >= cover.max()
        own = resample(ln * ~hole[..., None], (width, height)) / np.maximum(cover, 1e-3)
        if level == 0:
            filled = np.where(known[..., None], own, _smooth(own, known))
        else:
            filled = np.where(known[..., None], own, resample(filled, (width, height), smooth=True))
        filled, source = _level(filled, known, source)
    return np.where(hole[..., None], np.maximum(np.exp(filled) - FLOOR, 0.0), radiance).astype(np.float32)


def _sizes(shape: tuple[int, int]) -> list[tuple[int, int]]:
    """Return widths and heights of the levels, the coarsest first."""
    count = max(0, int(np.ceil(np.log(max(shape) / COARSE_PX) / np.log(LEVEL_STEP))))
    scales = [LEVEL_STEP**-k for k in range(count, -1, -1)]
    return [(max(4, round(shape[1] * s)), max(4, round(shape[0] * s))) for s in scales]


def _level(filled: np.ndarray, known: np.ndarray, source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fill one level [H, W, 3] anew and return it with the source of each pixel's patch [H, W, 2] in shares."""
    height, width = known.shape
    whole = _eroded(known)
    if not whole.any():
        return filled, source
    near = ~whole
    at = np.argwhere(near)
    seen = np.argwhere(whole)
    is_coarse = not source.size or max(height, width) <= 1.7 * COARSE_PX
    if len(seen) > MOST_PATCHES:
        seen = seen[np.random.default_rng(0).permutation(len(seen))[:MOST_PATCHES]]
    place = np.sqrt(ROW_PRICE) / height
    if not is_coarse:
        rows = np.clip((at[:, 0] + 0.5) / height * len(source), 0, len(source) - 1).astype(int)
        columns = np.clip((at[:, 1] + 0.5) / width * source.shape[1], 0, source.shape[1] - 1).astype(int)
        shift = source[rows, columns] * (height, width)
        matched = np.clip(np.round(shift + at), 0, (height - 1, width - 1)).astype(int)
    for _ in range(ROUNDS if is_coarse else 1):
        if is_coarse:
            matched = seen[_nearest(_patches(filled, at), _patches(filled, seen), at[:, 0] * place, seen[:, 0] * place)]
        else:
            matched = _searched(filled, at, matched, whole, place)
        filled = _voted(filled, known, at, matched)
    shifts = np.zeros((height, width, 2), np.float32)
    shifts[near] = (matched - at) / (height, width)
    return filled, shifts


def _patches(picture: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Extract patches [P, K] around pixels [P, 2], extended beyond the border; scaled to a mean over pixels."""
    padded = np.pad(picture, ((PATCH, PATCH), (PATCH, PATCH), (0, 0)), mode="edge")
    side = 2 * PATCH + 1
    windows = np.lib.stride_tricks.sliding_window_view(padded, (side, side), axis=(0, 1))
    return windows[at[:, 0], at[:, 1]].reshape(len(at), -1) / side


def _nearest(wanted: np.ndarray, seen: np.ndarray, row: np.ndarray, seen_row: np.ndarray) -> np.ndarray:
    """Return the index [P] of the nearest of seen patches [N, K] to each wanted [P, K]."""
    seen = np.concatenate([seen, seen_row[:, None]], axis=1).astype(np.float32)
    wanted = np.concatenate([wanted, row[:, None]], axis=1).astype(np.float32)
    half = 0.5 * (seen * seen).sum(axis=1)
    found = [np.argmax(part @ seen.T - half, axis=1) for part in np.array_split(wanted, -(-len(wanted) // 1024))]
    return np.concatenate(found)


def _searched(filled: np.ndarray, at: np.ndarray, matched: np.ndarray, whole: np.ndarray, place: float) -> np.ndarray:
    """Improve matches by patches that continue the neighbours' [P, 2]."""
    height, width = whole.shape
    wanted = _patches(filled, at)
    shift = np.zeros((height, width, 2), int)
    shift[at[:, 0], at[:, 1]] = matched - at
    has_match = np.zeros((height, width), bool)
    has_match[at[:, 0], at[:, 1]] = True
    best, cost = matched, np.full(len(at), np.inf, np.float32)
    for down, across in NEIGHBORS:
        row = np.clip(at[:, 0] + down, 0, height - 1)
        column = np.clip(at[:, 1] + across, 0, width - 1)
        tried = np.clip(at + shift[row, column], 0, (height - 1, width - 1))
        is_valid = has_match[row, column] & whole[tried[:, 0], tried[:, 1]]
        price = ((_patches(filled, tried) - wanted) ** 2).sum(axis=1) + ((tried[:, 0] - at[:, 0]) * place) ** 2
        better = is_valid & (price < cost)
        best = np.where(better[:, None], tried, best)
        cost = np.where(better, price, cost)
    return best


def _voted(filled: np.ndarray, known: np.ndarray, at: np.ndarray, matched: np.ndarray) -> np.ndarray:
    """Average, for each pixel of the hole, its value in all patches that cover it."""
    height, width = known.shape
    wide = width + 2 * PATCH
    flat = np.pad(filled, ((PATCH, PATCH), (PATCH, PATCH), (0, 0)), mode="edge").reshape(-1, 3)
    target, source = ((pixels + PATCH) @ (wide, 1) for pixels in (at, matched))
    sums = np.zeros((len(flat), 4), np.float32)
    for down in range(-PATCH, PATCH + 1):
        for across in range(-PATCH, PATCH + 1):
            step, weight = down * wide + across, np.float32(np.exp(-(down * down + across * across) / 4.0))
            sums[target + step, :3] += weight * flat.take(source + step, axis=0)  # each pixel once a step
            sums[target + step, 3] += weight
    sums = sums.reshape(height + 2 * PATCH, wide, 4)[PATCH:-PATCH, PATCH:-PATCH]
    mean = sums[..., :3] / np.maximum(sums[..., 3:], 1e-9)
    return np.where((known | (sums[..., 3] == 0))[..., None], filled, mean).astype(np.float32)


def _eroded(known: np.ndarray) -> np.ndarray:
    """Return the pixels [H, W] around which a whole patch is known."""
    result = np.pad(known, PATCH, constant_values=False)
    height, width = known.shape
    for axis, size in ((0, height), (1, width)):
        result = np.logical_and.reduce([np.take(result, range(k, k + size), axis) for k in range(2 * PATCH + 1)])
    return result


def _smooth(own: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Spread the known pixels of [H, W, 3] over all pixels: means over growing areas."""
    height, width = known.shape
    layer, share = own * known[..., None], known.astype(np.float32)[..., None]
    result, left = np.zeros_like(own), np.ones_like(share)
    reach = 1
    while left.max() > 1e-3 and reach < 4 * max(height, width):
        size = (max(1, width // reach), max(1, height // reach))
        mean = resample(resample(np.dstack([layer, share]), size), (width, height), smooth=True)
        trust = np.clip(mean[..., 3:] * 2, 0, 1) * left
        result += trust * mean[..., :3] / np.maximum(mean[..., 3:], 1e-6)
        left = left - trust
        reach *= 2
    return result
