"""What limits the irradiance image (Eq. 5): its error before and after the best gain, surface by surface.

A gain is what a photo cannot tell, since a brighter light on a darker object looks the same. What
the best one takes away is that; what it leaves is shape. The gain is in linear units: display
values go through the inverse of the mean camera curve, are multiplied and go back, clipped at 1.
It is the one within +-GAIN_BOUND stops that gives the smallest RMSE of display values, by a search.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from anyprobe.core.response import inverse_response, response
from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.metrics import rmse, ssim
from anyprobe.evaluate.panel import Estimate

PHOTO = "photo"
"""The method that takes the photo for the irradiance image."""
GAIN_BOUND = 3.0
"""Stops, up and down."""
GAIN_STEP = 0.5
GAIN_TOLERANCE = 1e-3
ALPHA_EDGES = (0.0, 0.1, 0.5, 1.01)
STAGES = ("", "gain_", "channel_")
"""Before each figure's name: as it is, after one gain a picture, after one a channel."""
NOTE = (
    "Irradiance images against the truth: 128 x 128 display values, whole picture, means over pairs. Gain: one "
    f"factor a picture in linear units, within {GAIN_BOUND:g} stops, that gives the smallest RMSE of display "
    "values, found knowing the truth; channel: one such factor for each of red, green and blue. Explained: the "
    "share of the squared error, over all pairs of the group, that this takes away. Photo: the photo itself "
    "taken for the irradiance image. Metals have no diffuse albedo."
)


SURFACES = {
    kind: tuple(
        f"{kind}, alpha {low:g}-{min(high, 1.0):g}"
        for low, high in zip(ALPHA_EDGES[:-1], ALPHA_EDGES[1:], strict=True)
    )
    for kind in ("metal", "dielectric")
}
GROUPS = ("all", *(name for kind, bins in SURFACES.items() for name in (kind, *bins)))


def surface_groups(pair: Pair) -> tuple[str, str, str]:
    """ "all", "metal" or "dielectric", and that with its bin of alpha: "metal, alpha 0-0.1"."""
    kind = "metal" if float(np.max(pair.material.albedo)) == 0 else "dielectric"
    bins = zip(SURFACES[kind], ALPHA_EDGES[1:], strict=True)
    return "all", kind, next(name for name, high in bins if pair.material.alpha < high)


class IrradianceLimits:
    """Figures of the photo and of the named methods, which must have an irradiance image; `add` each pair."""

    def __init__(self, methods: Iterable[str]) -> None:
        self._methods = tuple(dict.fromkeys(methods))
        self._rows: list[tuple[tuple[str, ...], dict[str, dict[str, float]]]] = []

    def add(self, pair: Pair, estimates: Mapping[str, Estimate]) -> None:
        """One pair, with the estimates of every method by name."""
        truth = pair.irradiance / 255.0
        pictures = {PHOTO: pair.crop[..., :3] * pair.crop[..., 3:]}
        pictures |= {name: estimates[name].irradiance for name in self._methods}
        scores = {name: _scores(one, truth) for name, one in pictures.items()}
        self._rows.append((surface_groups(pair), scores))

    def result(self) -> dict[str, Any]:
        """groups: name -> {"pairs": count, "rows": one a method}; groups without a pair are left out."""
        groups = {}
        for group in GROUPS:
            chosen = [scores for names, scores in self._rows if group in names]
            if chosen:
                rows = [_row(name, [scores[name] for scores in chosen]) for name in (PHOTO, *self._methods)]
                groups[group] = {"pairs": len(chosen), "rows": rows}
        return {"note": NOTE, "groups": groups}


def apply_gain(display: np.ndarray, stops: float) -> np.ndarray:
    """Display values as if the light behind them were 2^stops as bright, clipped at 1."""
    return response(inverse_response(display) * 2.0**stops)


def best_gain(display: np.ndarray, truth: np.ndarray) -> float:
    """The gain [stops] within +-GAIN_BOUND after which display values have the smallest RMSE; 0 for black."""
    lit = display > 0  # the rest no gain changes
    if not lit.any():
        return 0.0
    linear, wanted = inverse_response(display[lit]), truth[lit]

    def error(stops: float) -> float:
        return float(np.square(response(linear * 2.0**stops) - wanted).mean())

    grid = np.linspace(-GAIN_BOUND, GAIN_BOUND, round(2 * GAIN_BOUND / GAIN_STEP) + 1)
    start = float(grid[np.argmin([error(stops) for stops in grid])])
    found = _golden(error, max(start - GAIN_STEP, -GAIN_BOUND), min(start + GAIN_STEP, GAIN_BOUND))
    return min((start, found), key=error)


def _golden(f: Callable[[float], float], low: float, high: float) -> float:
    """Where f, with one minimum between low and high, has it: golden section search."""
    ratio = (math.sqrt(5.0) - 1.0) / 2.0
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = f(left), f(right)
    while high - low > GAIN_TOLERANCE:
        if at_left < at_right:
            high, right, at_right = right, left, at_left
            left = high - ratio * (high - low)
            at_left = f(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + ratio * (high - low)
            at_right = f(right)
    return (low + high) / 2.0


def _scores(estimate: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Of one picture [128, 128, 3]: RMSE and SSIM at each stage, and the gain's size [stops]."""
    gain = best_gain(estimate, truth)
    channels = [apply_gain(estimate[..., k], best_gain(estimate[..., k], truth[..., k])) for k in range(3)]
    scores = {"gain_stops": abs(gain)}
    stages = (estimate, apply_gain(estimate, gain), np.stack(channels, axis=-1))
    for stage, picture in zip(STAGES, stages, strict=True):
        scores |= {f"{stage}rmse": rmse(picture, truth), f"{stage}ssim": ssim(picture, truth)}
    return scores


def _row(method: str, scores: list[dict[str, float]]) -> dict[str, Any]:
    means = {name: round(float(np.mean([one[name] for one in scores])), 5) for name in scores[0]}
    squared = [sum(one[f"{stage}rmse"] ** 2 for one in scores) for stage in STAGES]
    for stage, left in zip(STAGES[1:], squared[1:], strict=True):
        means[f"{stage}explained"] = round(1.0 - left / squared[0], 5) if squared[0] > 0 else 0.0
    return {"design": method, **means}
