"""What a material's roughness says of its kind under the world's priors."""

from __future__ import annotations

import numpy as np

from anyprobe_train.dataset import distributions


def kind_given_alpha(alpha: np.ndarray) -> np.ndarray:
    """P(kind | alpha) [N, 4] by Bayes' rule: SHARES times the density of ln alpha; even where no kind has such."""
    density = np.stack(
        [share * _density(row, alpha) for share, row in zip(distributions.SHARES, distributions.ALPHA, strict=True)], -1
    )
    density = density + 1e-12
    return density / density.sum(axis=-1, keepdims=True)


def _density(row: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Of ln value, [N]."""
    edges = np.log(row)
    heights = np.diff(distributions.PROBABILITIES) / np.diff(edges)
    place = np.searchsorted(edges, np.log(value), side="right") - 1
    inside = (place >= 0) & (np.log(value) <= edges[-1])
    return np.where(inside, heights[np.clip(place, 0, len(heights) - 1)], 0.0)
