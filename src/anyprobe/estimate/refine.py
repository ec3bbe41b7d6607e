"""From a crop to the light around it, step by step: each takes a Prediction and returns another."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.errors import InputError
from anyprobe.estimate.doubts import DARK, DARK_SHARE, ground_doubts, light_doubts
from anyprobe.estimate.ground import Ground, ground_by_posture
from anyprobe.estimate.known import PhotoBackground
from anyprobe.estimate.material_hint import use_material
from anyprobe.estimate.mirror_look import MIRRORED, likelier, mirrored_back, mirrored_crop
from anyprobe.estimate.photo import Crop, Photo
from anyprobe.estimate.runtime import Models, Outputs
from anyprobe.estimate.sidecar import Origin
from anyprobe.estimate.surroundings import radiance_of, use_surroundings
from anyprobe.inputs.settings import DEFAULT_MODEL, LOOKS, Settings
from anyprobe.light.environment import integral, rotate
from anyprobe.match.background import background_of
from anyprobe.match.likeness import MATCH_ROWS, Shown, shown_by
from anyprobe.notices import Notice, give, leave_out
from anyprobe.scatter.materials import Material

BLACK, WHITE, ENOUGH_EXPOSED = (contract("exposure")[name] for name in ("black", "white", "enough"))
"""Display values between which a pixel is well exposed, and the share of such pixels below which confidence falls."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Prediction:
    """The light as far as it is estimated, in the crop's frame.

    Attributes:
        outputs: of the networks, refined.
        ground: what the object stands on; None for a cut-out.
        used: which hints were used, and the numbers that they gave.
    """

    outputs: Outputs
    ground: Ground | None
    used: Mapping[str, Any] = field(default_factory=dict)


def usable(
    models: Models, photo: Photo, crop: Crop, merged_surroundings: np.ndarray | None
) -> tuple[Crop, np.ndarray | None]:
    """Leave out what nobody asked for where the model does not take it: the background."""
    if models.lifts:
        return crop, merged_surroundings
    if isinstance(photo.surroundings, PhotoBackground) and not photo.surroundings.is_asked:
        crop, merged_surroundings = replace(crop, surroundings_map=None), None
    return crop, merged_surroundings


def check_use(models: Models, crop: Crop, material: Material | None, looks: int) -> None:
    """Refuse hints and looks that the model does not take: only the one that lifts pixels takes any."""
    if looks > 1 and not models.lifts:
        text = f"expected a model that knows where light may come from, got {models.name}"
        raise InputError(text, subject="looks", remedy=give(model=DEFAULT_MODEL))
    hints = (("normals", crop.normals), ("surroundings", crop.surroundings_map), ("material", material))
    given = [name for name, value in hints if value is not None]
    if given and not models.lifts:
        text = f"expected a model that takes {'it' if len(given) == 1 else 'them'}, got {models.name}"
        raise InputError(text, subject=given, remedy=(*give(model=DEFAULT_MODEL), *leave_out(*given)))


def predict(models: Models, crop: Crop, ground: Ground | None, material: Material | None, looks: int = 1) -> Prediction:
    """Run the networks; looks: 2 to look in a mirror, too."""
    up = crop.camera_from_crop.T @ ground.up if ground is not None and ground.is_known else None
    outputs = _look(models, crop, material, up)
    if looks > 1:
        other = _look(models, mirrored_crop(crop), material, None if up is None else up * MIRRORED)
        outputs = likelier(outputs, mirrored_back(other))
    return Prediction(outputs=outputs, ground=ground, used={"normals": crop.normals is not None})


def _look(models: Models, crop: Crop, material: Material | None, up: np.ndarray | None) -> Outputs:
    return models(crop.image, crop.tan_half, crop.normals, crop.surroundings_map, material, crop.context, up)


def with_estimated_ground(found: Prediction, crop: Crop) -> Prediction:
    """Replace a guessed ground by the networks' own estimate."""
    ground, posture = found.ground, found.outputs.posture
    if ground is None or ground.is_known or posture is None:
        return found
    return replace(found, ground=ground_by_posture(ground, posture, crop.camera_from_crop))


def with_material(found: Prediction, crop: Crop, material: Material | None) -> Prediction:
    """Fit the light's level and colour to the object's material; a mirror shows part of the map."""
    if material is None:
        return found
    outputs, used = use_material(found.outputs, crop.image, crop.tan_half, material, crop.normals, crop.radiance)
    return replace(found, outputs=outputs, used={**found.used, **used})


