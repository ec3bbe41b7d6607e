"""Scene files: glTF, USD and Mitsuba 3.

glTF: one .glb without meshes, only light: EXT_lights_image_based and KHR_lights_punctual. The extension takes
a cube of six PNGs a mip, packed as RGBD and filtered by GGX, rougher from mip to mip; and nine SH
coefficients of irradiance. Its text leaves the cube's axes, the signs of the SH and RGBD's curve open: all three follow
the defaults of Babylon.js, its only reader.

USD: a .usda with a DomeLight and a DistantLight for each source, two .exr maps, and all of it as one .usdz, written as
text so that nothing needs to be installed. Mitsuba 3: the map as an .exr and a scene.xml with three spheres under it.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from anyprobe.core import Float, UInt8
from anyprobe.core.sampling import hammersley
from anyprobe.export.cube_textures import C_FROM_OURS, cube_faces, face_directions, face_size
from anyprobe.export.exported_light import EXPORT_SCALE, ExportedLight, numbers, read_template, share_beyond, write_maps
from anyprobe.export.target_frames import OPENEXR, gltf
from anyprobe.files.objects import glb_file
from anyprobe.light.environment import reduced
from anyprobe.light.light_sources import LightSource
from anyprobe.light.octahedral import build_pyramid
from anyprobe.maps.exr import write_channels
from anyprobe.pictures.images import png_bytes
from anyprobe.render.integrate import NUM_EMITTERS, shade_specular
from anyprobe.render.picture import LIGHT_ROWS

RGBD_MAX = 255.0
"""Largest value that RGBD holds: colour 1 over alpha 1 / 255."""

GAMMA = 2.2
"""Exponent of RGBD's colour."""

SMALLEST_SIDE = 16
"""Side [px] of the last mip, which holds roughness 1."""

LARGEST_SIDE = 256
"""Largest side [px] of the first mip, as fine as a map of 512 rows: filtering larger ones takes many minutes."""

NUM_SAMPLES = 256


def pack_rgbd(values: Float[np.ndarray, "... 3"]) -> UInt8[np.ndarray, "... 4"]:
    """Convert linear [..., 3] to RGBD [..., 4] uint8: value = (rgb / 255)^2.2 / (a / 255), clamped at 255."""
    values = np.minimum(values, RGBD_MAX)
    alpha = np.floor(np.clip(RGBD_MAX / np.maximum(values.max(axis=-1), 1e-6), 1.0, 255.0))
    rgb = np.clip(values * alpha[..., None] / 255.0, 0.0, 1.0) ** (1 / GAMMA)
    return np.concatenate([np.round(rgb * 255.0), alpha[..., None]], axis=-1).astype(np.uint8)


def prefiltered(radiance: Float[np.ndarray, "H 2*H 3"], size: int) -> list[np.ndarray]:
    """Filter a map into mips [6, S, S, 3] from size down to 16, roughness 0 to 1 in even steps.

    Each texel is the mean of L over GGX half vectors about its direction, seen from there (n = wo). The
    faces are those of our other cubes, the last row first.
    """
    count = max(1, size.bit_length() - SMALLEST_SIDE.bit_length() + 1)
    levels = [cube_faces(radiance, size)[:, ::-1]]
    light = reduced(radiance, LIGHT_ROWS)  # a larger map would be read at points, and a sun between them lost
    pyramid, u = build_pyramid(light, emitters=NUM_EMITTERS), hammersley(NUM_SAMPLES)
    for i in range(1, count):
        roughness = i / (count - 1)
        side = size >> i
        n = (face_directions(side) * C_FROM_OURS)[:, ::-1].reshape(-1, 3).astype(np.float32)
        blurred = [shade_specular(pyramid, part, part, roughness**2, u)[0] for part in np.array_split(n, 24)]
        levels.append(np.concatenate(blurred).reshape(6, side, side, 3))
    return levels


def write_gltf(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.glb: the light without its sources as an image-based light, the sources as directional ones."""
    levels = prefiltered(light.ambient, min(face_size(light.radiance.shape[0]), LARGEST_SIDE))
    pictures = [png_bytes(pack_rgbd(face), optimize=True) for level in levels for face in level]
    views, blob = [], bytearray()
    for picture in pictures:
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(picture)})
        blob += picture + b"\0" * (-len(picture) % 4)
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "anyprobe"},
        "extensionsUsed": ["EXT_lights_image_based", *(["KHR_lights_punctual"] if light.lights else [])],
        "buffers": [{"byteLength": len(blob)}],
        "bufferViews": views,
        "images": [{"bufferView": i, "mimeType": "image/png"} for i in range(len(views))],
        "extensions": {
            "EXT_lights_image_based": {
                "lights": [
                    {
                        "name": light.name,
                        "intensity": 1.0,  # readers take a missing value as 0
                        "rotation": [0.0, 0.0, 0.0, 1.0],
                        "irradianceCoefficients": numbers(gltf(light.sh_ambient)),
                        "specularImageSize": levels[0].shape[1],
                        "specularImages": np.arange(len(views)).reshape(-1, 6).tolist(),
                    }
                ]
            }
        },
        "scenes": [{"extensions": {"EXT_lights_image_based": {"light": 0}}}],
        "scene": 0,
    }
    if light.lights:
        document["extensions"]["KHR_lights_punctual"] = {
            "lights": [
                {
                    "type": "directional",
                    "name": f"{light.name} source {number}",
                    "color": numbers(source.color),
                    "intensity": numbers(source.irradiance.max()),
                    "extras": {"angle_deg": round(2 * source.radius_deg, 3)},  # the extension has no sizes
                }
                for number, source in enumerate(light.lights, 1)
            ]
        }
        document["nodes"] = [
            {
                "name": f"source {number}",
                "matrix": [value for row in pointing_away(source.direction) for value in row],
                "extensions": {"KHR_lights_punctual": {"light": number - 1}},
            }
            for number, source in enumerate(light.lights, 1)
        ]
        document["scenes"][0]["nodes"] = list(range(len(light.lights)))
    (folder / f"{light.name}.glb").write_bytes(glb_file(document, bytes(blob)))
    return {
        "clipped_energy": share_beyond(light.ambient, RGBD_MAX),
        "gltf": {
            "size": levels[0].shape[1],
            "mips": len(levels),
            "encoding": "RGBD, gamma 2.2",
            "faces": "asked for (-x, y, z), the last row first",
            "babylon": "set scene.environmentTexture.gammaSpace = false; left-handed scenes, its default",
        },
    }


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
    rows = "pole to pole, as Mitsuba 3 reads them: v = row / (rows - 1)"
    attributes = {"anyprobe:scale": EXPORT_SCALE, "anyprobe:rows": rows}
    channels = {name: pixels[..., i] for i, name in enumerate("RGB")}
    path = folder / f"{light.name}.exr"
    write_channels(path, channels, attributes, latlong=False)  # its rows lie elsewhere
    named = read_template("mitsuba.xml").replace("{name}", light.name.replace("--", "__"))
    scene = named.replace("{map}", quoteattr(path.name))
    (folder / f"{light.name}_scene.xml").write_text(scene, encoding="utf-8")
    return {"rows": "pole to pole: v = row / (rows - 1)", "to_world": "none: the roll is in the file"}
