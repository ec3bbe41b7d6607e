"""A study: every method's figures on every pair, and their means over groups of pairs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
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


@dataclass(kw_only=True)
class Study:
    """rows: method -> one dict of figures a pair; groups: each pair's; maps: the name of each pair's map."""

    rows: dict[str, list[dict[str, float]]] = field(default_factory=dict)
    groups: list[set[str]] = field(default_factory=list)
    maps: list[str] = field(default_factory=list)

    def add(self, pair: Pair, scores: Mapping[str, dict[str, float]]) -> None:
        """One pair's figures."""
        self.groups.append(groups_of(pair))
        self.maps.append(pair.map_name)
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

    def difference(self, better: str, worse: str, name: str) -> dict[str, float]:
        """Mean of better minus worse over pairs, and its standard error (clustered_error, by map)."""
        both = zip(self.rows[better], self.rows[worse], self.maps, strict=True)
        found = [(a[name] - b[name], where) for a, b, where in both if name in a and name in b]
        d, maps = np.array([one for one, _ in found]), [where for _, where in found]
        return {
            "mean": round(float(d.mean()), 5),
            "standard_error": round(clustered_error(d, maps), 5),
        }


def clustered_error(d: np.ndarray, clusters: Sequence[str]) -> float:
    """Standard error of the mean of d [N], where those of one cluster may err together: pairs under one map do.

    sqrt( G / (G - 1) sum over the G clusters of (sum of d - mean)^2 ) / N (Liang and Zeger 1986); 0 for one cluster.
    """
    _, which = np.unique(np.asarray(clusters), return_inverse=True)
    sums = np.bincount(which, weights=d - d.mean())
    if len(sums) < 2:
        return 0.0
    return float(np.sqrt(len(sums) / (len(sums) - 1) * np.square(sums).sum()) / len(d))


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
