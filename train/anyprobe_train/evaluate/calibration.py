"""Calibration of the confidence that a model claims, over many maps."""

from collections.abc import Iterable

import numpy as np

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe_train.evaluate.scoring import GROUPS

NEAREST = 1e-4
"""Smallest distance of a confidence from 0 and 1 when its logit or logarithm is taken."""
CLOSE = 0.1
"""Largest mean absolute difference over channels at which a display value counts as right."""
BINS = 10
"""Number of bins of the calibration error; docs and model cards quote it over these."""
FINE = 100
"""Number of bins that are stored: two claims in one bin count as equal in the AUC."""


class Calibration:
    """Counts, over many maps and weighted by solid angle, of how often pixels of each confidence are right.

    By the groups of evaluate.scoring. What is kept does not grow with the maps.
    """

    def __init__(self) -> None:
        self._sums = {name: np.zeros((5, FINE)) for name in GROUPS}

    def add(self, confidence: np.ndarray, ldr: np.ndarray, true_ldr: np.ndarray, groups: Iterable[str] = ()) -> None:
        """Add one map: confidence [H, 2H] in [0, 1], estimated and true display values [H, 2H, 3].

        groups: those that its pair belongs to; "all" goes without saying.
        """
        right = np.abs(np.asarray(ldr, np.float64) - true_ldr).mean(axis=-1) < CLOSE
        weight = np.broadcast_to(pixel_solid_angles(len(right)), right.shape)
        bins = np.minimum((confidence * FINE).astype(int), FINE - 1)
        probability = np.where(right, confidence, 1.0 - confidence)
        surprise = -np.log(np.clip(probability, NEAREST, 1.0))
        values = (weight, weight * confidence, weight * right, weight * (1 - probability) ** 2, weight * surprise)
        sums = np.stack([np.bincount(bins.ravel(), value.ravel(), minlength=FINE) for value in values])
        for name in {"all", *groups}:
            self._sums[name] += sums

    def result(self) -> dict | None:
        """Return `figures` of all maps, their bins, and `figures` of each group that occurs; None before the first map.

        bins: [share of the sphere, claimed, right] of each of ten, those that occur.
        """
        whole = self._sums["all"]
        if not whole.any():
            return None
        total, _, right = whole[:3].sum(axis=1)
        constant = right / total
        return {
            **figures(whole, constant),
            "bins": [[_short(w / total), _short(c / w), _short(r / w)] for w, c, r in _tens(whole[:3]).T if w > 0],
            "groups": {
                name: figures(sums, constant) for name, sums in self._sums.items() if name != "all" and sums.any()
            },
        }


def figures(sums: np.ndarray, constant: float) -> dict:
    """Score claims, and the best constant claim for comparison.

    The constant is the share of right pixels over all pairs: an oracle, unknown beforehand. Over all pairs it has no
    calibration error, within a group it may; it ranks nothing, so its AUC is 0.5.

    Args:
        sums: [5, FINE] by bins of the claim: weight, and weight times claimed, right, squared error and surprise.
    Returns:
        claimed, right: means.
        error: mean of |claimed - right| over ten bins (ECE). brier: mean of (claimed - right)^2.
        log_loss: mean of -ln of the probability claimed for the outcome [nats], at most -ln NEAREST.
        auc: chance that a right pixel has a larger claim than a wrong one; None where all are right, or none.
        constant: the same scores of the constant.
    """
    total = sums[0].sum()
    _, claimed, right, squares, surprise = sums.sum(axis=1) / total
    tens = _tens(sums[:3]) / total
    clipped = np.clip([constant, 1 - constant], NEAREST, 1.0)
    return {
        "claimed": _short(claimed),
        "right": _short(right),
        "error": _short(np.abs(tens[1] - tens[2]).sum()),
        "brier": _short(squares),
        "log_loss": _short(surprise),
        "auc": _auc(sums[0], sums[2]),
        "constant": {
            "claimed": _short(constant),
            "error": _short(abs(constant - right)),
            "brier": _short(right * (1 - constant) ** 2 + (1 - right) * constant**2),
            "log_loss": _short(-np.dot([right, 1 - right], np.log(clipped))),
            "auc": 0.5,
        },
    }


def _tens(sums: np.ndarray) -> np.ndarray:
    """Sum [N, FINE] over the bins of the calibration error, [N, BINS]."""
    return sums.reshape(len(sums), BINS, -1).sum(axis=-1)


def _auc(weight: np.ndarray, right: np.ndarray) -> float | None:
    """Compute the AUC of bins in the order of their claims; ties within a bin count half."""
    wrong = weight - right
    pairs = right.sum() * wrong.sum()
    return _short((right * (np.cumsum(wrong) - wrong / 2)).sum() / pairs) if pairs > 0 else None


def _short(value: float) -> float:
    return round(float(value), 4) + 0.0  # not -0
