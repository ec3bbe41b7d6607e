"""What is compared besides the trained designs: baselines and shipped models."""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.baselines import chrome_ball, mean_map
from anyprobe.evaluate.panel import Estimate, Method
from anyprobe.infer.runtime import Models, model_id


def baselines() -> dict[str, Method]:
    """The mean training map, and the object taken for a chrome ball."""

    def of(radiance: np.ndarray) -> Estimate:
        return Estimate(ldr=response(radiance), radiance=radiance)

    return {
        "mean map": lambda pair: of(mean_map()),
        "chrome ball": lambda pair: of(chrome_ball(pair.crop)),
    }


def shipped(model: str) -> tuple[Method, dict[str, str]]:
    """A bundled model or a folder of graphs, and what identifies it."""
    models = Models(model)

    def method(pair: Pair) -> Estimate:
        outputs = models(pair.crop, pair.tan_half)
        return Estimate(
            ldr=outputs.ldr.clip(0.0, 1.0), radiance=outputs.radiance, irradiance=outputs.irradiance
        )

    return method, {"model": model_id(model)}
