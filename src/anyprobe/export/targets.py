"""Export of one light to one target, all of its files or none; and the targets that are engines and file formats."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core import Float
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError
from anyprobe.export import cube_textures, scene_files
from anyprobe.export.exported_light import (
    ExportedLight,
    numbers,
    prepare,
    primary_light,
    read_template,
    share_beyond,
    sidecar,
    template,
    write_json,
    write_maps,
)
from anyprobe.export.target_frames import BLENDER, FRONT, OPENEXR, THREE, UNITY, UNREAL, TargetFrame, unity
from anyprobe.files.atomic import atomic_files
from anyprobe.maps.radiance import HALF_MAX
from anyprobe.notices import Notice
from anyprobe.pictures.gain_map import write_ultra_hdr

UNREAL_ERROR = "     The direction is estimated: off by up to {:.1f} degrees in two of three cases\n"


def write_webxr(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.estimate.json: the three attributes of an XRLightEstimate, in the probe's space.

    `sources` beside them are all lights of the sidecar, whose SH and dominant light these attributes are.
    """
    estimate = {
        **primary_light(light),
        "sphericalHarmonicsCoefficients": numbers(light.sh_ambient.reshape(-1)),
        "sources": [
            {
                "direction": numbers(one.direction),
                "irradiance": numbers(one.irradiance),
                "angle_deg": 2 * one.radius_deg,
            }
            for one in light.lights
        ],
    }
    write_json(folder / f"{light.name}.estimate.json", estimate)
    return {}


