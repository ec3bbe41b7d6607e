"""A study: every method's figures on every pair, and their means over groups of pairs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
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


@dataclass(kw_only=True)
class Study:
    """rows: method -> one dict of figures a pair; groups: each pair's; seconds: method -> in all."""

    rows: dict[str, list[dict[str, float]]] = field(default_factory=dict)
    groups: list[set[str]] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)

    def add(self, pair: Pair, scores: Mapping[str, dict[str, float]]) -> None:
        """One pair's figures."""
        self.groups.append(groups_of(pair))
        for method, row in scores.items():
            self.rows.setdefault(method, []).append(row)

    def means(self, method: str, group: str = "all") -> dict[str, float]:
        """Mean of every figure over the group's pairs that have it; "<name>_median" of MEDIANS."""
        chosen = [row for row, member in zip(self.rows[method], self.groups, strict=True) if group in member]
        names = dict.fromkeys(name for row in chosen for name in row)
        result = {}
        for name in names:
            values = [row[name] for row in chosen if name in row]
            result[name] = round(float(np.mean(values)), 5)
            if name in MEDIANS:
                result[f"{name}_median"] = round(float(np.median(values)), 5)
        return result

    def count(self, group: str) -> int:
        """Pairs in a group."""
        return sum(group in member for member in self.groups)

    def difference(self, better: str, worse: str, name: str) -> dict[str, float]:
        """Mean of better minus worse over pairs, its standard error, and the share of pairs where it is above 0."""
        both = zip(self.rows[better], self.rows[worse], strict=True)
        d = np.array([a[name] - b[name] for a, b in both if name in a and name in b])
        error = d.std(ddof=1) / np.sqrt(len(d)) if len(d) > 1 else 0.0
        return {
            "mean": round(float(d.mean()), 5),
            "standard_error": round(float(error), 5),
            "share_above": round(float((d > 0).mean()), 3),
        }


def study(
    pairs: Iterable[Pair],
    methods: Mapping[str, Method],
    watch: Callable[[int, Pair, dict[str, Estimate]], None] | None = None,
) -> Study:
    """Score every method on every pair; watch sees each pair with the estimates as it is done."""
    result = Study(seconds=dict.fromkeys(methods, 0.0))
    for index, pair in enumerate(pairs):
        estimates = {}
        for name, method in methods.items():
            start = time.perf_counter()
            estimates[name] = method(pair)
            result.seconds[name] += time.perf_counter() - start
        result.add(pair, score_pair(pair, estimates))
        if watch is not None:
            watch(index, pair, estimates)
    return result
