"""Makes Blender's World from the light beside this file.

    blender scene.blend --python NAME_blender.py
    or in Blender: Scripting > Open > this file > Run

The World is the whole map. With SUNS = True below, a Sun of its size represents each light source, to be moved
and for renderers that draw no shadow of a World; the camera still sees the whole map, everything else is
lit by the map without the sources, and mirrors show the Suns as discs.

Front of the photo is +Y. Run it again to replace what it made.
"""

import json
import math
from pathlib import Path

import bpy
from mathutils import Vector

NAME = "@NAME@"
SUNS = False


def folder_of_the_light():
    """Return the maps' folder: beside this file, also when it runs in the text editor."""
    candidates = [Path(__file__).parent] if "__file__" in globals() else []
    candidates += [Path(bpy.path.abspath(text.filepath)).parent for text in bpy.data.texts if text.filepath]
    for folder in candidates:
        if (folder / f"{NAME}.json").is_file():
            return folder.resolve()
    raise FileNotFoundError(f"{NAME}.json: open this script from the folder it was written to")


def load_map(path):
    image = bpy.data.images.load(str(path), check_existing=True)
    image.reload()  # a packed image would keep the older file's pixels
    for space in ("Linear Rec.709", "Linear"):  # the name before Blender 4
        try:
            image.colorspace_settings.name = space
            break
        except TypeError:
            continue
    return image


def make_world(folder):
    world = bpy.data.worlds.get(NAME) or bpy.data.worlds.new(NAME)
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputWorld")
    mix = nodes.new("ShaderNodeMixShader")
    rays = nodes.new("ShaderNodeLightPath")
    links.new(rays.outputs["Is Camera Ray"], mix.inputs[0])
    links.new(mix.outputs[0], output.inputs["Surface"])
    for slot, suffix in ((1, "_ambient" if SUNS else ""), (2, "")):
        picture = nodes.new("ShaderNodeTexEnvironment")
        picture.image = load_map(folder / f"{NAME}{suffix}.exr")
        background = nodes.new("ShaderNodeBackground")
        links.new(picture.outputs["Color"], background.inputs["Color"])
        links.new(background.outputs[0], mix.inputs[slot])
    bpy.context.scene.world = world


def make_suns(lights):
    for old in [one for one in bpy.data.objects if one.name.startswith(f"{NAME} source ")]:
        bpy.data.objects.remove(old)
    for number, light in enumerate([one for one in lights if SUNS and max(one["irradiance"]) > 0], 1):
        name, strength = f"{NAME} source {number}", max(light["irradiance"])
        sun = bpy.data.lights.new(name, "SUN")
        sun.energy = strength
        sun.color = [value / strength for value in light["irradiance"]]
        sun.angle = math.radians(light["angle_deg"])
        sun_object = bpy.data.objects.new(name, sun)
        towards = Vector(light["direction_in_target"])
        sun_object.rotation_euler = towards.to_track_quat("Z", "Y").to_euler()  # it shines along its own -Z
        bpy.context.scene.collection.objects.link(sun_object)


here = folder_of_the_light()
make_world(here)
make_suns(json.loads((here / f"{NAME}.json").read_text(encoding="utf-8"))["lights"])
