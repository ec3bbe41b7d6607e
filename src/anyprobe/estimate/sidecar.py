"""The .json beside a map: its names and types, and what it says of a saved map on its way to an export."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.frames import is_rotation, rotation_of
from anyprobe.errors import InputError
from anyprobe.estimate.ground import Ground, levelled
from anyprobe.export.exported_light import map_from_camera, origin_of, origin_turned, sidecar_beside
from anyprobe.inputs.description import numbers_in
from anyprobe.light.light_sources import LightSource
from anyprobe.notices import Notice, as_notice

SIDECAR_VERSION = 4
"""Version of the sidecar; another one is refused."""
FRAME = "right-handed, +X right, +Y up, the camera looks along -Z; u = 0.5 + atan2(x, -z) / 2 pi, row 0 is +Y"
TURNED = "right-handed, +X right, +Y up of a map that was turned by map_from_camera; u = 0.5 + atan2(x, -z) / 2 pi"
SCALE = "linear Rec. 709 radiance in the photo's exposure units: 1 is what the camera's curve maps to white"
"""Value of the key `scale` of a sidecar, as Light.sidecar writes it, and of the headers of its maps."""

OF_THE_MAP = (
    "version frame map_from_camera scale exposure_ev response size confidence well_exposed_fraction sh9 soft "
    "outdoors brightest_side dominant_light sources camera_from_crop warnings notices radiance stages"
).split()
"""Keys of a sidecar, or of the server's answer kept as one, besides a light's info."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Origin:
    """How a light came about. None where it is not known: a Light need not be an estimate.

    sidecar.schema.json describes the entries of dictionaries.

    Attributes:
        photo: file name.
        model: name and hash.
        exposure: of EXIF, relative.
        long_fov_deg, fov_source: field of view of the photo's longer side, and whether it is "given", of "exif", of the
            poses' lens, "estimated" or "default".
        pitch_deg: how far the camera looks down, where that was given.
        ground: what the object stands on; None for cut-outs.
        mask: how the object was found.
        hints: what was given and used, and the numbers that it gave.
        object, uncertainty: None from a model that does not estimate them (`paper`).
        crop: what the network saw.
        fused: names of the photos of a multiview light.
        seconds: time by step.
        more: keys of a sidecar that this version does not know.
    """

    photo: str | None = None
    model: str | None = None
    exposure: float | None = None
    long_fov_deg: float | None = None
    fov_source: str | None = None
    pitch_deg: float | None = None
    ground: Ground | None = None
    mask: dict[str, Any] | None = None
    hints: dict[str, Any] | None = None
    object: dict[str, Any] | None = None
    uncertainty: dict[str, Any] | None = None
    crop: dict[str, Any] | None = None
    fused: list[str | None] | None = None
    seconds: dict[str, float] | None = None
    more: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return what is known, ready for JSON. An estimate names object and uncertainty even where they are None."""
        known = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "more"}
        nulls = ("object", "uncertainty") if self.model is not None and self.mask is not None else ()
        found = {name: value for name, value in known.items() if value is not None or name in nulls}
        if self.ground is not None:
            found["ground"] = self.ground.info()
        return {**found, **self.more}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Origin:
        """Build one from as_json's data.

        Raises:
            TypeError, KeyError: a ground of other data.
        """
        names = {one.name for one in fields(cls)} - {"more"}
        known = {name: value for name, value in data.items() if name in names}
        more = {name: value for name, value in data.items() if name not in names}
        return cls(**known | {"ground": Ground.of(data.get("ground"))}, more=more)


def error_stated(estimate: Mapping[str, Any]) -> float | None:
    """Return the error [degrees] of the dominant light's direction by an estimate's sidecar; None without."""
    main = estimate.get("dominant_light")
    error = main.get("error_deg") if isinstance(main, Mapping) else None
    return float(error) if isinstance(error, int | float) and 0 <= error <= 180 else None


def sources_stated(estimate: Mapping[str, Any]) -> np.ndarray | None:
    """Return whether each source of an estimate's sidecar exists, and its direction, [S, 4]; None without."""
    try:
        found = np.array([[one["exists"], *one["direction"]] for one in estimate["sources"]], np.float64)
    except (KeyError, TypeError, ValueError, OverflowError):
        return None
    is_whole = found.shape[1:] == (4,) and bool((np.abs(found) <= 1.001).all())
    return found if is_whole else None


