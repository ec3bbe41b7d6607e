"""What a material's roughness says of its kind under the world's priors, and what a material reflects in all."""

from __future__ import annotations

import numpy as np

from anyprobe.dataset import priors


def kind_given_alpha(alpha: np.ndarray) -> np.ndarray:
    """P(kind | alpha) [N, 4] by Bayes' rule: SHARES times the density of ln alpha; even where no kind has such."""
    density = np.stack(
        [share * _density(row, alpha) for share, row in zip(priors.SHARES, priors.ALPHA, strict=True)], -1
    )
    density = density + 1e-12
    return density / density.sum(axis=-1, keepdims=True)


def total_reflectance(albedo: np.ndarray, f0: np.ndarray) -> np.ndarray:
    """What a material reflects of an even light in all, [..., 3].

    Schlick's Fresnel term has the cosine-weighted mean F = f0 + (1 - f0) / 21; the rest meets the albedo. What a rough
    coat loses between its facets is left out.
    """
    fresnel = f0 + (1.0 - f0) / 21.0
    return fresnel + (1.0 - fresnel) * albedo


def _density(row: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Of ln value, [N]."""
    edges = np.log(row)
    heights = np.diff(priors.PROBABILITIES) / np.diff(edges)
    place = np.searchsorted(edges, np.log(value), side="right") - 1
    inside = (place >= 0) & (np.log(value) <= edges[-1])
    return np.where(inside, heights[np.clip(place, 0, len(heights) - 1)], 0.0)