def with_exposure_doubt(found: Prediction, well_exposed: float) -> Prediction:
    """Lower the confidence where little of the object is well exposed; well_exposed: share of its pixels."""
    outputs = found.outputs
    if outputs.confidence is None:
        return found
    confidence = outputs.confidence * min(1.0, well_exposed / ENOUGH_EXPOSED)
    return replace(found, outputs=replace(outputs, confidence=confidence))


def with_surroundings(found: Prediction, surroundings_map: np.ndarray | None, *, tint: bool) -> Prediction:
    """Put known surroundings [64, 128, 4 or 5] into the map; tint: bring the rest to their colour."""
    if surroundings_map is None:
        return found
    share = round(float(integral(surroundings_map[..., 3:])[0] / (4 * np.pi)), 4)
    outputs = use_surroundings(found.outputs, surroundings_map, tint=tint)
    return replace(found, outputs=outputs, used={**found.used, "surroundings": share})


def camera_map(outputs: Outputs, crop: Crop) -> tuple[np.ndarray, np.ndarray | None]:
    """Turn radiance [H, 2H, 3] and confidence [H, 2H], or None, into the camera's frame."""
    layers = [outputs.radiance] if outputs.confidence is None else [outputs.radiance, outputs.confidence]
    turned = rotate(np.dstack(layers), crop.camera_from_crop)
    confidence = None if outputs.confidence is None else turned[..., 3].clip(0.0, 1.0)
    return np.maximum(turned[..., :3], 0.0), confidence


def well_exposed_fraction(image: np.ndarray) -> float:
    """Share of the object's pixels of a crop [S, S, 4] that are neither black nor clipped.

    In a nearly black object, which is warned of (doubts.exposure_doubts), all pixels up to DARK count as black: its map
    is dark, and a dark map is near to the truth without saying anything about the light.
    """
    object_pixels = image[image[..., 3] > 0.5]
    if not len(object_pixels):
        return 0.0
    display = luminance(object_pixels[:, :3] / object_pixels[:, 3:])
    black = DARK if (display <= DARK).mean() >= DARK_SHARE else BLACK
    return float(((display > black) & (display < WHITE)).mean())


def map_doubts(photo: Photo, radiance: np.ndarray, ground: Ground | None, exposed: float) -> tuple[Notice, ...]:
    """Return doubts about the ground, and about a map [H, 2H, 3] unless the photo's own warnings say that it is dark.

    exposed: share of the object's pixels that are well exposed.
    """
    doubts = ground_doubts(ground, photo.name)
    if exposed >= ENOUGH_EXPOSED:
        doubts += light_doubts(radiance, ground, photo.pitch_deg, photo.name)
    return doubts


def object_info(posterior: Mapping[str, float] | None) -> dict[str, Any]:
    """Return the estimated object and errors, in stops and degrees; None without a posterior."""
    if posterior is None:
        return {"object": None, "uncertainty": None}
    stop = math.log(2.0)
    return {
        "object": {
            "metal": round(posterior["metal"], 3),
            "reflectance": [round(posterior[name], 3) for name in ("red", "green", "blue")],
            "reflectance_stops": round(posterior["reflectance_error"] / stop, 2),
        },
        "uncertainty": {
            "level_stops": round(posterior["level_error"] / stop, 2),
            "color_deg": round(posterior["color_error"], 1),
        },
    }


def estimate_origin(
    photo: Photo, crop: Crop, found: Prediction, seconds: dict[str, float], settings: Settings, model_id: str
) -> Origin:
    """Return what a light was estimated from, and by which model and settings; seconds: time by step."""
    confidence = photo.mask_confidence
    return Origin(
        photo=photo.name,
        model=model_id,
        emitters=settings.emitters,
        looks=None if settings.looks == LOOKS[0] else settings.looks,
        exposure=None if photo.exposure is None else float(f"{photo.exposure:.6g}"),
        long_fov_deg=round(float(photo.long_fov_deg), 3),
        fov_source=photo.fov_source,
        pitch_deg=None if photo.pitch_deg is None else round(float(photo.pitch_deg), 3),
        ground=found.ground,
        mask={"source": photo.mask_source, "confidence": confidence and round(confidence, 4)},
        hints=dict(found.used),
        crop={"center_px": list(crop.center_px), "side_px": crop.side_px},
        seconds=seconds,
        **object_info(found.outputs.posterior),
    )


def shown_of(crop: Crop, normals: np.ndarray) -> Shown | None:
    """Return what the photo shows of an object of these normals [64, 64, 3] in the crop's frame, and beside it."""
    behind = None
    if crop.surroundings_map is not None:
        behind = background_of(*radiance_of(crop.surroundings_map), crop.camera_from_crop, MATCH_ROWS)
    return shown_by(crop.image, normals, crop.tan_half, crop.camera_from_crop, behind)
