"""What is compared besides the trained designs: baselines and shipped models, and what these do when told more."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np

from anyprobe.core.frames import normalize
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair, shot_of
from anyprobe.evaluate.baselines import chrome_ball, mean_map
from anyprobe.evaluate.panel import Estimate, Method
from anyprobe.files.graphs import open_graph
from anyprobe.infer.known_material import use_material
from anyprobe.infer.known_normals import SHORTEST
from anyprobe.infer.runtime import (
    LIFT_STAGES,
    NORMALS_SIZE,
    SPREAD,
    Models,
    Outputs,
    model_id,
    stages_of,
    weights_folder,
)
from anyprobe.infer.surroundings import see_around, use_surroundings

TOLD = {
    "normals": {"normals"},
    "material": {"material"},
    "normals and material": {"normals", "material"},
    "surroundings": {"surroundings"},
    "all three": {"normals", "material", "surroundings"},
}
"""What a model may be told beside the object's crop, by the name of the row."""
PHONE_FOV_DEG = 65.0
PHONE_PX = (256, 192)
"""The photo that shows the surroundings of a pair: a phone's, the object in its middle; width, height."""


def baselines() -> dict[str, Method]:
    """The mean training map, and the object taken for a chrome ball."""

    def of(radiance: np.ndarray) -> Estimate:
        return Estimate(ldr=response(radiance), radiance=radiance)

    return {
        "mean map": lambda pair: of(mean_map()),
        "chrome ball": lambda pair: of(chrome_ball(pair.crop)),
    }


def run_told(models: Models, pair: Pair, told: set[str]) -> Outputs:
    """A model's answer where the pair's true normals, its true material or its surroundings are told."""
    normals = true_normals(pair) if "normals" in told else None
    around = surroundings(pair) if "surroundings" in told else None
    outputs = models(pair.crop, pair.tan_half, normals, around)
    if "material" in told:
        outputs, _ = use_material(outputs, pair.crop, pair.tan_half, pair.material, normals)
    return outputs if around is None else use_surroundings(outputs, around, tint="material" not in told)


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


def surroundings(pair: Pair) -> np.ndarray | None:
    """What a phone's photo shows of a pair's map around its object, see infer.surroundings.see_around."""
    width, height = PHONE_PX
    slope = np.tan(np.radians(PHONE_FOV_DEG) / 2)
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = (1 - (np.arange(height) + 0.5) / height * 2) * height / width
    rays = np.stack([*np.meshgrid(slope * x, slope * y), np.full((height, width), -1.0)], axis=-1)
    shown = bilinear(pair.radiance, direction_to_uv(normalize(rays)).astype(np.float32))
    display = np.round(response(shown, shot_of(pair.recipe).curve).clip(0.0, 1.0) * 255) / 255
    return see_around(display.astype(np.float32), PHONE_FOV_DEG, np.eye(3), pair.crop, pair.tan_half)


def shipped(model: str, told: bool = False) -> tuple[dict[str, Method], dict[str, str | int]]:
    """A bundled model or a folder of graphs by its name, and what identifies it.

    told: also the model told a pair's true normals, where it can be, as <name>_normals, and with its lamps spread, as
        <name>_spread.
    """
    models, name = Models(model), Path(model).name

    def method(pair: Pair, told: set[str], models: Models = models) -> Estimate:
        outputs = run_told(models, pair, told)
        return Estimate(
            ldr=outputs.ldr.clip(0.0, 1.0), radiance=outputs.radiance, irradiance=outputs.irradiance
        )

    methods = {name: partial(method, told=set())}
    if told and models.stages == LIFT_STAGES:
        methods[f"{name}_normals"] = partial(method, told={"normals"})
        methods[f"{name}_spread"] = partial(method, told=set(), models=models.with_lamps(SPREAD))
    return methods, origin(model)


def origin(model: str) -> dict[str, str | int]:
    """What result files say of a shipped model: its id, and how many pairs the last run of its training saw, drawn by
    which seed, as far as its graphs tell it."""
    folder = weights_folder(model)
    told = open_graph(folder / f"{stages_of(folder)[0]}.onnx", 1).get_modelmeta().custom_metadata_map
    seed = json.loads(told.get("config", "{}")).get("pairs", {}).get("seed")
    found = {"last_run_pairs": int(told["pairs"]) if "pairs" in told else None, "last_run_seed": seed}
    return {"model": model_id(model)} | {name: value for name, value in found.items() if value is not None}
