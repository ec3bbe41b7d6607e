"""glTF: one .glb that holds no mesh, only light: EXT_lights_image_based and KHR_lights_punctual.

The extension wants a cube of six PNGs a mip, its values packed as RGBD and filtered by GGX, rougher
from mip to mip; and nine SH coefficients of irradiance. Its text leaves the cube's axes, the signs of
the SH and RGBD's curve open: all three are as Babylon.js, its only reader, has them by default.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from anyprobe.core.sampling import hammersley
from anyprobe.export.cubemap import C_FROM_OURS, clipped_share, cube_faces, face_directions, face_size
from anyprobe.export.exported_light import ExportedLight, numbers
from anyprobe.export.target_frames import gltf
from anyprobe.export.usd import pointing_away
from anyprobe.light.environment import reduced
from anyprobe.light.octahedral import build_pyramid
from anyprobe.render.integrate import NUM_EMITTERS, shade_specular
from anyprobe.render.picture import LIGHT_ROWS

if TYPE_CHECKING:
    from jaxtyping import Float, UInt8

RGBD_MAX = 255.0
"""Largest value that RGBD holds: colour 1 over alpha 1 / 255."""

GAMMA = 2.2
"""RGBD's colour is kept as a power of itself."""

SMALLEST_SIDE = 16
"""Side of the last mip, which holds roughness 1."""

LARGEST_SIDE = 256
"""Side of the first mip at most, as fine as a map of 512 rows: filtering larger ones takes many minutes."""

NUM_SAMPLES = 256


def pack_rgbd(values: Float[np.ndarray, "... 3"]) -> UInt8[np.ndarray, "... 4"]:
    """Linear [..., 3] to RGBD [..., 4] uint8: value = (rgb / 255)^2.2 / (a / 255), clamped at 255."""
    values = np.minimum(values, RGBD_MAX)
    largest = np.maximum(values.max(axis=-1), 1e-6)
    alpha = np.floor(np.clip(RGBD_MAX / largest, 1.0, 255.0))
    rgb = np.clip(values * alpha[..., None] / 255.0, 0.0, 1.0) ** (1 / GAMMA)
    return np.concatenate([np.round(rgb * 255.0), alpha[..., None]], axis=-1).astype(np.uint8)


def prefiltered(radiance: Float[np.ndarray, "H 2*H 3"], size: int) -> list[np.ndarray]:
    """Mips [6, S, S, 3] of our map from size down to 16, roughness 0 to 1 in even steps.

    Each is the mean of L over GGX half vectors about its direction, seen from there (n = wo). The
    faces are those of our other cubes, the last row first.
    """
    count = max(1, size.bit_length() - SMALLEST_SIDE.bit_length() + 1)
    levels = [cube_faces(radiance, size)[:, ::-1]]
    light = reduced(radiance, LIGHT_ROWS)  # a larger map would be read at points between which a sun is lost
    pyramid, u = build_pyramid(light, emitters=NUM_EMITTERS), hammersley(NUM_SAMPLES)
    for i in range(1, count):
        roughness = i / (count - 1)
        side = size >> i
        n = (face_directions(side) * C_FROM_OURS)[:, ::-1].reshape(-1, 3).astype(np.float32)
        blurred = [shade_specular(pyramid, part, part, roughness**2, u)[0] for part in np.array_split(n, 24)]
        levels.append(np.concatenate(blurred).reshape(6, side, side, 3))
    return levels


def write(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """<name>.glb: the light without its dominant lobe as an image-based light, the lobe as a directional one."""
    levels = prefiltered(light.ambient, min(face_size(light.radiance.shape[0]), LARGEST_SIDE))
    pictures = [_png(pack_rgbd(face)) for level in levels for face in level]
    views, blob = [], bytearray()
    for picture in pictures:
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(picture)})
        blob += picture + b"\0" * (-len(picture) % 4)
    direction = pointing_away(light.main.direction)
    document = {
        "asset": {"version": "2.0", "generator": "anyprobe"},
        "extensionsUsed": ["EXT_lights_image_based", "KHR_lights_punctual"],
        "buffers": [{"byteLength": len(blob)}],
        "bufferViews": views,
        "images": [{"bufferView": i, "mimeType": "image/png"} for i in range(len(views))],
        "extensions": {
            "EXT_lights_image_based": {
                "lights": [
                    {
                        "name": light.name,
                        "intensity": 1.0,  # readers take a missing one for nothing
                        "rotation": [0.0, 0.0, 0.0, 1.0],
                        "irradianceCoefficients": numbers(gltf(light.sh_ambient)),
                        "specularImageSize": levels[0].shape[1],
                        "specularImages": np.arange(len(views)).reshape(-1, 6).tolist(),
                    }
                ]
            },
            "KHR_lights_punctual": {
                "lights": [
                    {
                        "type": "directional",
                        "name": f"{light.name} dominant light",
                        "color": numbers(light.main.color),
                        "intensity": numbers(light.main.irradiance.max()),
                    }
                ]
            },
        },
        "nodes": [
            {
                "name": "dominant light",
                "matrix": [value for row in direction for value in row],
                "extensions": {"KHR_lights_punctual": {"light": 0}},
            }
        ],
        "scenes": [{"nodes": [0], "extensions": {"EXT_lights_image_based": {"light": 0}}}],
        "scene": 0,
    }
    (folder / f"{light.name}.glb").write_bytes(_glb(document, bytes(blob)))
    return {
        "clipped_energy": clipped_share(levels[0], RGBD_MAX),
        "gltf": {
            "size": levels[0].shape[1],
            "mips": len(levels),
            "encoding": "RGBD, gamma 2.2",
            "faces": "asked for (-x, y, z), the last row first",
            "babylon": "set scene.environmentTexture.gammaSpace = false; left-handed scenes, its default",
        },
    }


def _png(rgba: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(rgba).save(stream, "PNG", optimize=True)
    return stream.getvalue()


def _glb(document: Mapping[str, Any], blob: bytes) -> bytes:
    """Header, JSON chunk padded with spaces, binary chunk."""
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks
