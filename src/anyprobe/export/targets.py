"""One light to one target: all of its files, or none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anyprobe.errors import InputError
from anyprobe.export import cube_textures, engines, scene_files
from anyprobe.export.exported_light import ExportedLight, prepare, sidecar, write_json
from anyprobe.export.target_frames import BLENDER, FRONT, OPENEXR, THREE, UNITY, UNREAL, Frame
from anyprobe.files.atomic import atomic_files

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True, kw_only=True, slots=True)
class Target:
    """How a light is written for one program or format.

    write: puts the files into a folder, gives what the sidecar says beyond the usual.
    frame: axes and layout of what it writes.
    checked: what has read it and shown the light as it is, for the sidecar; or that nothing has.
    """

    write: Callable[[ExportedLight, Path], Mapping[str, Any]]
    frame: Frame
    checked: str


_THREE = "three.js r187 in Chromium shows it the right way round"

TARGETS = {
    "three": Target(
        write=engines.write_three, frame=THREE, checked=f"{_THREE}: background, environment, LightProbe and sun agree"
    ),
    "blender": Target(
        write=engines.write_blender, frame=BLENDER, checked="Blender 5.0.1: Cycles sees and lights by it as it is"
    ),
    "unity": Target(write=engines.write_unity, frame=UNITY, checked="by formula only: not opened in Unity"),
    "unreal": Target(write=engines.write_unreal, frame=UNREAL, checked="by formula only: not opened in Unreal Engine"),
    "usd": Target(
        write=scene_files.write_usd,
        frame=OPENEXR,
        checked="OpenUSD 26.11 reads it; Blender 5.0.1 imports the dome as it is, the sun 4 times too strong",
    ),
    "mitsuba": Target(
        write=scene_files.write_mitsuba, frame=OPENEXR, checked="Mitsuba 3.9.1 sees and lights by it as it is"
    ),
    "gltf": Target(
        write=scene_files.write_gltf, frame=FRONT, checked="Babylon.js 9.34 shows it as it is, set as `gltf` says"
    ),
    "cube": Target(write=cube_textures.write_faces, frame=FRONT, checked=f"{_THREE} (HDRCubeTextureLoader)"),
    "ktx2": Target(write=cube_textures.write_ktx2, frame=FRONT, checked=f"{_THREE} (KTX2Loader)"),
    "dds": Target(
        write=cube_textures.write_dds,
        frame=FRONT,
        checked=f"{_THREE} (DDSLoader, the BC6H file); the half-float file by a parser of our own",
    ),
    "webxr": Target(
        write=engines.write_webxr, frame=FRONT, checked="by the specification only: not run in a WebXR session"
    ),
    "arcore": Target(write=engines.write_arcore, frame=FRONT, checked="by the documentation only: not run with ARCore"),
    "arkit": Target(write=engines.write_arkit, frame=FRONT, checked="by the documentation only: not run with ARKit"),
}


def export(
    radiance: Float[np.ndarray, "H 2*H 3"],
    target: str,
    folder: str | Path,
    stem: str = "light",
    *,
    world_from_camera: Float[np.ndarray, "3 3"] | None = None,
    exposure_ev: float = 0.0,
    origin: Mapping[str, Any] | None = None,
) -> list[Path]:
    """Write a light for one target into folder: every name begins with <stem>_<target>.

    <stem>_<target>.json is the sidecar; the other files are the target's own.

    Args:
        radiance: [H, 2H, 3] linear, in the camera's frame.
        target: one of TARGETS.
        world_from_camera: [3, 3] rotation; the export is then in the world's frame, +Y up.
        exposure_ev: stops; 1 doubles the light. The sidecar records it.
        origin: of the estimate's own sidecar, carried along.
    Returns:
        The paths, sorted.
    Raises:
        InputError, InvalidEnvironment: one line that says what to do.
        OutputError: the folder cannot be written; nothing new is left in it.
    """
    chosen = find_target(target)
    light = prepare(
        radiance, f"{stem}_{target}", world_from_camera=world_from_camera, exposure_ev=exposure_ev, origin=origin
    )
    with atomic_files(folder) as scratch:
        more = chosen.write(light, scratch)
        names = sorted([*(path.name for path in scratch.iterdir()), f"{light.name}.json"])
        described = sidecar(light, target, chosen.frame, {"checked": chosen.checked, "files": names, **more})
        write_json(scratch / f"{light.name}.json", described)
    return [Path(folder) / name for name in names]


def find_target(name: str) -> Target:
    """The target of a name; InputError that lists all of them if there is none."""
    if name not in TARGETS:
        raise InputError(f"target: expected one of {', '.join(TARGETS)}, got {name!r}")
    return TARGETS[name]
