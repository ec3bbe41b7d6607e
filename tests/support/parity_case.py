"""A photo and Python's own answers in plain files, for the page's code to be held against."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from anyprobe.core.response import inverse_response, response
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import crop_object, load_photo
from anyprobe.estimate.runtime import EXPECTED, LIFT_STAGES, weights_folder
from anyprobe.light.filtering import blur_cosine_power, irradiance_map
from anyprobe.light.temporal import step
from anyprobe.masks.propose import default_graph, shared_network
from anyprobe.scatter.materials import given_material, material_input

HINTS = {
    "none": {"on": [], "off": []},
    "clicks": {"on": [[200, 250]], "off": [[20, 30]]},
    "box": {"on": [], "off": [], "box": [80, 30, 310, 360]},
}
GIVEN_MATERIALS = {
    "gold": {"name": "gold"},
    "clay": {"albedo": [0.4, 0.3, 0.2], "roughness": 0.7},
}
FRAME_SECONDS = [0.03, 0.05, 0.04, 0.2, 0.03, 0.03, 0.05, 0.04, 0.03, 0.05]


STEPS = np.arange(256) / 200
"""Radiance or display values, the last ones above white."""


def _normals(mask: np.ndarray) -> np.ndarray:
    """[H, W, 3] float32: something like a ball's around the mask's middle, zero beside it."""
    y, x = np.mgrid[0 : mask.shape[0], 0 : mask.shape[1]].astype(np.float64)
    x, y = (x - x[mask > 0.5].mean()) / mask.shape[1], (y[mask > 0.5].mean() - y) / mask.shape[0]
    n = np.stack([x, y, np.full_like(x, 0.5)], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.where(mask[..., None] > 0.5, n, 0.0).astype(np.float32)


def _filtered(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames with noise, a slow change, a jump, a cut and another jump, and the light after them."""
    noise = np.random.default_rng(5).normal(0, 0.03, (len(FRAME_SECONDS), *radiance.shape))
    gains = np.array([1.0, 1.0, 1.1, 1.6, 9.0, 9.0, 9.0, 4.5, 4.5, 4.5])[:, None, None, None]
    frames = (radiance * gains * np.exp(noise)).astype(np.float32)
    state = None
    for frame, seconds in zip(frames, FRAME_SECONDS, strict=True):
        state = step(state, frame, seconds)
    return frames, state.radiance


def write_parity_case(folder: Path, estimator: Estimator, photo: np.ndarray, long_fov_deg: float) -> None:
    """Write photo.rgba, mask.f32, case.json and one <name>.f32 an answer.

    Args:
        photo: [H, W, 4] uint8; its alpha marks the object.
    """
    loaded = load_photo(photo, fov_deg=long_fov_deg)
    light = estimator.from_photo(loaded)
    main = light.dominant_light()
    answers = {
        "mask": loaded.mask,
        "crop": light.stages["photo"].transpose(2, 0, 1),
        "tan_half": [crop_object(loaded).tan_half],
        "camera_from_crop": light.camera_from_crop,
        "irradiance": light.stages["irradiance"],
        "ldr": light.stages["ldr"],
        "ln_radiance": light.stages["ln_radiance"],
        "radiance": light.radiance,
        "sh9": light.sh9(),
        "dominant_light": np.concatenate(
            [main.direction, main.irradiance, main.color, [main.solid_angle, main.confidence]]
        ),
        "confidence": light.confidence,
        "exposure": [light.sidecar()["confidence"], light.well_exposed_fraction],
        "curve": response(STEPS),
        "curve_inverse": inverse_response(STEPS),
        "irradiance_map": irradiance_map(light.radiance),
        "blurred": blur_cosine_power(light.radiance, 5.0),
    }
    if estimator.models.stages == LIFT_STAGES:
        with_background = replace(loaded, surroundings_map=True)
        answers["surroundings"] = crop_object(with_background).surroundings_map.transpose(2, 0, 1)
        lit = estimator.from_photo(with_background)
        answers["radiance_surroundings"], answers["confidence_surroundings"] = lit.radiance, lit.confidence
        answers["radiance_expected"] = estimator.with_emitters(EXPECTED).from_photo(loaded).radiance
        answers["normals"] = _normals(loaded.mask)
        with_normals = replace(loaded, normals=answers["normals"])
        answers["normals_crop"] = crop_object(with_normals).normals.transpose(2, 0, 1)
        answers["radiance_normals"] = estimator.from_photo(with_normals).radiance
        for name, given in GIVEN_MATERIALS.items():
            material = given_material(**given)
            answers[f"material_{name}"] = material_input(material)
            answers[f"radiance_{name}"] = estimator.from_photo(loaded, material=material).radiance
    rgb = photo[..., :3].astype(np.float32) / 255
    for name, hints in HINTS.items():
        answers[f"cover_{name}"] = shared_network().propose(rgb, **hints).cover
    answers["frames"], answers["steadied"] = _filtered(light.radiance)
    for name, values in answers.items():
        (folder / f"{name}.f32").write_bytes(np.ascontiguousarray(values, dtype="<f4").tobytes())
    (folder / "photo.rgba").write_bytes(photo.tobytes())
    folder_of_graphs = weights_folder(estimator.models.name)
    weights = {stage: str(folder_of_graphs / f"{stage}.onnx") for stage in estimator.models.stages}
    weights["mask"] = str(default_graph())
    case = {
        "height": photo.shape[0],
        "width": photo.shape[1],
        "long_fov_deg": long_fov_deg,
        "weights": weights,
        "hints": HINTS,
        "materials": GIVEN_MATERIALS,
        "frame_seconds": FRAME_SECONDS,
    }
    (folder / "case.json").write_text(json.dumps(case))
