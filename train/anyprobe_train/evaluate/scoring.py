"""Scores of methods on test pairs: figures per pair, then means over groups of pairs."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.light.environment import integral
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.render.spheres import sphere_images, sphere_normals
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.evaluate.methods import Estimate, Method
from anyprobe_train.evaluate.metrics import (
    color_angle_deg,
    direction_error_deg,
    gain_rmse,
    power_ratio_stops,
    psnr,
    rmse,
    si_rmse,
    ssim,
)
from anyprobe_train.evaluate.standard_errors import clustered_error, rounded

FROZEN = Path(str(resources.files("anyprobe_train") / "evaluate" / "frozen.txt"))
"""List of 1,000 recipes over held-out maps and shapes; they never change."""
OF_FROZEN = (
    "fetch what can be had in a clone with anyprobe-train data test DIR, and give "
    "--recipes DIR/frozen_public.txt instead"
)
"""Advice to those who lack the assets of the frozen set."""
ALPHA_EDGES = (0.0, 0.1, 0.25, 0.5, 0.75, 1.01)
"""Borders of the roughness bins; 0.5 is the paper's border of specular and diffuse."""
ONE_LIGHT = 0.3
"""Smallest share of all light at which one light dominates a map."""
SHINY = 0.3
"""Alpha below which an object shows emitters as highlights."""

Group = Callable[[Pair, bool], bool]
"""Predicate of whether a pair belongs to a group; its flag: one light dominates the true map."""


def dominant_light_share(radiance: np.ndarray) -> float:
    """Compute the dominant light's share of a map's power, by luminance: E on a plane facing it / all light."""
    total = float(luminance(integral(radiance.astype(np.float64))))
    return float(luminance(find_dominant_light(radiance).irradiance)) / max(total, 1e-9)


def _alpha_within(low: float, high: float) -> Group:
    return lambda pair, single: low <= pair.material.alpha < high


GROUPS: dict[str, Group] = {
    "all": lambda pair, single: True,
    "specular": lambda pair, single: pair.specular,
    "diffuse": lambda pair, single: not pair.specular,
    "indoor": lambda pair, single: pair.indoor,
    "outdoor": lambda pair, single: not pair.indoor,
    **{f"alpha {low:g}-{min(high, 1.0):g}": _alpha_within(low, high) for low, high in pairwise(ALPHA_EDGES)},
    "one light": lambda pair, single: single,
    "one light, shiny": lambda pair, single: single and pair.material.alpha < SHINY,
    "one light, diffuse": lambda pair, single: single and not pair.specular,
}


def groups_of(pair: Pair) -> set[str]:
    """Return the names of the groups that a pair belongs to."""
    single = dominant_light_share(pair.radiance) >= ONE_LIGHT
    return {name for name, belongs in GROUPS.items() if belongs(pair, single)}


LN_FLOOR = 1e-3
"""Smallest radiance in the log-HDR error [of the photo's white]."""

HEADINGS = {
    "ldr_rmse": "LDR RMSE",
    "ldr_gain_rmse": "after best gain",
    "ln_hdr_rmse": "ln HDR RMSE",
    "angle_diffuse_deg": "colour angle, white",
    "angle_silver_deg": "silver",
    "angle_mirror_deg": "mirror",
    "si_rmse_diffuse": "si-RMSE, white",
    "si_rmse_silver": "silver",
    "dominant_light_deg": "dominant light, mean",
    "dominant_light_median_deg": "median",
    "total_power_stops": "power, stops, mean",
    "total_power_median_stops": "median",
    "ldr_ssim": "LDR SSIM",
}
"""Printed metrics, with the headings of docs/explanation/results.md; the others are in scores.json."""

_HIGHER, _UNPRINTED = ("ldr_psnr", "ldr_ssim"), ("ldr_psnr", "si_rmse_mirror", "ldr_rmse_seen", "ldr_rmse_unseen")
METRICS = {name: "higher" if name in _HIGHER else "lower" for name in (*HEADINGS, *_UNPRINTED)}
"""Reported metrics, and which way is better. All are means over pairs but those named median.

seen: the half of the map behind the camera, which the object faces; unseen: the half behind the object.
"""

MEDIANS = {"dominant_light_median_deg": "dominant_light_deg", "total_power_median_stops": "total_power_stops"}


