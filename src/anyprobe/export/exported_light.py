"""The light that every export target is written from, the sidecar of each, and the origin of maps on disk.

There are two versions of everything: `full` is the whole light; `ambient` is the light without `lights`, for renderers
that take directional lights as well: the light's sources, or the dominant light for those that take only one. With both
full and directional lights these would count twice.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core import Float
from anyprobe.core.frames import check_pose, is_rotation
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.errors import InputError, InvalidEnvironment
from anyprobe.export.target_frames import FRONT, TargetFrame
from anyprobe.files.paths import is_there, read_regular
from anyprobe.light.environment import check_radiance, rotate
from anyprobe.light.harmonics import directionality, project
from anyprobe.light.light_sources import LightSource, split_dominant_light, split_sources
from anyprobe.maps.radiance import HALF_MAX, HALF_MIN, map_attributes, read_radiance, write_exr, write_hdr

EXPORT_SCALE = (
    "relative: linear Rec. 709 radiance in the photo's exposure units times 2^exposure_ev; "
    "1 is what the camera's curve maps to white"
)
SH_DEFINITION = (
    "27 numbers, r g b of each of nine coefficients of radiance in the order and with the signs of "
    "WebXR and three.js; axes x right, y up, z back whatever the target's are"
)

BRIGHTEST_RADIANCE = 1e12
"""Largest radiance: above it squares and sums leave float32's range; the sun in candela per square metre is 1.6e9."""
MAX_SIDECAR_BYTES = 2**26
"""Largest .json [bytes] that is read beside a map; ours have a few kilobytes."""
ORIGIN_KEYS = ("photo model long_fov_deg fov_source confidence response soft brightest_side warnings level").split()
"""Keys that an export keeps of the estimate's sidecar: not its SH and dominant light, which turn with the map."""


@dataclass(frozen=True, kw_only=True)
class ExportedLight:
    """A light in the frame it is exported in: right-handed, +X right, +Y up, -Z in front.

    radiance: [H, 2H, 3], ambient: the same without lights.
    lights: possibly none; main: the dominant light, whether it is among them or not.
    sh_full, sh_ambient: [9, 3], of radiance.
    name: stem of all files' names.
    origin: entries of the estimate's own sidecar, carried along.
    error_deg: the estimate's error of the direction of main; None where the light is none, or states none.
    """

    radiance: np.ndarray
    ambient: np.ndarray
    main: LightSource
    lights: tuple[LightSource, ...]
    sh_full: np.ndarray
    sh_ambient: np.ndarray
    name: str
    world_from_camera: np.ndarray
    exposure_ev: float
    origin: Mapping[str, Any] = field(default_factory=dict)
    error_deg: float | None = None


def prepare(
    radiance: np.ndarray,
    name: str,
    *,
    world_from_camera: Float[np.ndarray, "3 3"] | None = None,
    exposure_ev: float = 0.0,
    origin: Mapping[str, Any] | None = None,
    error_deg: float | None = None,
    said_sources: Float[np.ndarray, "S 4"] | None = None,
    sources: bool = False,
) -> ExportedLight:
    """Turn a map [H, 2H, 3] into the world's frame, expose it, and split off its sources, or its dominant light.

    A map that was already turned, by its origin's map_from_camera, stays so; world_from_camera covers both.

    Args:
        world_from_camera: [3, 3] rotation; the export is then in the world's frame, +Y up.
        exposure_ev: stops; 1 doubles the light. The sidecar records it.
        origin: entries of the estimate's own sidecar, carried along.
        error_deg: the estimate's error of its dominant light's direction [degrees]; None if it is none, or not known.
        said_sources: see light.light_sources.find_sources; in the map's frame.
        sources: whether all sources are split off.

    Raises:
        InputError: not a rotation, an exposure beyond 30 stops, an invalid file name.
        InvalidEnvironment: not a map, or brighter than BRIGHTEST_RADIANCE.
    """
    if not name or name.startswith(".") or name != Path(name).name or "\\" in name or not name.isprintable():
        raise InputError(f"expected a file name without its suffix, got {name!r}; rename the map", subject="name")
    if not abs(exposure_ev) <= 30:
        raise InputError(f"expected stops from -30 to 30, got {exposure_ev}; 1 doubles the light", subject="exposure")
    turn = np.eye(3) if world_from_camera is None else check_pose(world_from_camera, "world_from_camera")
    radiance = check_radiance(check_radiance(radiance, name) * np.float32(2.0**exposure_ev), name)
    if radiance.max() > BRIGHTEST_RADIANCE:
        raise InvalidEnvironment(
            f"expected radiance of at most {BRIGHTEST_RADIANCE:g}, got {radiance.max():.3g}; divide all of "
            "it by one number, or lower the exposure",
            source=name,
        )
    main, ambient = split_dominant_light(radiance, said_sources)
    lights, ambient = split_sources(radiance, said_sources) if sources else ((main,), ambient)
    if not np.array_equal(turn, np.eye(3)):
        radiance, ambient = (np.maximum(rotate(one, turn), 0.0) for one in (radiance, ambient))
    main, *others = (replace(one, direction=(turn @ one.direction).astype(np.float32)) for one in (main, *lights))
    return ExportedLight(
        radiance=radiance,
        ambient=ambient,
        main=main,
        lights=tuple(others),
        sh_full=project(radiance),
        sh_ambient=project(ambient),
        name=name,
        world_from_camera=turn @ np.asarray((origin or {}).get("map_from_camera", np.eye(3))),
        exposure_ev=float(exposure_ev),
        origin=_known(dict(origin or {})),
        error_deg=error_deg,
    )


