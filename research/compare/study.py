"""Statistics of scored pairs: means over groups, and paired differences with their standard errors."""

from __future__ import annotations

import numpy as np

from anyprobe_train.evaluate.scoring import Scores
from anyprobe_train.evaluate.standard_errors import clustered_error, rounded

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
    chosen = [row for row, member in zip(scores.rows[method], scores.groups, strict=True) if group in member]
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