def score(estimate: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Compute all metrics of one estimated map against the true one, both [H, 2H, 3] in exposure units.

    LDR figures are of response(L), every pixel counted alike, as in the paper. Spheres are
    rendered linear, without tone mapping.
    """
    ldr, true_ldr = response(estimate), response(truth)
    seen = pixel_directions(truth.shape[0])[..., 2] > 0
    scores = {
        "ldr_psnr": psnr(ldr, true_ldr),
        "ldr_rmse": rmse(ldr, true_ldr),
        "ldr_gain_rmse": gain_rmse(estimate, truth),
        "ldr_ssim": ssim(ldr, true_ldr),
        "ln_hdr_rmse": rmse(np.log(np.maximum(estimate, LN_FLOOR)), np.log(np.maximum(truth, LN_FLOOR))),
        "dominant_light_deg": direction_error_deg(
            find_dominant_light(estimate).direction, find_dominant_light(truth).direction
        ),
        "total_power_stops": abs(power_ratio_stops(estimate, truth)),
        "ldr_rmse_seen": rmse(ldr[seen], true_ldr[seen]),
        "ldr_rmse_unseen": rmse(ldr[~seen], true_ldr[~seen]),
    }
    spheres, true_spheres = sphere_images(estimate), sphere_images(truth)
    for name, sphere in true_spheres.items():
        mask = sphere_normals()[1]
        scores[f"angle_{name}_deg"] = color_angle_deg(spheres[name], sphere, mask)
        # in units of the true sphere's mean, or a bright scene would outweigh the rest
        scores[f"si_rmse_{name}"] = si_rmse(spheres[name], sphere, mask) / max(float(sphere[mask].mean()), 1e-8)
    return {name: float(value) for name, value in scores.items()}


def score_radiance(pair: Pair, estimates: Mapping[str, Estimate]) -> dict[str, dict[str, float]]:
    """Score every method's radiance with `score`."""
    return {name: score(one.lights, pair.radiance) for name, one in estimates.items()}


Scorer = Callable[[Pair, Mapping[str, Estimate]], dict[str, dict[str, float]]]
"""Function from a pair and every method's estimate to figures by method, so that work on the truth is done once."""


@dataclass(kw_only=True)
class Scores:
    """Figures of every method on every pair, the groups each pair belongs to, and its map and shape."""

    rows: dict[str, list[dict[str, float]]] = field(default_factory=dict)
    groups: list[set[str]] = field(default_factory=list)
    maps: list[str] = field(default_factory=list)
    shapes: list[str] = field(default_factory=list)

    def add(self, pair: Pair, figures: Mapping[str, dict[str, float]]) -> None:
        """Add one pair's figures by method."""
        self.groups.append(groups_of(pair))
        self.maps.append(pair.map_name)
        self.shapes.append(pair.shape_name)
        for method, row in figures.items():
            self.rows.setdefault(method, []).append(row)

    def table(self) -> dict[str, dict[str, dict[str, float]]]:
        """Return the means: method -> group -> metric; groups without a pair are left out."""

        def means(method: str, chosen: list[int]) -> dict[str, float]:
            rows = [self.rows[method][index] for index in chosen]
            result = {name: float(np.mean([row[name] for row in rows])) for name in rows[0]}
            for name, source in MEDIANS.items():
                result[name] = float(np.median([row[source] for row in rows]))
            return {name: round(result[name], 5) for name in METRICS}

        return self._by_group(means)

    def standard_errors(self) -> dict[str, dict[str, dict[str, float | None]]]:
        """Return standard errors of the means of `table`, clustered by map and shape: method -> group -> metric;
        None for a single map and shape."""

        def errors(method: str, chosen: list[int]) -> dict[str, float | None]:
            clusters = [self.maps[index] for index in chosen], [self.shapes[index] for index in chosen]
            return {
                name: rounded(clustered_error([self.rows[method][index][name] for index in chosen], *clusters), 5)
                for name in METRICS
                if name not in MEDIANS
            }

        return self._by_group(errors)

    def _by_group(self, of: Callable[[str, list[int]], dict[str, Any]]) -> dict[str, dict[str, dict[str, Any]]]:
        """Return what `of` makes of each method and of the numbers of each group's pairs, if it has any."""
        chosen = {group: [k for k, member in enumerate(self.groups) if group in member] for group in GROUPS}
        return {name: {group: of(name, some) for group, some in chosen.items() if some} for name in self.rows}


def score_pairs(
    pairs: Iterable[Pair],
    methods: Mapping[str, Method],
    scorer: Scorer = score_radiance,
    watch: Callable[[int, Pair, dict[str, Estimate]], None] | None = None,
) -> Scores:
    """Score every method on every pair; watch sees each pair with its estimates once it is scored."""
    scores = Scores()
    for index, pair in enumerate(pairs):
        estimates = {name: method(pair) for name, method in methods.items()}
        scores.add(pair, scorer(pair, estimates))
        if watch is not None:
            watch(index, pair, estimates)
    return scores
