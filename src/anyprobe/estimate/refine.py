"""From what the networks say to the light around an object: each step takes a Prediction and returns another."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.core.response import CLIPPED, inverse_response
from anyprobe.errors import InputError
from anyprobe.estimate.doubts import DARK, DARK_SHARE, backdrop_doubts, ground_doubts, light_doubts
from anyprobe.estimate.ground import Ground, ground_by_posture, up_of
from anyprobe.estimate.light_graph import Said
from anyprobe.estimate.material_hint import use_material
from anyprobe.estimate.photo import Photo
from anyprobe.estimate.runtime import Models
from anyprobe.estimate.sidecar import Origin
from anyprobe.estimate.sun_hint import towards_sun
from anyprobe.estimate.surroundings import PhotoBackground
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.light.environment import integral
from anyprobe.match.background import background_of
from anyprobe.match.likeness import MATCH_ROWS, Shown, shown_by
from anyprobe.notices import Notice, give, leave_out

BLACK, WHITE, ENOUGH_EXPOSED = (contract("exposure")[name] for name in ("black", "white", "enough"))
"""Display values between which a pixel is well exposed, and the share of such pixels below which confidence falls."""
BACKDROP_LEVEL: float = contract("ground")["backdrop_level"]
"""Median display value above which a single colour may be a backdrop, rather than the black of a cut-out or a dark
room."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Prediction:
    """The light as far as it is estimated.

    Attributes:
        said: by the networks, refined.
        ground: what the object stands on; None where the photo does not show that.
        used: which hints were used, and the numbers that they gave.
        doubts: warnings.
    """

    said: Said
    ground: Ground | None
    used: Mapping[str, Any] = field(default_factory=dict)
    doubts: tuple[Notice, ...] = ()


def check_hints(models: Models, photo: Photo) -> None:
    """Raise InputError if a hint was given that the model does not take; a background that nobody asked for is none."""
    around = photo.surroundings
    unasked = isinstance(around, PhotoBackground) and not around.is_asked
    surroundings = None if unasked else around
    hints = dict(normals=photo.normals, surroundings=surroundings, material=photo.material, sun=photo.sun)
    given = [name for name, value in hints.items() if value is not None and name not in models.takes]
    if given:
        text = f"expected a model that takes {'it' if len(given) == 1 else 'them'}, got {models.name}"
        raise InputError(text, subject=given, remedy=(*give(model=DEFAULT_MODEL), *leave_out(*given)))


def predict(models: Models, photo: Photo, inputs: Mapping[str, np.ndarray]) -> Prediction:
    """Run the networks on what they are given of a photo; twice where the sun stands above a horizon that they find."""
    used: dict[str, Any] = {"normals": photo.normals is not None}
    if photo.sun is not None:
        up = photo.ground.up if photo.ground is not None and photo.ground.is_known else _up_found(models(inputs))
        inputs = {**inputs, "sun": towards_sun(photo.sun, up).astype(np.float32)[None]}
        used["sun"] = True
    said = models(inputs)
    if said.seen is not None and said.seen[..., 3].any():
        used["surroundings"] = round(float(integral(said.seen[..., 3:])[0] / (4 * np.pi)), 4)
    return Prediction(said=said, ground=photo.ground, used=used)


def _up_found(said: Said) -> np.ndarray:
    pitch_deg, roll_deg = (0.0, 0.0) if said.posture is None else said.posture[:2]
    return up_of(float(pitch_deg), float(roll_deg))


def with_background_doubt(found: Prediction, photo: Photo, inputs: Mapping[str, np.ndarray]) -> Prediction:
    """Warn of a background that was not used, which leaves the ground unknown."""
    if not found.said.is_placeless:
        return found
    is_told = photo.shows_place and found.said.believed is not None and _hides_backdrop(inputs["photo"][0])
    doubts = backdrop_doubts(photo.name) if is_told else ()
    return replace(found, ground=None, doubts=(*found.doubts, *doubts))


def _hides_backdrop(photo: np.ndarray) -> bool:
    """Return whether an opaque photo [H, W, 5] is bright enough beside its object for a studio's backdrop."""
    display = photo[..., :3][photo[..., 4] < 0.5]
    return len(display) > 0 and bool(photo[..., 3].min() > 0.5 and np.median(luminance(display)) > BACKDROP_LEVEL)


def with_estimated_ground(found: Prediction, photo: Photo) -> Prediction:
    """Replace a guessed ground by the networks' own estimate."""
    ground, posture = found.ground, found.said.posture
    if ground is not None and not ground.is_known and posture is not None:
        ground = ground_by_posture(ground, posture)
    return replace(found, ground=ground)


def with_material(found: Prediction, photo: Photo) -> Prediction:
    """Fit the light's level and colour to the object's material; a mirror of given shape shows part of the map.

    What is seen beside the object stays.
    """
    if photo.material is None:
        return found
    said = found.said
    worth = min(1.0, exposed_fraction(said) / ENOUGH_EXPOSED)
    refined, used = use_material(said, photo.material, photo.normals is not None, photo.radiance is not None, worth)
    cover = np.zeros_like(said.radiance[..., :1]) if said.seen is None else said.seen[..., 3:]
    radiance = refined.radiance + cover * (said.radiance - refined.radiance)
    confidence = refined.confidence
    if confidence is not None and said.confidence is not None:
        confidence = confidence + cover[..., 0] * (said.confidence - confidence)
    return replace(found, said=replace(refined, radiance=radiance, confidence=confidence), used={**found.used, **used})


def exposed_fraction(said: Said) -> float:
    """Return the share of the object's pixels that are neither black nor clipped.

    In a nearly black object, which is warned of (doubts.exposure_doubts), all pixels up to DARK count as black: its map
    is dark, and a dark map is near to the truth without saying anything about the light.
    """
    if said.well_exposed is not None:
        return float(said.well_exposed[0])
    image = said.image
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


def object_info(said: Said) -> dict[str, Any]:
    """Return the estimated object and errors, in stops and degrees; None from a model that does not estimate them."""
    if said.object_material is None or said.errors is None:
        return {"object": None, "uncertainty": None}
    stop = math.log(2.0)
    metal, *reflectance, error = (float(one) for one in said.object_material)
    return {
        "object": {
            "metal": round(metal, 3),
            "reflectance": [round(one, 3) for one in reflectance],
            "reflectance_stops": round(error / stop, 2),
        },
        "uncertainty": {
            "level_stops": round(float(said.errors[1]) / stop, 2),
            "color_deg": round(float(said.errors[2]), 1),
        },
    }


def lens_of(photo: Photo, said: Said) -> tuple[float, str]:
    """Return the field of view of the photo's longer side [degrees], and who says it.

    A network's is the narrow end of its error: spheres drawn too long are seen, those drawn too round are not.
    """
    if photo.fov_source != "default" or said.field_of_view is None:
        return float(photo.long_fov_deg), photo.fov_source
    return float(said.field_of_view[0] - said.field_of_view[1]), "estimated"


def estimate_origin(photo: Photo, found: Prediction, seconds: dict[str, float], model_id: str) -> Origin:
    """Return what a light was estimated from, and by which model; seconds: time by step."""
    confidence, (long_fov_deg, fov_source) = photo.mask_confidence, lens_of(photo, found.said)
    return Origin(
        photo=photo.name,
        model=model_id,
        exposure=None if photo.exposure is None else float(f"{photo.exposure:.6g}"),
        long_fov_deg=round(long_fov_deg, 3),
        fov_source=fov_source,
        pitch_deg=None if photo.pitch_deg is None else round(float(photo.pitch_deg), 3),
        ground=found.ground,
        mask={"source": photo.mask_source, "confidence": confidence and round(confidence, 4)},
        hints=dict(found.used),
        crop={"center_px": [round(float(one), 2) for one in found.said.crop_frame[3, 1:]]},
        seconds=seconds,
        **object_info(found.said),
    )


def shown_of(said: Said) -> Shown | None:
    """Return what the photo shows of the object and beside it; None where its normals are not known."""
    if said.object_normals is None:
        return None
    behind = None
    if said.seen is not None:
        cover = said.seen[..., 3:]
        radiance = said.seen[..., :3] / np.maximum(cover, 1e-3)
        clipped = radiance >= inverse_response(np.float32(CLIPPED))
        behind = background_of(radiance, clipped & (radiance <= 1.0), cover, np.eye(3), MATCH_ROWS)
    return shown_by(said.image, said.object_normals, said.tan_half, said.camera_from_crop, behind)