def source_json(source: LightSource, digits: int = 6) -> dict[str, Any]:
    """Return a light source for JSON."""
    return {
        "direction": json_numbers(source.direction, digits),
        "radius_deg": round(source.radius_deg, 2),
        "power": json_numbers(source.power, digits),
        "exists": round(source.exists, 3),
    }


def restored(said: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Return a sidecar as a Light's attributes (the page writes fewer); the rest is its origin."""
    if said.get("version") != SIDECAR_VERSION:
        text = f"expected a .json of version {SIDECAR_VERSION} beside it, got {said.get('version')!r}; estimate again"
        raise InputError(text, source=path)
    try:
        exposed = float(said.get("well_exposed_fraction", 1.0))
        lines, notices = said.get("warnings", ()), said.get("notices", ())
        warnings = tuple(map(Notice.from_json, notices)) if notices else tuple(as_notice(str(line)) for line in lines)
        camera_from_crop = np.array(said.get("camera_from_crop", np.eye(3)), dtype=np.float64)
        origin = Origin.from_json({name: value for name, value in said.items() if name not in OF_THE_MAP})
    except (KeyError, TypeError, ValueError, OverflowError):
        exposed, warnings, camera_from_crop, origin = np.nan, (), np.zeros(0), Origin()
    if not (0 <= exposed <= 1 and is_rotation(camera_from_crop)):
        raise InputError(
            "expected the .json beside it as it was written, got another well_exposed_fraction or "
            "camera_from_crop; save the light again, or move the .json away",
            source=path,
        )
    shares = {name: said.get(name) for name in ("soft", "outdoors")}
    attributes: dict[str, Any] = {
        name: share if isinstance(share, int | float) and 0 <= share <= 1 else None for name, share in shares.items()
    }
    attributes |= {"well_exposed_fraction": exposed, "warnings": warnings, "camera_from_crop": camera_from_crop}
    return attributes | {"said_error_deg": error_stated(said), "said_sources": sources_stated(said), "origin": origin}


def frame_of(map_from_camera: np.ndarray) -> dict[str, Any]:
    """Return a map's axes in words, and the rotation to them if they are not the camera's."""
    if np.allclose(map_from_camera, np.eye(3)):
        return {"frame": FRAME}
    return {"frame": TURNED, "map_from_camera": json_numbers(map_from_camera)}


def json_numbers(array: np.ndarray, digits: int = 6) -> list:
    """Return an array's values for JSON, rounded."""
    return np.round(np.asarray(array, dtype=np.float64), digits).tolist()


def read_rotation(text: str | None) -> np.ndarray | None:
    """Convert YAW,ELEVATION[,ROLL] in degrees, or nine numbers row by row, to world_from_camera [3, 3]; None stays."""
    if text is None:
        return None
    if numbers := numbers_in(text, 2, 3, 9):
        return rotation_of(numbers)
    raise InputError(
        f"expected YAW,ELEVATION[,ROLL] in degrees or nine numbers, got {text[:60]!r}; "
        "for instance 0,20 for a camera that looks 20 degrees down",
        subject="world_from_camera",
    )


def export_settings(path: Path, world_from_camera: np.ndarray | None, *, is_level: bool) -> dict[str, Any]:
    """Return world_from_camera, origin and error_deg of a saved map's export, see export.targets.export.

    Args:
        world_from_camera: [3, 3] rotation that is asked for; None: see is_level.
        is_level: whether the map is turned level, as far as the camera's pitch and roll are stated beside it.
    Raises:
        InputError: the .json beside it is damaged.
    """
    said, turned = sidecar_beside(path), map_from_camera(path)
    origin = origin_of(said) | origin_turned(turned)
    try:
        ground = Ground.of(said.get("ground"))
        if world_from_camera is None and (ground is not None or said.get("frame") == FRAME):
            world_from_camera, level = levelled(ground, turned, is_wanted=is_level)
            if world_from_camera is not None and not is_rotation(world_from_camera):
                raise ValueError("an angle is not finite")
            origin |= level
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"expected the ground in the .json beside {path.name} as it was written, got another; save the "
            "light again, or move the .json away",
            source=path.with_suffix(".json"),
        ) from error
    stated = {"error_deg": error_stated(said), "said_sources": sources_stated(said)}
    return {"world_from_camera": world_from_camera, "origin": origin, **stated}
