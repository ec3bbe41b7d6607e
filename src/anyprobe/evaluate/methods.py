"""What is compared besides the trained designs: baselines and shipped models, and what these do when told more."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.evaluate.baselines import chrome_ball, mean_map
from anyprobe.evaluate.panel import Estimate, Method
from anyprobe.infer.known_material import use_material
from anyprobe.infer.known_normals import SHORTEST
from anyprobe.infer.runtime import LIFT_STAGES, NORMALS_SIZE, Models, Outputs, model_id

TOLD = {"normals": {"normals"}, "material": {"material"}, "normals and material": {"normals", "material"}}
"""What a model may be told beside the photo, by the name of the row."""


def baselines() -> dict[str, Method]:
    """The mean training map, and the object taken for a chrome ball."""

    def of(radiance: np.ndarray) -> Estimate:
        return Estimate(ldr=response(radiance), radiance=radiance)

    return {
        "mean map": lambda pair: of(mean_map()),
        "chrome ball": lambda pair: of(chrome_ball(pair.crop)),
    }


def run_told(models: Models, pair: Pair, told: set[str]) -> Outputs:
    """A model's answer where the pair's true normals, its true material or both are told."""
    normals = true_normals(pair) if "normals" in told else None
    outputs = models(pair.crop, pair.tan_half, normals)
    if "material" not in told:
        return outputs
    outputs, _ = use_material(outputs, pair.crop, pair.tan_half, pair.material, normals)
    ln_radiance = np.log(np.maximum(outputs.radiance, 1e-6))
    return replace(outputs, ldr=response(outputs.radiance), ln_radiance=ln_radiance)


def true_normals(pair: Pair) -> np.ndarray:
    """A pair's normals as a model is told them: [64, 64, 3] unit, zero outside the object."""
    step = len(pair.normals) // NORMALS_SIZE
    mean = (
        np.asarray(pair.normals, np.float32)
        .reshape(NORMALS_SIZE, step, NORMALS_SIZE, step, 3)
        .mean(axis=(1, 3))
    )
    length = np.linalg.norm(mean, axis=-1, keepdims=True)
    return np.where(length > SHORTEST, mean / np.maximum(length, SHORTEST), 0.0)


def shipped(model: str, told: bool = False) -> tuple[dict[str, Method], dict[str, str]]:
    """A bundled model or a folder of graphs by its name, and what identifies it.

    told: also the model told a pair's true normals, where it can be, as <name>_normals.
    """
    models, name = Models(model), Path(model).name

    def method(pair: Pair, told: set[str]) -> Estimate:
        outputs = run_told(models, pair, told)
        return Estimate(
            ldr=outputs.ldr.clip(0.0, 1.0), radiance=outputs.radiance, irradiance=outputs.irradiance
        )

    methods = {name: partial(method, told=set())}
    if told and models.stages == LIFT_STAGES:
        methods[f"{name}_normals"] = partial(method, told={"normals"})
    return methods, {"model": model_id(model)}
