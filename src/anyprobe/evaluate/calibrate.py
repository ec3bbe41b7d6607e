"""Calibrate (verb): how sure a model may be, told by pairs that it has not learned from."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.dataset.plan import balanced_recipes
from anyprobe.dataset.stock import load_left_out
from anyprobe.errors import ModelError
from anyprobe.evaluate.calibration import fit_logit, right_of
from anyprobe.evaluate.kept_pairs import kept_pairs
from anyprobe.infer.runtime import Models

PAIRS = 240
SEED = 78


def left_out_pairs(data: Path, kept: Path | None = None, conditions: int = 0) -> Iterable[Pair]:
    """Pairs of the training assets that no shipped weights learn from; InputError where there are none.

    conditions: 0 for clean photos, 1 as the world gives them.
    """
    stock = load_left_out(data)
    return kept_pairs(balanced_recipes(stock, PAIRS, SEED, conditions), stock, kept)


def calibrate(models: Models, pairs: Iterable[Pair]) -> tuple[float, float]:
    """Slope and offset that the logit of a model's confidence should have had; ModelError if it has no confidence."""
    confidence, right = [], []
    for pair in pairs:
        outputs = models(pair.crop, pair.tan_half)
        if outputs.confidence is None:
            raise ModelError(
                f"{models.name}: expected a model that tells its confidence, got one that does not"
            )
        confidence.append(outputs.confidence)
        right.append(right_of(outputs.ldr.clip(0.0, 1.0), response(pair.radiance)))
    claimed = np.stack(confidence)
    weight = np.broadcast_to(pixel_solid_angles(claimed.shape[1]), claimed.shape)
    return fit_logit(claimed, np.stack(right), weight)
