# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws docs/blender/truth.webp: a path-traced photo, objects that the extension lights in it, and the truth.

    python integrations/blender/draw_docs.py --zip ZIP --bpy PYTHON

ZIP is build.py's, PYTHON one that has bpy. Light, vase and ground are the project's own. It prints how far the inserted
objects' mean colours and the Sun are from the truth.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs" / "blender"
SIZE = 320, 240
FOV_DEG, PITCH_DEG, HEIGHT = 45.0, 20.0, 0.5
PARTS = {
    "photo": "photo",
    "true": "objects truly there",
    "inserted": "inserted by the extension",
    "known": "inserted, the vase's albedo given",
}
SEED = 15
"""Of the project's own skies."""

VASE = 0.42, 0.36, 0.30
"""Base colour of the photo's object."""

OBJECTS = {  # place, half its height, base colour, metallic, roughness
    "grey": ((-0.27, -0.16), 0.07, (0.5, 0.5, 0.5), 0.0, 0.9),
    "chrome": ((0.24, -0.18), 0.08, (0.8, 0.8, 0.8), 1.0, 0.05),
    "orange": ((0.03, -0.34), 0.05, (0.8, 0.25, 0.04), 0.0, 0.4),
}
SAMPLES, FEW = 48, 12


def main(archive: Path, python: str) -> None:
    """Maps and the vase here, renders in Blender, the page's picture here."""
    import numpy as np
    from PIL import Image, ImageDraw, ImageFont

    from anyprobe.core.color import luminance
    from anyprobe.export.target_frames import BLENDER
    from anyprobe.light.light_sources import find_dominant_light
    from anyprobe.maps.radiance import write_exr
    from anyprobe_train.dataset.asset_store import sky
    from anyprobe_train.dataset.random_shapes import lathe

    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        radiance = sky(np.random.default_rng(SEED), height=512)
        gain = 0.9 / float(luminance(radiance).mean())
        write_exr(folder / "map.exr", BLENDER.roll(radiance * np.float32(gain)), half=False)
        mesh = lathe(np.random.default_rng(0), rows=160)
        np.savez(folder / "vase.npz", positions=mesh.positions @ np.array(BLENDER.axes).T, faces=mesh.faces)
        environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "resources")}
        environment.pop("PYTHONPATH", None)
        order = [python, __file__, "--in-blender", str(folder), "--zip", str(archive)]
        subprocess.run(order, check=True, env=environment, stdout=subprocess.DEVNULL)
        found = json.loads((folder / "found.json").read_text())
        pictures = [Image.open(folder / f"{part}.png").convert("RGB") for part in PARTS]
    towards = np.array(BLENDER.axes) @ find_dominant_light(radiance).direction
    off = math.degrees(math.acos(float(np.clip(towards @ found["sun"], -1, 1))))
    print(f"source {off:.1f} degrees off; inserted over true, linear red, green, blue:")
    for part in ("inserted", "known"):
        for one in OBJECTS:
            ratio = np.array(found[part][one]) / found["true"][one]
            print(f"  {part}, {one}: " + ", ".join(f"{value:.2f}" for value in ratio))
    width, height = SIZE
    page = Image.new("RGB", (2 * width + 8, 2 * (height + 24)), "white")
    for index, (text, picture) in enumerate(zip(PARTS.values(), pictures, strict=True)):
        left, top = index % 2 * (width + 8), index // 2 * (height + 24)
        ImageDraw.Draw(page).text((left + 4, top + 3), text, (40, 40, 40), ImageFont.load_default(13))
        page.paste(picture, (left, top + 20))
    DOCS.mkdir(exist_ok=True)
    page.save(DOCS / "truth.webp", quality=82, method=6)


def draw(folder: Path, archive: str) -> None:
    """In Blender: photo and truth in a scene of its own, then a new scene by the extension."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    true_scene(folder)
    set_render()
    render(folder / "photo.png")
    put_objects()
    render(folder / "true.png")
    true = colors(folder)

    found = {"true": true}
    for name, albedo in (("inserted", None), ("known", VASE)):
        found[name], found["sun"] = insert(folder, archive, name, albedo)
    (folder / "found.json").write_text(json.dumps(found))


def insert(folder: Path, archive: str, name: str, albedo: tuple[float, float, float] | None):
    """A new scene by the extension, with the objects in it: their colours, and the direction towards the Sun."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.extensions.package_install_files(
        filepath=archive, repo="user_default", enable_on_install=True, overwrite=True
    )
    settings = bpy.context.scene.light_from_photo
    settings.image = bpy.data.images.load(str(folder / "photo.png"))
    settings.use_fov, settings.fov = True, math.radians(FOV_DEG)
    settings.use_pitch, settings.pitch = True, math.radians(PITCH_DEG)
    if albedo is not None:
        settings.use_albedo, settings.albedo = True, albedo
    bpy.ops.light_from_photo.estimate()
    settings.size *= HEIGHT / bpy.context.scene.camera.location.z
    bpy.ops.light_from_photo.estimate()
    bpy.ops.light_from_photo.standard()
    set_render()
    put_objects()
    render(folder / f"{name}.png")
    sun = next((one for one in bpy.context.scene.objects if one.type == "LIGHT"), None)
    return colors(folder), [0, 0, 1] if sun is None else [row[2] for row in sun.matrix_world.to_3x3()]


