"""Standard errors of means over test pairs whose errors correlate where they share a map or a shape."""

from collections.abc import Hashable, Sequence

import numpy as np


def clustered_error(d: Sequence[float], maps: Sequence[str], shapes: Sequence[str]) -> float:
    """Compute the standard error of the mean of d [N], where pairs of one map, and pairs of one shape, correlate.

    V = V_map + V_shape - V_(map and shape), each of one_way_variance (Cameron, Gelbach and Miller 2011), and no less
    than the larger of the first two, below which chance takes the sum where there are few shapes. NaN where all pairs
    are of one map and one shape: they do not tell.
    """
    if len(set(maps)) < 2 and len(set(shapes)) < 2:
        return float("nan")
    by_map, by_shape = one_way_variance(d, maps), one_way_variance(d, shapes)
    by_both = one_way_variance(d, list(zip(maps, shapes, strict=True)))
    return float(np.sqrt(max(by_map + by_shape - by_both, by_map, by_shape)))


def rounded(value: float, digits: int) -> float | None:
    """Round a figure for JSON, which has no NaN: None."""
    return None if np.isnan(value) else round(value, digits)


def one_way_variance(d: Sequence[float], clusters: Sequence[Hashable]) -> float:
    """Compute the variance of the mean of d [N], where the pairs of one cluster correlate.

    G / (G - 1) sum over the G clusters of (sum of d - mean)^2 / N^2 (Liang and Zeger 1986); 0 for one cluster.
    """
    number = {name: index for index, name in enumerate(dict.fromkeys(clusters))}
    sums = np.bincount([number[name] for name in clusters], weights=np.subtract(d, np.mean(d)))
    if len(sums) < 2:
        return 0.0
    return float(len(sums) / (len(sums) - 1) * np.square(sums / len(d)).sum())
