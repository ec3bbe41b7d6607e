"""Blender: two .exr maps and a script that makes the World of them, and a Sun if asked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from anyprobe.export.frames import BLENDER
from anyprobe.export.light import ExportedLight, template, write_maps


def write(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.exr, <name>_ambient.exr and <name>.py.

    A Sun's strength is the irradiance of a plane that faces it, as ours is; World strength 1 is
    radiance as it is.
    """
    write_maps(light, folder, BLENDER, ".exr")
    (folder / f"{light.name}.py").write_text(template("blender_world.py", light), encoding="utf-8")
    return {}
