"""One light to one target: all of its files, or none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.errors import InputError
from anyprobe.export import blender, cube, estimates, gltf, mitsuba, three, unity, unreal, usd
from anyprobe.export.frames import BLENDER, FRONT, OPENEXR, THREE, UNITY, UNREAL, Frame
from anyprobe.export.light import ExportedLight, prepare, sidecar, write_json
from anyprobe.files.atomic import atomic_files


@dataclass(frozen=True, kw_only=True, slots=True)
class Target:
    """How a light is written for one program or format.

    write: puts the files into a folder, gives what the sidecar says beyond the usual.
    frame: axes and layout of what it writes.
    """

    write: Callable[[ExportedLight, Path], Mapping[str, Any]]
    frame: Frame


TARGETS = {
    "three": Target(write=three.write, frame=THREE),
    "blender": Target(write=blender.write, frame=BLENDER),
    "unity": Target(write=unity.write, frame=UNITY),
    "unreal": Target(write=unreal.write, frame=UNREAL),
    "usd": Target(write=usd.write, frame=OPENEXR),
    "mitsuba": Target(write=mitsuba.write, frame=OPENEXR),
    "gltf": Target(write=gltf.write, frame=FRONT),
    "cube": Target(write=cube.write_faces, frame=FRONT),
    "ktx2": Target(write=cube.write_ktx2, frame=FRONT),
    "dds": Target(write=cube.write_dds, frame=FRONT),
    "webxr": Target(write=estimates.write_webxr, frame=FRONT),
    "arcore": Target(write=estimates.write_arcore, frame=FRONT),
    "arkit": Target(write=estimates.write_arkit, frame=FRONT),
}


def export(
    radiance: np.ndarray,
    target: str,
    folder: str | Path,
    stem: str = "light",
    *,
    world_from_camera: np.ndarray | None = None,
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
        radiance,
        f"{stem}_{target}",
        world_from_camera=world_from_camera,
        exposure_ev=exposure_ev,
        origin=origin,
    )
    with atomic_files(folder) as scratch:
        more = chosen.write(light, scratch)
        names = sorted([*(path.name for path in scratch.iterdir()), f"{light.name}.json"])
        described = sidecar(light, target, chosen.frame, {"files": names, **more})
        write_json(scratch / f"{light.name}.json", described)
    return [Path(folder) / name for name in names]


def find_target(name: str) -> Target:
    """The target of a name; InputError that lists all of them if there is none."""
    if name not in TARGETS:
        raise InputError(f"target: expected one of {', '.join(TARGETS)}, got {name!r}")
    return TARGETS[name]
