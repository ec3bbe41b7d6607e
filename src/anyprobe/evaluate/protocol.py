"""Score methods on the test set: per pair, then means over all and over each half."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.groups import GROUPS, groups_of
from anyprobe.evaluate.metrics import (
    color_angle_deg,
    direction_error_deg,
    flux_ratio_stops,
    psnr,
    rmse,
    si_rmse,
    ssim,
)
from anyprobe.light.main_light import find_main_light
from anyprobe.render.balls import ball_images, ball_normals

LN_FLOOR = 1e-3
"""Radiance below this counts as this in the log-HDR error: 0.001 of the photo's white."""

METRICS = {
    "ldr_psnr": "higher",
    "ldr_rmse": "lower",
    "ldr_ssim": "higher",
    "ln_hdr_rmse": "lower",
    "angle_diffuse_deg": "lower",
    "angle_silver_deg": "lower",
    "angle_mirror_deg": "lower",
    "si_rmse_diffuse": "lower",
    "si_rmse_silver": "lower",
    "si_rmse_mirror": "lower",
    "main_light_deg": "lower",
    "main_light_median_deg": "lower",
    "flux_stops": "lower",
    "flux_median_stops": "lower",
    "ldr_rmse_seen": "lower",
    "ldr_rmse_unseen": "lower",
}
"""What is reported, and which way is better. All are means over pairs but those named median.

seen: the half of the map behind the camera, which the object faces; unseen: the half behind the object.
"""

MEDIANS = {"main_light_median_deg": "main_light_deg", "flux_median_stops": "flux_stops"}

Method = Callable[[Pair], np.ndarray]
"""From a pair (of which it may look at the photo only) to radiance [64, 128, 3]."""


def score(estimate: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """All metrics of one estimated map against the true one, both [H, 2H, 3] in exposure units.

    LDR figures are of response(L), every pixel counted alike, as in the paper. Balls are
    rendered linear, without tone mapping.
    """
    ldr, true_ldr = response(estimate), response(truth)
    seen = pixel_directions(truth.shape[0])[..., 2] > 0
    scores = {
        "ldr_psnr": psnr(ldr, true_ldr),
        "ldr_rmse": rmse(ldr, true_ldr),
        "ldr_ssim": ssim(ldr, true_ldr),
        "ln_hdr_rmse": rmse(np.log(np.maximum(estimate, LN_FLOOR)), np.log(np.maximum(truth, LN_FLOOR))),
        "main_light_deg": direction_error_deg(
            find_main_light(estimate).direction, find_main_light(truth).direction
        ),
        "flux_stops": abs(flux_ratio_stops(estimate, truth)),
        "ldr_rmse_seen": rmse(ldr[seen], true_ldr[seen]),
        "ldr_rmse_unseen": rmse(ldr[~seen], true_ldr[~seen]),
    }
    balls, true_balls = ball_images(estimate), ball_images(truth)
    for name, ball in true_balls.items():
        mask = ball_normals()[1]
        scores[f"angle_{name}_deg"] = color_angle_deg(balls[name], ball, mask)
        # in units of the true ball's mean, or a bright scene would outweigh the rest
        scores[f"si_rmse_{name}"] = si_rmse(balls[name], ball, mask) / max(float(ball[mask].mean()), 1e-8)
    return {name: float(value) for name, value in scores.items()}


@dataclass(kw_only=True)
class Scores:
    """Scores of every method on every pair, and which groups the pair belongs to."""

    rows: dict[str, list[dict[str, float]]] = field(default_factory=dict)
    groups: list[set[str]] = field(default_factory=list)

    def table(self) -> dict[str, dict[str, dict[str, float]]]:
        """Means: method -> group -> metric; groups without a pair are left out."""
        result: dict[str, dict[str, dict[str, float]]] = {}
        for method, rows in self.rows.items():
            result[method] = {}
            for group in GROUPS:
                chosen = [row for row, member in zip(rows, self.groups, strict=True) if group in member]
                if not chosen:
                    continue
                means = {name: float(np.mean([row[name] for row in chosen])) for name in chosen[0]}
                for name, source in MEDIANS.items():
                    means[name] = float(np.median([row[source] for row in chosen]))
                result[method][group] = {name: round(means[name], 5) for name in METRICS}
        return result


def run(
    pairs: Iterable[Pair], methods: dict[str, Method], watch: Callable[[int, Pair, dict], None] | None = None
) -> Scores:
    """Score every method on every pair; watch sees each pair with its maps as it is done."""
    scores = Scores(rows={name: [] for name in methods})
    for index, pair in enumerate(pairs):
        maps = {name: method(pair) for name, method in methods.items()}
        for name, radiance in maps.items():
            scores.rows[name].append(score(radiance, pair.radiance))
        scores.groups.append(groups_of(pair))
        if watch is not None:
            watch(index, pair, maps)
    return scores
