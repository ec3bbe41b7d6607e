"""What is scored on a whole photo: baselines, the estimate with more and more of the photo, and parts of the truth."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.photo import load_photo
from anyprobe.estimate.result import Light
from anyprobe_train.evaluate.methods import mean_map
from research.world.whole_photos import WholePhoto

SHIPPED = "as shipped"


def predicted_rows(photo: WholePhoto, name: str, maps: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Maps [64, 128, 3] of another program, by recipe key, beside the mean map."""
    return {"mean map": mean_map(), name: maps[photo.recipe.key]}


def rows_of(photo: WholePhoto, estimator: Estimator) -> dict[str, np.ndarray | Light]:
    """Return maps [64, 128, 3] in the photo's camera, or estimates, by row.

    The mask is given, and the lens where EXIF says it.
    """
    mask = None if photo.cut_out == "alpha" else (255 * photo.mask).astype(np.uint8)
    given = {"mask": mask, "fov_deg": photo.long_fov_deg if photo.fov_known else None}

    def estimate(who: Estimator = estimator, **more) -> Light:
        return who(load_photo(photo.picture, **given, **more))

    rows: dict[str, np.ndarray | Light] = {
        "mean map": mean_map(),
        "object alone": estimate(surroundings="none"),
        SHIPPED: (shipped := estimate()),
    }
    if photo.cut_out:
        return rows
    rows["as shipped, pitch given"] = estimate(pitch_deg=photo.pitch_deg)
    below = (pixel_directions(len(photo.truth)) @ up_of(photo.pitch_deg, photo.roll_deg) < 0)[..., None]
    rows["and the truth below the horizon"] = np.where(below, photo.truth, shipped.radiance)
    rows["and the truth above the horizon instead"] = np.where(below, shipped.radiance, photo.truth)
    return rows
