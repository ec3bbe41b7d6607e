"""Calibrate: make a model's confidence and the errors that it claims true on pairs that no weights learn from."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.errors import ModelError
from anyprobe.estimate.light_graph import Said
from anyprobe.estimate.runtime import Models
from anyprobe.light.environment import integral
from anyprobe.scatter.materials import LEAST_REFLECTANCE, total_reflectance
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.evaluate.calibration import NEAREST, right_of
from anyprobe_train.evaluate.methods import run_with_hints
from anyprobe_train.evaluate.metrics import power_ratio_stops

INTERVAL = 0.68
"""Share of cases in which an error is at most what is claimed."""


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


def claimed_errors(said: Said) -> np.ndarray:
    """Return the errors that a model states: of ln reflectance, of ln of the level, degrees of the mean colour."""
    if said.object_material is None or said.errors is None:
        raise ModelError("expected a model that estimates its errors, got one that does not")
    return np.array([said.object_material[4], *said.errors[1:]])


def true_errors(outputs: Said, pair: Pair) -> np.ndarray:
    """Return what claimed_errors are of."""
    given = pair.material
    reflectance = np.asarray(outputs.object_material)[1:4]
    true = np.maximum(total_reflectance(given.albedo, given.f0), LEAST_REFLECTANCE)
    means = [integral(np.asarray(one, np.float64)) for one in (outputs.radiance, pair.radiance)]
    cosine = np.dot(*means) / np.prod([np.linalg.norm(mean) for mean in means])
    return np.array(
        [
            np.abs(np.log(reflectance / true)).mean(),
            abs(np.log(2.0) * power_ratio_stops(outputs.radiance, pair.radiance)),
            np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))),
        ]
    )


def calibrate_errors(models: Models, pairs: Iterable[Pair]) -> tuple[float, float, float]:
    """Factors that make the claimed errors hold in INTERVAL of the cases, each pair given nothing and its material."""
    ratios = []
    for pair in pairs:
        for given in (set(), {"material"}):
            said = run_with_hints(models, pair, given)
            claimed = claimed_errors(said)
            ratios.append(true_errors(said, pair) / claimed)
    first, second, third = np.quantile(ratios, INTERVAL, axis=0).tolist()
    return first, second, third


def calibrate(models: Models, pairs: Iterable[Pair]) -> tuple[float, float]:
    """Slope and offset that the logit of a model's confidence should have had; ModelError if it has no confidence."""
    confidence, right = [], []
    for pair in pairs:
        outputs = run_with_hints(models, pair)
        if outputs.confidence is None:
            raise ModelError(
                "expected a model that estimates its confidence, got one that does not", source=models.name
            )
        confidence.append(outputs.confidence)
        right.append(right_of(response(outputs.radiance), response(pair.radiance)))
    claimed = np.stack(confidence)
    weight = np.broadcast_to(pixel_solid_angles(claimed.shape[1]), claimed.shape)
    return fit_logit(claimed, np.stack(right), weight)
