"""Errors that a model states of an object and of a light's level and colour, beside the true ones."""

from __future__ import annotations

import numpy as np

from anyprobe.errors import ModelError
from anyprobe.estimate.light_graph import Said
from anyprobe.light.environment import integral
from anyprobe.scatter.materials import LEAST_REFLECTANCE, total_reflectance
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.evaluate.metrics import power_ratio_stops


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
