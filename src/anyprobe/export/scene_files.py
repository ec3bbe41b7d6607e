"""Scene files: USD and Mitsuba 3.

USD: a .usda with a DomeLight and a DistantLight for each source, two .exr maps, and all of it as one .usdz, written as
text so that nothing needs to be installed. Mitsuba 3: the map as an .exr and a scene.xml with three spheres under it.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

from anyprobe.export.exported_light import EXPORT_SCALE, ExportedLight, numbers, read_template, write_maps
from anyprobe.export.target_frames import OPENEXR
from anyprobe.light.light_sources import LightSource
from anyprobe.maps.exr import write_channels

if TYPE_CHECKING:
    from jaxtyping import Float

USDZ_ALIGNMENT = 64
"""Alignment [bytes] of every file in a .usdz; files are stored uncompressed."""


def write_usd(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.usda, <name>.exr, <name>_ambient.exr and <name>.usdz.

    The maps have the layout of OpenEXR and DomeLight, so that no rotation is needed. With normalize
    a DistantLight's intensity is the irradiance on a plane that faces it, as ours is.
    """
    write_maps(light, folder, OPENEXR, ".exr")
    stage = read_template("stage.usda").format(
        ambient=asset_path(f"./{light.name}_ambient.exr"),
        full=asset_path(f"./{light.name}.exr"),
        lights="".join(_distant_light(number, source) for number, source in enumerate(light.lights, 1)),
    )
    path = folder / f"{light.name}.usda"
    path.write_text(stage, encoding="utf-8")
    maps = [folder / f"{light.name}_ambient.exr", folder / f"{light.name}.exr"]
    pack_usdz(folder / f"{light.name}.usdz", [path, *maps])
    prims = [f"/Light/Source{number}" for number in range(1, len(light.lights) + 1)]
    return {"usd": {"dome_light_pole": "+Y", "light_prims": prims}}


def _distant_light(number: int, light: LightSource) -> str:
    """Return a light as a prim of the stage's variant."""
    return read_template("distant_light.usda").format(
        number=number,
        angle=round(2 * light.radius_deg, 4),
        color=", ".join(map(str, numbers(light.color))),
        intensity=numbers(light.irradiance.max()),
        matrix=", ".join(f"({', '.join(map(str, row))})" for row in pointing_away(light.direction)),
    )


def pointing_away(towards: Float[np.ndarray, " 3"]) -> list[list[float]]:
    """Return rows of USD's matrix (row vectors) that turns -Z, a DistantLight's direction, away from a light at [3]."""
    z = np.asarray(towards, dtype=np.float64)
    z /= np.linalg.norm(z)
    up = np.array([0.0, 1.0, 0.0]) if abs(z[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    x = np.cross(up, z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3] = x, np.cross(z, x), z
    return [[round(float(v), 9) + 0.0 for v in row] for row in matrix]


def asset_path(path: str) -> str:
    """Quote an asset's path with one delimiter on each side, or three if the path contains it."""
    return f"@@@{path}@@@" if "@" in path else f"@{path}@"


def pack_usdz(path: Path, files: list[Path]) -> None:
    """Write a .usdz: a zip of stored files, the stage first, each at a multiple of 64 bytes."""
    with path.open("wb") as stream, zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for file in files:
            entry = zipfile.ZipInfo(file.name, date_time=(1980, 1, 1, 0, 0, 0))
            start = stream.tell() + 30 + len(file.name.encode()) + 4  # local header, name, field header
            padding = -start % USDZ_ALIGNMENT
            entry.extra = b"\x86\x19" + padding.to_bytes(2, "little") + b"\0" * padding
            archive.writestr(entry, file.read_bytes())


def pole_to_pole(radiance: Float[np.ndarray, "H 2*H 3"]) -> Float[np.ndarray, "2*H+1 2*H 3"]:
    """Resample a map [H, 2H, 3] to 2H + 1 rows at i / 2H, the first and last on the poles.

    Mitsuba's rows lie at i / (rows - 1), ours at (i + 0.5) / H. Read between ours and held
    beyond the first and last, 2H + 1 rows are the same bilinear function.
    """
    height = radiance.shape[0]
    rows = np.clip(np.arange(2 * height + 1) / 2.0 - 0.5, 0, height - 1)
    low, high = np.floor(rows).astype(int), np.ceil(rows).astype(int)
    return (radiance[low] + radiance[high]) / 2.0


def write_mitsuba(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.exr, 32-bit floats, and <name>_scene.xml. A path tracer finds the dominant light in the map.

    Mitsuba writes its picture as .exr beside the scene, under the scene's name, which therefore is not the map's.
    """
    pixels = pole_to_pole(OPENEXR.roll(light.radiance)).astype(np.float32)
    attributes = {
        "anyprobe:scale": EXPORT_SCALE,
        "anyprobe:rows": "pole to pole, as Mitsuba 3 reads them: v = row / (rows - 1)",
    }
    channels = {name: pixels[..., i] for i, name in enumerate("RGB")}
    path = folder / f"{light.name}.exr"
    write_channels(path, channels, attributes, latlong=False)  # its rows lie elsewhere
    scene = (
        read_template("mitsuba.xml")
        .replace("{name}", light.name.replace("--", "__"))
        .replace("{map}", quoteattr(path.name))
    )
    (folder / f"{light.name}_scene.xml").write_text(scene, encoding="utf-8")
    return {"rows": "pole to pole: v = row / (rows - 1)", "to_world": "none: the roll is in the file"}