def origin_of(estimate: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of an estimate's sidecar that describe where the light comes from."""
    return {key: estimate[key] for key in ORIGIN_KEYS if key in estimate}


def _known(value: Any) -> Any:
    """Replace NaN and infinity in JSON values by None, since no JSON file can hold them."""
    if isinstance(value, Mapping):
        return {key: _known(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_known(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def numbers(values: Any) -> Any:
    """Convert an array to lists of plain numbers of seven digits, for JSON and text files."""
    values = np.asarray(values, dtype=np.float64)
    if values.ndim == 0:
        return float(f"{values + 0.0:.7g}")
    return [numbers(value) for value in values]


def primary_light(light: ExportedLight) -> dict[str, dict[str, float]]:
    """Return the dominant light in the terms of WebXR's XRLightEstimate: direction with w = 0, intensity with w = 1."""
    direction = dict(zip("xyzw", (*numbers(light.main.direction), 0.0), strict=True))
    intensity = dict(zip("xyzw", (*numbers(light.main.irradiance), 1.0), strict=True))
    return {"primaryLightDirection": direction, "primaryLightIntensity": intensity}


def sidecar(light: ExportedLight, target: str, frame: TargetFrame, more: Mapping[str, Any]) -> dict[str, Any]:
    """Return every export's record of itself, ready for JSON; `more` is the target's own part."""
    return {
        "target": target,
        "frame": frame.text,
        "map": {"u": frame.u, "v": frame.v, "row_0": "up", "rolled_quarters_right": frame.quarters},
        "world_from_camera": numbers(light.world_from_camera),
        "scale": EXPORT_SCALE,
        "exposure_ev": light.exposure_ev,
        "clipped_energy": 0.0,
        **primary_light(light),
        "dominant_light": {
            "unit": "irradiance of a plane that faces it; white Lambert there sends irradiance / pi",
            "direction_in_target": numbers(frame.from_ours(light.main.direction)),
            "angle_deg": round(2 * light.main.radius_deg, 3),
            "directionality": round(directionality(light.sh_full), 4),
            **({} if light.error_deg is None else {"error_deg": round(light.error_deg, 1)}),
        },
        "lights": [
            {
                "direction": numbers(source.direction),
                "direction_in_target": numbers(frame.from_ours(source.direction)),
                "irradiance": numbers(source.irradiance),
                "angle_deg": round(2 * source.radius_deg, 3),
                "exists": round(source.exists, 3),
            }
            for source in light.lights
        ],
        "sh": {
            "definition": SH_DEFINITION,
            "full": numbers(light.sh_full.reshape(-1)),
            "ambient": numbers(light.sh_ambient.reshape(-1)),
        },
        **more,
        "origin": dict(light.origin),
    }


def write_json(path: Path, value: Mapping[str, Any]) -> None:
    """Write JSON; all numbers must be finite."""
    path.write_text(json.dumps(value, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def write_maps(light: ExportedLight, folder: Path, frame: TargetFrame, suffix: str) -> None:
    """Write <name>.hdr or .exr, rolled for the target, and <name>_ambient beside it.

    .exr holds halves, or floats where halves would clip or the darkest pixels would lose digits.
    """
    for name, radiance in ((light.name, light.radiance), (f"{light.name}_ambient", light.ambient)):
        path, rolled = folder / f"{name}{suffix}", frame.roll(radiance)
        attributes = {"frame": f"{frame.text}; u = {frame.u}, v = {frame.v}", "scale": EXPORT_SCALE}
        if suffix == ".hdr":
            write_hdr(path, rolled, attributes=attributes)
        else:
            darkest = rolled.min(where=rolled > 0, initial=np.inf)  # ignoring black
            write_exr(path, rolled, half=bool(rolled.max() <= HALF_MAX and darkest >= HALF_MIN), attributes=attributes)


def share_beyond(radiance: Float[np.ndarray, "H 2*H 3"], limit: float, least: float = 0.0) -> float:
    """Return the share of a map's energy above a limit, or below the least value that a format holds."""
    areas = pixel_solid_angles(len(radiance))[..., None].astype(np.float64)
    energy = float((radiance * areas).sum())
    beyond = np.maximum(radiance - limit, 0.0) + np.where(radiance < least, radiance, 0.0)
    return float((beyond * areas).sum()) / energy if energy > 0 else 0.0


def template(name: str, light: ExportedLight) -> str:
    """Fill in a text of the templates folder: "@NAME@", quotes included, becomes the name as a string literal.

    Its letters are not escaped, for files in UTF-8: Python does not join JSON's pairs of \\u escapes.
    """
    return read_template(name).replace('"@NAME@"', json.dumps(light.name, ensure_ascii=False))


def read_template(name: str) -> str:
    """Return a text of the templates folder unchanged."""
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")


MAP_FROM_CAMERA = "map_from_camera"
"""Key of the rotation [3, 3] from the camera's frame to a map that was turned after the estimate."""


def read_with_origin(path: Path) -> tuple[np.ndarray, dict[str, Any], np.ndarray]:
    """Read a map with the front in its centre, the .json beside it, and the map_from_camera of either.

    Raises:
        InvalidEnvironment: no such file, or not an environment map. InputError: see check_front.
    """
    radiance = read_radiance(path)
    check_front(path)
    return radiance, sidecar_beside(path), map_from_camera(path)


def origin_turned(turn: Float[np.ndarray, "3 3"]) -> dict[str, Any]:
    """Return the entry for a map turned by [3, 3] since the estimate; empty for the identity."""
    return {} if np.allclose(turn, np.eye(3)) else {MAP_FROM_CAMERA: numbers(turn)}


def check_front(path: Path) -> None:
    """Refuse a map that was exported for a program whose maps are not centred on the front.

    This is known from its header or, for an older .hdr, from the .json beside it; a map without either passes.

    Raises:
        InputError: the map would be a quarter or half turn off.
    """
    wanted = "expected a map with the front in its centre"
    advice = "use the file that estimate wrote"
    frame = map_attributes(path).get("frame", "")
    if f"u = {FRONT.u}" in frame:
        return
    entries = sidecar_beside(path)
    layout = entries.get("map")
    if isinstance(layout, Mapping) and layout.get("rolled_quarters_right"):
        raise InputError(f"{wanted}, got one exported for {entries.get('target')}; {advice}", source=path)
    if "u = " in frame:
        raise InputError(f"{wanted}, got one with {frame[frame.index('u = ') :]}; {advice}", source=path)


def map_from_camera(path: Path) -> Float[np.ndarray, "3 3"]:
    """Return the rotation [3, 3] from the photo's camera to a map's frame, from its header, or an older .hdr's .json.

    Raises:
        InputError: the entry is not a rotation.
    """
    header = map_attributes(path)
    given = (header if "frame" in header else sidecar_beside(path)).get(MAP_FROM_CAMERA)
    if given is None:
        return np.eye(3)
    try:
        turn = np.array(json.loads(given) if isinstance(given, str) else given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError, RecursionError):
        turn = np.zeros(0)
    if not is_rotation(turn):
        raise InputError(
            f"expected {MAP_FROM_CAMERA} to be a rotation, got {' '.join(str(given).split())[:120]}; "
            "save the light again",
            source=path,
        )
    return turn


def sidecar_beside(path: Path) -> dict[str, Any]:
    """Read the .json that an estimate or an export wrote beside a map; empty where there is none, or no JSON object.

    Raises:
        InputError: it is damaged or cannot be read.
    """
    stems = (path.stem, path.stem.removesuffix("_ambient"), path.stem.removesuffix("_panorama"))
    file = next((file for file in (path.with_name(f"{stem}.json") for stem in stems) if is_there(file)), None)
    if file is None:
        return {}
    try:  # in any Unicode encoding, with or without a byte order mark
        data = read_regular(file, str(file), InputError, max_bytes=MAX_SIDECAR_BYTES)
        # an integer of many digits becomes a float, perhaps infinite, which its user refuses
        entries = json.loads(data, parse_int=lambda digits: int(digits) if len(digits) < 19 else float(digits))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"expected the .json beside {path.name} as it was written, got a damaged one "
            f"({' '.join(str(error).split())[:80]}); save the light again, or move the .json away",
            source=file,
        ) from error
    return entries if isinstance(entries, dict) else {}
