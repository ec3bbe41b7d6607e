"""Unreal Engine: two .hdr maps, which it imports as TextureCube, and the numbers to type in."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.export.frames import UNREAL
from anyprobe.export.light import ExportedLight, numbers, write_maps

NOTES = """{name}: light for Unreal Engine. By formula: not run in the editor by its makers.

1. Import {name}.hdr and {name}_ambient.hdr (.hdr, not .exr: only that becomes a TextureCube).
2. Sky Light: Source Type = SLS Specified Cubemap, Cubemap = {name}_ambient, Source Cubemap Angle = 0,
   Intensity Scale = 1, Lower Hemisphere Is Solid Color = off.
3. Directional Light, Mobility = Movable:
     Rotation  Roll 0, Pitch {pitch:.2f}, Yaw {yaw:.2f}   (degrees)
     Intensity {intensity:.5g} lux
     Light Color (linear) R {r:.4f} G {g:.4f} B {b:.4f}
     Source Angle {angle:.2f}
4. HDRI Backdrop or a sky sphere: {name}.hdr, the whole map with the main light in it.
Without a Directional Light use {name}.hdr in step 2 instead: the main light is in it, and with both
it would count twice.

The camera's front is +X, its right +Y, up +Z. The scale is relative: multiply the Sky Light's Intensity
Scale and the Directional Light's Intensity by one and the same number to fit your exposure.
"""


def sun_rotation(towards: np.ndarray) -> tuple[float, float]:
    """Pitch and yaw [degrees] of a directional light whose +X points away from a light at [3]."""
    x, y, z = -np.asarray(towards, dtype=np.float64)
    return float(np.degrees(np.arcsin(np.clip(z, -1, 1)))), float(np.degrees(np.arctan2(y, x)))


def write(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.hdr, <name>_ambient.hdr and <name>.txt, what to set in the editor."""
    write_maps(light, folder, UNREAL, ".hdr")
    pitch, yaw = sun_rotation(UNREAL.from_ours(light.main.direction))
    intensity = float(light.main.irradiance.max())
    r, g, b = (float(channel) for channel in light.main.color)
    notes = NOTES.format(
        name=light.name,
        pitch=pitch,
        yaw=yaw,
        intensity=intensity,
        r=r,
        g=g,
        b=b,
        angle=light.main_angle_deg,
    )
    (folder / f"{light.name}.txt").write_text(notes, encoding="utf-8")
    return {
        "unreal": {
            "light_pitch_deg": round(pitch, 4),
            "light_yaw_deg": round(yaw, 4),
            "light_color": numbers(light.main.color),
            "light_intensity_lux": numbers(intensity),
        }
    }
