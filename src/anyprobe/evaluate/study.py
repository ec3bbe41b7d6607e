"""A study: every method's figures on every pair, and their means over groups of pairs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.groups import groups_of
from anyprobe.evaluate.panel import Estimate, Method, score_pair

MEDIANS = (
    "array_rmse",
    "array_si_rmse",
    "array_angle_deg",
    "array_psnr",
    "main_light_deg",
    "peak_deg",
    "flux_stops",
)
"""Figures whose median is given beside the mean."""
SOMETIMES = ("lights_deg", "lights_published_deg")
"""Figures that only pairs have in which both maps show lights that can be counted."""
CLUSTERED = "by map and shape"
"""How result files call the standard errors of clustered_error; older ones have errors by map, and do not say so."""


@dataclass(kw_only=True)
class Study:
    """rows: method -> one dict of figures a pair; groups: each pair's; maps, shapes: the names of each pair's."""

    rows: dict[str, list[dict[str, float]]] = field(default_factory=dict)
    groups: list[set[str]] = field(default_factory=list)
    maps: list[str] = field(default_factory=list)
    shapes: list[str] = field(default_factory=list)

    def add(self, pair: Pair, scores: Mapping[str, dict[str, float]]) -> None:
        """One pair's figures."""
        self.groups.append(groups_of(pair))
        self.maps.append(pair.map_name)
        self.shapes.append(pair.shape_name)
        for method, row in scores.items():
            self.rows.setdefault(method, []).append(row)

    def means(self, method: str, group: str = "all") -> dict[str, float]:
        """Mean of every figure over the group's pairs that have it; "<name>_median" of MEDIANS, and "<name>_pairs", how
        many have it, of SOMETIMES."""
        chosen = [row for row, member in zip(self.rows[method], self.groups, strict=True) if group in member]
        names = dict.fromkeys(name for row in chosen for name in row)
        result = {}
        for name in names:
            values = [row[name] for row in chosen if name in row]
            result[name] = round(float(np.mean(values)), 5)
            if name in MEDIANS:
                result[f"{name}_median"] = round(float(np.median(values)), 5)
            if name in SOMETIMES:
                result[f"{name}_pairs"] = len(values)
        return result

    def count(self, group: str) -> int:
        """Pairs in a group."""
        return sum(group in member for member in self.groups)

    def difference(self, better: str, worse: str, name: str, group: str = "all") -> dict[str, float]:
        """Mean of better minus worse over a group's pairs, and its standard error (clustered_error)."""
        both = zip(self.rows[better], self.rows[worse], self.maps, self.shapes, self.groups, strict=True)
        found = [
            (a[name] - b[name], *where)
            for a, b, *where, member in both
            if group in member and name in a and name in b
        ]
        d, maps, shapes = zip(*found, strict=True)
        return {
            "mean": round(float(np.mean(d)), 7),
            "standard_error": rounded(clustered_error(d, maps, shapes), 7),
        }


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


def study(
    pairs: Iterable[Pair],
    methods: Mapping[str, Method],
    watch: Callable[[int, Pair, dict[str, Estimate]], None] | None = None,
) -> Study:
    """Score every method on every pair; watch sees each pair with the estimates as it is done."""
    result = Study()
    for index, pair in enumerate(pairs):
        estimates = {name: method(pair) for name, method in methods.items()}
        result.add(pair, score_pair(pair, estimates))
        if watch is not None:
            watch(index, pair, estimates)
    return result
