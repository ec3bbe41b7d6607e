# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws docs/blender/photos.webp: two real photos, in each a grey and a chrome sphere as a new user would insert them.

    python integrations/blender/draw_photos.py DATA --zip ZIP --bpy PYTHON

DATA has photos/, ZIP is build.py's, PYTHON one that has bpy. Nothing but the photo is given. It prints what the
extension said, and the seconds of each step from the factory settings to the render.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs" / "blender"
PHOTOS = "clay_teapot.png", "silver_hen.png"
SIDE, SAMPLES = 320, 32

SPHERES = (  # how far right of the object, radius, base colour, metallic, roughness
    (-0.31, 0.09, (0.5, 0.5, 0.5), 0.0, 0.9),
    (0.32, 0.10, (0.8, 0.8, 0.8), 1.0, 0.05),
)
"""Lengths are in widths of what the camera sees at the object."""


def main(data: Path, archive: Path, python: str) -> None:
    """Each photo in a Blender of its own; the page's picture here."""
    from PIL import Image

    page = Image.new("RGB", (len(PHOTOS) * (SIDE + 8) - 8, SIDE), "white")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "resources")}
        environment.pop("PYTHONPATH", None)
        for index, name in enumerate(PHOTOS):
            order = [python, __file__, str(data / "photos" / name), "--in-blender", str(folder), "--zip", str(archive)]
            subprocess.run(order, check=True, env=environment, stdout=subprocess.DEVNULL)
            print(name, json.loads((folder / "found.json").read_text()))
            picture = Image.open(folder / "render.png").convert("RGB")
            picture.thumbnail((SIDE, SIDE))
            page.paste(picture, (index * (SIDE + 8) + (SIDE - picture.width) // 2, (SIDE - picture.height) // 2))
    page.save(DOCS / "photos.webp", quality=82, method=6)


def walk(photo: Path, archive: str, folder: Path) -> None:
    """In Blender: install, estimate, insert, render, as in docs/how-to/blender.md."""
    import bpy

    seconds, begun = {}, time.monotonic()

    def lap(step: str) -> None:
        nonlocal begun
        seconds[step], begun = round(time.monotonic() - begun, 1), time.monotonic()

    bpy.ops.wm.read_factory_settings()
    bpy.ops.extensions.package_install_files(
        filepath=archive, repo="user_default", enable_on_install=True, overwrite=True
    )
    lap("install")
    scene = bpy.context.scene
    settings = scene.light_from_photo
    settings.image = bpy.data.images.load(str(photo))
    bpy.ops.light_from_photo.estimate()
    said = settings.said
    lap("estimate")
    bpy.ops.light_from_photo.standard()
    for name in ("Cube", "Light"):  # of Blender's first scene
        bpy.data.objects[name].hide_render = True
    insert_spheres()
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", SAMPLES
    scene.cycles.use_denoising = False
    longer = max(scene.render.resolution_x, scene.render.resolution_y)
    scene.render.resolution_percentage = round(100 * SIDE / longer)
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(folder / "render.png")
    bpy.ops.render.render(write_still=True)
    lap("insert and render")
    (folder / "found.json").write_text(json.dumps({"seconds": seconds, "said": said}))


def insert_spheres() -> None:
    """On the ground beside the object, which stands at the 3D cursor."""
    import bpy
    from mathutils import Vector

    camera, foot = bpy.context.scene.camera, bpy.context.scene.cursor.location
    size = 2 * (foot - camera.location).length * math.tan(camera.data.angle / 2)
    right = camera.matrix_world.to_3x3() @ Vector((1, 0, 0))
    right.z = 0
    right.normalize()
    for aside, radius, color, metallic, roughness in SPHERES:
        place = foot + size * (aside * right + Vector((0, 0, radius)))
        bpy.ops.mesh.primitive_uv_sphere_add(radius=radius * size, segments=64, ring_count=32, location=place)
        bpy.ops.object.shade_smooth()
        material = bpy.data.materials.new("sphere")
        material.use_nodes = True
        inputs = material.node_tree.nodes["Principled BSDF"].inputs
        inputs["Base Color"].default_value = (*color, 1)
        inputs["Metallic"].default_value, inputs["Roughness"].default_value = metallic, roughness
        bpy.context.object.data.materials.append(material)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with photos/; in Blender, the photo")
    parser.add_argument("--zip", required=True)
    parser.add_argument("--bpy", default=sys.executable)
    parser.add_argument("--in-blender", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.in_blender:
        walk(given.data, given.zip, given.in_blender)
    else:
        main(given.data, given.zip, given.bpy)