def true_scene(folder: Path) -> None:
    """A vase on the ground under a map, seen by the photo's camera."""
    import bpy
    import numpy as np

    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("truth")
    scene.world.use_nodes = True
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    nodes.clear()
    picture, background = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeBackground")
    picture.image = bpy.data.images.load(str(folder / "map.exr"))
    picture.image.colorspace_settings.name = "Linear Rec.709"
    links.new(picture.outputs[0], background.inputs[0])
    links.new(background.outputs[0], nodes.new("ShaderNodeOutputWorld").inputs[0])

    vase = np.load(folder / "vase.npz")
    points = vase["positions"] - [0, 0, vase["positions"][:, 2].min()]
    points *= 0.34 / points[:, 2].max()
    mesh = bpy.data.meshes.new("vase")
    mesh.from_pydata(points.tolist(), [], vase["faces"].tolist())
    mesh.shade_smooth()
    scene.collection.objects.link(bpy.data.objects.new("vase", mesh))
    mesh.materials.append(principled("clay", VASE, 0.0, 0.4))

    bpy.ops.mesh.primitive_plane_add(size=60)
    ground = principled("ground", (0.3, 0.28, 0.25), 0.0, 0.8)
    tree = ground.node_tree
    noise, mix = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeMixRGB")
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = 1500, 6
    mix.inputs[1].default_value, mix.inputs[2].default_value = (0.16, 0.15, 0.14, 1), (0.46, 0.43, 0.38, 1)
    tree.links.new(noise.outputs[0], mix.inputs[0])
    tree.links.new(mix.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    bpy.context.object.data.materials.append(ground)

    camera = bpy.data.cameras.new("camera")
    camera.angle = math.radians(FOV_DEG)
    seen = bpy.data.objects.new("camera", camera)
    seen.location = 0, -0.95, HEIGHT
    seen.rotation_euler = math.radians(90 - PITCH_DEG), 0, 0
    scene.collection.objects.link(seen)
    scene.camera = seen


def principled(name: str, color, metallic: float, roughness: float):
    import bpy

    material = bpy.data.materials.new(name)
    material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1)
    shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value = metallic, roughness
    return material


def put_objects() -> None:
    """Two spheres and a cube at the same places of both scenes, on the ground."""
    import bpy

    for index, (name, (place, half, color, metallic, roughness)) in enumerate(OBJECTS.items()):
        if name == "orange":
            bpy.ops.mesh.primitive_cube_add(size=2 * half, location=(*place, half), rotation=(0, 0, 0.5))
        else:
            bpy.ops.mesh.primitive_uv_sphere_add(radius=half, segments=64, ring_count=32, location=(*place, half))
            bpy.ops.object.shade_smooth()
        one = bpy.context.object
        one.name, one.pass_index = name, index + 1
        one.data.materials.append(principled(name, color, metallic, roughness))


def set_render() -> None:
    import bpy

    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", SAMPLES
    scene.cycles.use_denoising = True
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"


def render(path: Path) -> None:
    import bpy

    scene = bpy.context.scene
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def colors(folder: Path) -> dict[str, list[float]]:
    """Mean linear colour of each object, without what lies before or behind it."""
    import bpy
    import numpy as np

    scene, found = bpy.context.scene, {}
    composite, scene.compositing_node_group = scene.compositing_node_group, None
    transparent, scene.render.film_transparent = scene.render.film_transparent, True
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.cycles.samples, scene.cycles.use_denoising = FEW, False
    others = [one for one in scene.objects if one.type == "MESH" and one.name not in OBJECTS]
    kept = [one.visible_camera for one in others]
    for one in others:
        one.visible_camera = False
    for name in OBJECTS:
        for other in OBJECTS:
            bpy.data.objects[other].visible_camera = other == name
        scene.render.filepath = str(folder / "color.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        values = np.array(image.pixels[:], np.float32).reshape(-1, 4)
        bpy.data.images.remove(image)
        found[name] = (values[:, :3].sum(axis=0) / values[:, 3].sum()).tolist()
    for one, shown in zip(others, kept, strict=True):
        one.visible_camera = shown
    scene.compositing_node_group, scene.render.film_transparent = composite, transparent
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--zip", required=True)
    parser.add_argument("--bpy", default=sys.executable)
    parser.add_argument("--in-blender", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.in_blender:
        draw(Path(given.in_blender), given.zip)
    else:
        main(Path(given.zip).resolve(), given.bpy)
