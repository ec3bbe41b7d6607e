"""Calibration (noun): does a confidence of 0.7 mean right in seven of ten?"""

from __future__ import annotations

import numpy as np

from anyprobe.core.latlong import pixel_solid_angles

NEAREST = 1e-4
"""How near to 0 and 1 a confidence may come before its logit is taken."""
CLOSE = 0.1
"""Right is a display value, mean over channels of the absolute difference, within this."""
BINS = 10


class Calibration:
    """Counts, over many maps and weighted by solid angle, how often pixels of each confidence are right."""

    def __init__(self) -> None:
        self._weight = np.zeros(BINS)
        self._claimed = np.zeros(BINS)
        self._right = np.zeros(BINS)

    def add(self, confidence: np.ndarray, ldr: np.ndarray, true_ldr: np.ndarray) -> None:
        """One map: confidence [H, 2H] in [0, 1], estimated and true display values [H, 2H, 3]."""
        right = right_of(ldr, true_ldr)
        weight = np.broadcast_to(pixel_solid_angles(len(right)), right.shape).ravel()
        which = np.minimum((confidence * BINS).astype(int), BINS - 1).ravel()
        for sums, values in (
            (self._weight, weight),
            (self._claimed, weight * confidence.ravel()),
            (self._right, weight * right.ravel()),
        ):
            sums += np.bincount(which, values, minlength=BINS)

    def result(self) -> dict | None:
        """error: mean over the sphere of |claimed - true| by bins (ECE); right and claimed: the means;
        bins: [share of the sphere, claimed, right] of each, those that occur. None before the first map."""
        total = self._weight.sum()
        if total == 0:
            return None
        seen = self._weight > 0
        gap = np.abs(self._claimed - self._right)
        return {
            "error": round(float(gap.sum() / total), 4),
            "claimed": round(float(self._claimed.sum() / total), 4),
            "right": round(float(self._right.sum() / total), 4),
            "bins": [
                [round(float(w / total), 4), round(float(c / w), 4), round(float(r / w), 4)]
                for w, c, r in zip(self._weight[seen], self._claimed[seen], self._right[seen], strict=True)
            ],
        }


def right_of(ldr: np.ndarray, true_ldr: np.ndarray) -> np.ndarray:
    """Where display values [..., 3] are close to the true ones."""
    return np.abs(np.asarray(ldr, np.float64) - true_ldr).mean(axis=-1) < CLOSE


def fit_logit(confidence: np.ndarray, right: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Slope and offset of the logit that make confidences as likely as can be (Platt 1999), by Newton's method.

    Args:
        confidence in [0, 1], right (bool) and weight, of one shape.
    """
    logit = to_logit(confidence.ravel().astype(np.float64))
    rows = np.stack([logit, np.ones_like(logit)])  # [2, N]
    right, weight = right.ravel(), weight.ravel()
    line = np.array([1.0, 0.0])
    for _ in range(20):
        guess = 1 / (1 + np.exp(-line @ rows))
        slope = rows @ (weight * (guess - right))
        bend = (rows * (weight * guess * (1 - guess))) @ rows.T
        line = line - np.linalg.solve(bend, slope)
    return float(line[0]), float(line[1])


def to_logit(confidence: np.ndarray) -> np.ndarray:
    """ln c / (1 - c), finite."""
    c = np.clip(confidence, NEAREST, 1 - NEAREST)
    return np.log(c / (1 - c))