def write_unreal(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.hdr, <name>_ambient.hdr and <name>.txt, settings for the editor."""
    write_maps(light, folder, UNREAL, ".hdr")
    x, y, z = -UNREAL.from_ours(light.main.direction)  # of a lamp that shines along its +X
    pitch, yaw = float(np.degrees(np.arcsin(np.clip(z, -1, 1)))), float(np.degrees(np.arctan2(y, x)))
    intensity = float(light.main.irradiance.max())
    notes = read_template("unreal.txt").format(
        name=light.name,
        pitch=pitch,
        yaw=yaw,
        intensity=intensity,
        color=light.main.color,
        angle=2 * light.main.radius_deg,
        error="" if light.error_deg is None else UNREAL_ERROR.format(light.error_deg),
    )
    (folder / f"{light.name}.txt").write_text(notes, encoding="utf-8")
    angles = {"light_pitch_deg": round(pitch, 4), "light_yaw_deg": round(yaw, 4)}
    return {"unreal": {**angles, "light_color": numbers(light.main.color), "light_intensity_lux": numbers(intensity)}}


def write_unity(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.hdr, <name>_ambient.hdr (without the dominant light) and AnyprobeLight.cs, which reads the sidecar.

    The sidecar's one light is the dominant one, split off by light_sources.split_dominant_light. Unity's Lambert has no
    1 / pi: that light's intensity is irradiance / pi, linear. The component's file is the same for every light, because
    Unity requires a class to be named as its file.
    """
    write_maps(light, folder, UNITY, ".hdr")
    (folder / "AnyprobeLight.cs").write_text(template("AnyprobeLight.cs", light), encoding="utf-8")
    return {
        "unity": {
            "sh_full": numbers(unity(light.sh_full).ravel()),
            "sh_ambient": numbers(unity(light.sh_ambient).ravel()),
            "light_direction": numbers(UNITY.from_ours(light.main.direction)),
            "light_color": numbers(light.main.color),
            "light_intensity": numbers(light.main.irradiance.max() / np.pi),
        }
    }


def write_blender(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.exr, <name>_ambient.exr and <name>.py.

    A Sun's strength is the irradiance on a plane that faces it, as ours is; at World strength 1 radiance is unscaled.
    """
    write_maps(light, folder, BLENDER, ".exr")
    (folder / f"{light.name}.py").write_text(template("blender_world.py", light), encoding="utf-8")
    return {}


def write_three(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.hdr, <name>_ambient.hdr, <name>.js and <name>.html.

    The maps are rolled, so that they stand right without environmentRotation. DirectionalLight's
    intensity is the irradiance on a plane that faces it, as ours is.
    """
    write_maps(light, folder, THREE, ".hdr")
    (folder / f"{light.name}.js").write_text(template("three.js", light), encoding="utf-8")
    page = template("three.html", light).replace("@TITLE@", escape(light.name))
    (folder / f"{light.name}.html").write_text(page, encoding="utf-8")
    return {
        "half_float": "HDRLoader makes halfs of .hdr: what is above 65504 is clamped there",
        "clipped_energy": share_beyond(light.radiance, HALF_MAX),
    }


def write_jpeg(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.jpg: Ultra HDR, for three.js's UltraHDRLoader; rolled as three's maps are."""
    brightest = write_ultra_hdr(folder / f"{light.name}.jpg", THREE.roll(light.radiance))
    return {
        "ultra_hdr": {
            "most_radiance": round(brightest, 4),
            "loader": "three.js UltraHDRLoader; mapping EquirectangularReflection",
        },
        "clipped_energy": share_beyond(light.radiance, brightest),
    }


@dataclass(frozen=True, kw_only=True, slots=True)
class Target:
    """Writer of a light for one program or format.

    write: writes the files into a folder, returns the sidecar's additional entries.
    frame: axes and layout of the files.
    checked: program that was seen to show the light as it is, for the sidecar; or that none was.
    sources: whether it takes all of the light's sources rather than its dominant light.
    """

    write: Callable[[ExportedLight, Path], Mapping[str, Any]]
    frame: TargetFrame
    checked: str
    sources: bool = False


_THREE = "three.js r187 in Chromium shows it the right way round"

TARGETS = {
    "three": Target(
        write=write_three,
        frame=THREE,
        checked=f"{_THREE}: background, environment, LightProbe and suns agree",
        sources=True,
    ),
    "blender": Target(
        write=write_blender, frame=BLENDER, checked="Blender 5.0.1: Cycles sees and lights by it as it is", sources=True
    ),
    "unity": Target(write=write_unity, frame=UNITY, checked="by formula only: not opened in Unity"),
    "unreal": Target(write=write_unreal, frame=UNREAL, checked="by formula only: not opened in Unreal Engine"),
    "usd": Target(
        write=scene_files.write_usd,
        frame=OPENEXR,
        checked="OpenUSD 26.11 reads it; Blender 5.0.1 imports the dome as it is, suns 4 times too strong",
        sources=True,
    ),
    "mitsuba": Target(
        write=scene_files.write_mitsuba, frame=OPENEXR, checked="Mitsuba 3.9.1 sees and lights by it as it is"
    ),
    "gltf": Target(
        write=scene_files.write_gltf,
        frame=FRONT,
        checked="Babylon.js 9.34 shows it as it is, set as `gltf` says",
        sources=True,
    ),
    "ultrahdr": Target(
        write=write_jpeg,
        frame=THREE,
        checked="by the format, three.js's source (UltraHDRLoader) and our own reader; not run in a browser",
    ),
    "cube": Target(write=cube_textures.write_faces, frame=FRONT, checked=f"{_THREE} (HDRCubeTextureLoader)"),
    "ktx2": Target(write=cube_textures.write_ktx2, frame=FRONT, checked=f"{_THREE} (KTX2Loader)"),
    "webxr": Target(write=write_webxr, frame=FRONT, checked="by the specification only: not run in a WebXR session"),
}


MAX_CLIPPED = 0.01
"""Share of a light's energy beyond the range of a target's files from which on a warning says so."""


def export(
    radiance: np.ndarray,
    target: str,
    folder: str | Path,
    stem: str = "light",
    *,
    world_from_camera: Float[np.ndarray, "3 3"] | None = None,
    exposure_ev: float = 0.0,
    origin: Mapping[str, Any] | None = None,
    error_deg: float | None = None,
    said_sources: Float[np.ndarray, "S 4"] | None = None,
) -> list[Path]:
    """Export a light for one target into folder: every name begins with <stem>_<target>.

    <stem>_<target>.json is the sidecar; the other files are the target's own. Light beyond the range of its files, as
    the sun's in halfs, is a RuntimeWarning; see MAX_CLIPPED.

    Args:
        radiance: [H, 2H, 3] linear, in the camera's frame.
        target: one of TARGETS.
        world_from_camera, exposure_ev, origin, error_deg, said_sources: see exported_light.prepare.
    Returns:
        The paths, sorted.
    Raises:
        InputError, InvalidEnvironment: one line that says what to do.
        OutputError: the folder cannot be written; nothing new is left in it.
    """
    paths, doubts = write_export(
        radiance,
        target,
        folder,
        stem,
        world_from_camera=world_from_camera,
        exposure_ev=exposure_ev,
        origin=origin,
        error_deg=error_deg,
        said_sources=said_sources,
    )
    for doubt in doubts:
        warnings.warn(doubt, RuntimeWarning, stacklevel=2)
    return paths


def write_export(
    radiance: np.ndarray, target: str, folder: str | Path, stem: str = "light", **settings: Any
) -> tuple[list[Path], tuple[Notice, ...]]:
    """Return export's paths, and its warnings, which the sidecar has too; settings: see exported_light.prepare."""
    chosen = find_target(target)
    light = prepare(radiance, f"{stem}_{target}", sources=chosen.sources, **settings)
    with atomic_files(folder) as scratch:
        more = chosen.write(light, scratch)
        names = sorted([*(path.name for path in scratch.iterdir()), f"{light.name}.json"])
        described = sidecar(light, target, chosen.frame, {"checked": chosen.checked, "files": names, **more})
        text = f"{described['clipped_energy']:.0%} of the light exceeds the range of its files; lower the exposure"
        is_clipped = described["clipped_energy"] > MAX_CLIPPED
        doubts = (Notice(text, code="range-clipped", source=target),) if is_clipped else ()
        described["warnings"] = [doubt.as_json() for doubt in doubts]
        write_json(scratch / f"{light.name}.json", described)
    return [Path(folder) / name for name in names], doubts


def find_target(name: str) -> Target:
    """Return the target of a name; InputError lists all of them if there is none."""
    if not isinstance(name, str) or name not in TARGETS:
        advice = did_you_mean(name, TARGETS) or "; choose one"
        raise InputError(f"expected one of {', '.join(TARGETS)}, got {name!r}{advice}", subject="target")
    return TARGETS[name]
