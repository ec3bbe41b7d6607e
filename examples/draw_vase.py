"""Draw examples/vase.png: a photo that needs no camera, made with anyprobe's own renderer and room.

    python examples/draw_vase.py

The alpha channel marks the object. vase_truth.exr beside it is the light it was
rendered with, in the photo's exposure units and the camera's frame.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.core.color import luminance
from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.response import response
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import MAP_HEIGHT, reduced, rotate
from anyprobe.light.octahedral import build_pyramid
from anyprobe.maps.radiance import write_exr
from anyprobe.render.integrate import NUM_EMITTERS, shade
from anyprobe.render.surface import frame_object, pixel_rays, see
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.asset_store import room
from anyprobe_train.dataset.random_shapes import lathe

SIZE = 512
SUPERSAMPLE = 2
CHUNK = 8192


def main(folder: Path) -> None:
    """Render, expose and write the two files."""
    fine = room(np.random.default_rng(17), height=1024)
    light = reduced(fine, 256)
    mesh = lathe(np.random.default_rng(0), rows=200)
    material = Material(albedo=np.array([0.42, 0.36, 0.30]), f0=np.full(3, 0.045), alpha=0.15)
    side = SIZE * SUPERSAMPLE
    camera = frame_object(mesh, world_from_camera(0.6, 0.2), fov_deg=24.0, margin=1.7, size=side)
    surface = see(mesh, camera)
    map_from_camera = camera.world_from_camera.astype(np.float32)
    pyramid, u = build_pyramid(light, emitters=NUM_EMITTERS), hammersley(96)
    n, wo = surface.normals @ map_from_camera.T, surface.wo @ map_from_camera.T
    reflected = np.concatenate(
        [
            shade(pyramid, n[i : i + CHUNK], wo[i : i + CHUNK], material.alpha, u).radiance(material)
            for i in range(0, len(n), CHUNK)
        ]
    )
    gain = 0.3 / float(luminance(reflected).mean())
    background = bilinear(fine, direction_to_uv(-pixel_rays(camera.tan_half, side) @ map_from_camera.T))
    picture = background
    picture[surface.mask] = reflected
    display = response(picture * gain)
    rgba = np.concatenate([display, surface.mask[..., None]], axis=-1)
    rgba = rgba.reshape(SIZE, SUPERSAMPLE, SIZE, SUPERSAMPLE, 4).mean(axis=(1, 3))
    Image.fromarray(np.round(rgba * 255).astype(np.uint8)).save(folder / "vase.png", optimize=True)
    truth = reduced(rotate(light, map_from_camera.T), MAP_HEIGHT) * gain
    write_exr(folder / "vase_truth.exr", truth)


if __name__ == "__main__":
    main(Path(__file__).parent)
