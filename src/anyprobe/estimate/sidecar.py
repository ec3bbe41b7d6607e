"""What the .json beside a map says: its names, also of older versions, and their types."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from anyprobe.core.frames import is_rotation
from anyprobe.errors import InputError

SIDECAR_VERSION = 4
"""Version of the sidecar; one that says none is of version 1. Older names stand below."""
FIRST_NAMES = {"told": "well_exposed_fraction", "main_light": "dominant_light", "lamps": "emitters", "known": "hints"}
"""Keys of a sidecar of version 1, which says no version, and of today's."""
OLDER_NAMES = {"priors": "hints"}
"""The same of versions 2 and 3."""
_EMITTERS = {"drawn": "mode", "spread": "expected"}
"""The same for the values of `emitters`."""
OLDER_NAMES_INSIDE = {"dominant_light": {"confidence": "directionality"}, "seconds": {"turn": "rotate"}}
"""The same for what is within a key, up to version 2."""
FRAME = "right-handed, +X right, +Y up, the camera looks along -Z; u = 0.5 + atan2(x, -z) / 2 pi, row 0 is +Y"
TURNED = "right-handed, +X right, +Y up of a map that was turned by map_from_camera; u = 0.5 + atan2(x, -z) / 2 pi"
SCALE = "linear Rec. 709 radiance in the photo's exposure units: 1 is what the camera's curve maps to white"

OF_THE_MAP = (
    "version frame map_from_camera scale exposure_ev response size confidence well_exposed_fraction sh9 "
    "dominant_light camera_from_crop warnings radiance stages"
).split()
"""What a sidecar, or the server's answer kept as one, holds besides a light's info."""


class MaskInfo(TypedDict, total=False):
    """Where the mask came from, and its expected IoU (None where it was given)."""

    source: str
    confidence: float | None


class CropInfo(TypedDict):
    """The square around the object that the network saw, in pixels of the photo."""

    center_px: list[float]
    side_px: float


class ObjectInfo(TypedDict):
    """What the model takes the object for: probability of a metal, share of an even light that it reflects, RGB, and
    how far off that is in two of three cases, in stops."""

    metal: float
    reflectance: list[float]
    reflectance_stops: float


class Uncertainty(TypedDict):
    """How far off the map is in two of three cases: its level in stops, its mean colour in degrees."""

    level_stops: float
    color_deg: float


class Info(TypedDict, total=False):
    """How an estimate came about.

    photo: file name; model: name and hash; emitters: "mode" or "expected"; exposure: of EXIF, relative;
    long_fov_deg: field of view of the photo's longer side, and where it is from ("exif", "given", "default");
    hints: what was given of the object; object and uncertainty: None from a model that does not estimate them
    (`paper`); seconds: by step.

    Some lights lack a key: exposure where no EXIF says it; pitch_deg, how far the camera looks down, where that was not
    given; ground (estimate.ground.Ground), of cut-outs; fused, the photos of a multiview light; detail, where that is
    from, see with_detail. A Light that is no estimate of this release may lack any.
    """

    photo: str
    model: str
    emitters: str
    exposure: float
    long_fov_deg: float
    fov_source: str
    pitch_deg: float
    ground: dict[str, Any]
    mask: MaskInfo
    hints: dict[str, Any]
    object: ObjectInfo | None
    uncertainty: Uncertainty | None
    crop: CropInfo
    fused: list[str | None]
    seconds: dict[str, float]
    detail: dict[str, Any]


def current_names(said: Mapping[str, Any]) -> dict[str, Any]:
    """A sidecar under the names of SIDECAR_VERSION."""
    names = OLDER_NAMES if "version" in said else FIRST_NAMES
    renamed = {names.get(name, name): value for name, value in said.items()}
    if str(renamed.get("emitters")) in _EMITTERS:
        renamed["emitters"] = _EMITTERS[renamed["emitters"]]
    for key, names in OLDER_NAMES_INSIDE.items():
        if isinstance(renamed.get(key), Mapping):
            renamed[key] = {names.get(name, name): value for name, value in renamed[key].items()}
    return renamed


def restored(said: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """A sidecar as a Light's attributes (the page writes fewer); the rest is its info."""
    try:
        exposed = float(said.get("well_exposed_fraction", 1.0))
        warnings = tuple(str(line) for line in said.get("warnings", ()))
        camera_from_crop = np.array(said.get("camera_from_crop", np.eye(3)), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        exposed, warnings, camera_from_crop = np.nan, (), np.zeros(0)
    if not (0 <= exposed <= 1 and is_rotation(camera_from_crop)):
        raise InputError(
            f"{path}: expected the .json beside it as it was written, got another well_exposed_fraction or "
            "camera_from_crop; save the light again, or move the .json away"
        )
    info = {name: value for name, value in said.items() if name not in OF_THE_MAP}
    return {"well_exposed_fraction": exposed, "warnings": warnings, "camera_from_crop": camera_from_crop, "info": info}
