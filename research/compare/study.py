"""Statistics of scored pairs: means over groups, and paired differences with their standard errors."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from anyprobe.evaluate.scoring import Scores

MEDIANS = (
    "array_rmse",
    "array_si_rmse",
    "array_angle_deg",
    "array_psnr",
    "dominant_light_deg",
    "peak_deg",
    "total_power_stops",
)
"""Figures whose median is given beside the mean."""
SOMETIMES = ("lights_deg", "lights_published_deg")
"""Figures of those pairs alone in which both maps have lights that can be counted."""


def means(scores: Scores, method: str, group: str = "all") -> dict[str, float]:
    """Mean of every figure over the group's pairs that have it; "<name>_median" of MEDIANS, and "<name>_pairs", how
    many have it, of SOMETIMES."""
    chosen = scores.of_group(method, group)
    result = {}
    for name in dict.fromkeys(name for row in chosen for name in row):
        values = [row[name] for row in chosen if name in row]
        result[name] = round(float(np.mean(values)), 5)
        if name in MEDIANS:
            result[f"{name}_median"] = round(float(np.median(values)), 5)
        if name in SOMETIMES:
            result[f"{name}_pairs"] = len(values)
    return result


def difference(scores: Scores, better: str, worse: str, name: str, group: str = "all") -> dict[str, float | None]:
    """Mean of better minus worse over a group's pairs, and its standard error (clustered_error)."""
    both = zip(scores.rows[better], scores.rows[worse], scores.maps, scores.shapes, scores.groups, strict=True)
    found = [
        (a[name] - b[name], *where) for a, b, *where, member in both if group in member and name in a and name in b
    ]
    d, maps, shapes = zip(*found, strict=True)
    return {"mean": round(float(np.mean(d)), 7), "standard_error": rounded(clustered_error(d, maps, shapes), 7)}


def clustered_error(d: Sequence[float], maps: Sequence[str], shapes: Sequence[str]) -> float:
    """Standard error of the mean of d [N], where pairs under one map, and pairs of one shape, may err together.

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
    """For JSON, which has no NaN."""
    return None if np.isnan(value) else round(value, digits)


def one_way_variance(d: Sequence[float], clusters: Sequence[Hashable]) -> float:
    """Variance of the mean of d [N], where those of one cluster may err together.

    G / (G - 1) sum over the G clusters of (sum of d - mean)^2 / N^2 (Liang and Zeger 1986); 0 for one cluster.
    """
    number = {name: index for index, name in enumerate(dict.fromkeys(clusters))}
    sums = np.bincount([number[name] for name in clusters], weights=np.subtract(d, np.mean(d)))
    if len(sums) < 2:
        return 0.0
    return float(len(sums) / (len(sums) - 1) * np.square(sums / len(d)).sum())
