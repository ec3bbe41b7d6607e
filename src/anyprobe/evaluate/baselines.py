"""Two ways to guess without a network; an estimator that does not beat them has learned nothing."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources

import numpy as np

from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import inverse_response
from anyprobe.files.radiance import read_radiance
from anyprobe.light.environment import MAP_HEIGHT


@lru_cache(maxsize=1)
def mean_map() -> np.ndarray:
    """Geometric mean of the training maps in the camera's frame and the photo's exposure units, [64, 128, 3].

    Written with the weights, from the pairs they were trained on.
    """
    return read_radiance(str(resources.files("anyprobe") / "weights" / "mean_map.exr"))


def chrome_ball(photo: np.ndarray) -> np.ndarray:
    """Take the object for a chrome ball and unwrap it: photo [S, S, 4] -> radiance [64, 128, 3].

    The ball is as large as the longer side of the mask's bounding box. Where it has
    no pixel of the object the object's mean stands in.
    """
    mask = photo[..., 3] > 0.5
    rows, columns = np.nonzero(mask)
    centre = np.array([columns.min() + columns.max() + 1, rows.min() + rows.max() + 1]) / 2
    radius = max(np.ptp(columns), np.ptp(rows)) / 2 + 0.5
    radiance = inverse_response(photo[..., :3])
    d = pixel_directions(MAP_HEIGHT)
    n = normalize(d + np.array([0.0, 0.0, 1.0], np.float32))  # reflect(+Z, n) = d
    x = np.clip((centre[0] + n[..., 0] * radius).astype(int), 0, mask.shape[1] - 1)
    y = np.clip((centre[1] - n[..., 1] * radius).astype(int), 0, mask.shape[0] - 1)
    mean = radiance[mask].mean(axis=0)
    return np.where(mask[y, x][..., None], radiance[y, x], mean).astype(np.float32)
