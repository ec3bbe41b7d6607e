"""Run by the Python that has bpy: an export's script, then what Cycles sees along directions.

python blender_recovers.py script.py|stage.usda order.json answer.json

order.json: {"directions": [[x, y, z], ...]} in Blender's axes, "normals": the same for a white sphere.
A tiny camera looks along each direction; a white sphere, out of the way, is seen from each normal.
"""

import json
import runpy
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

SIZE = 4


def picture(camera, towards):
    """Linear RGB [3], the mean of a few pixels along a direction."""
    camera.rotation_euler = Vector(towards).to_track_quat("-Z", "Y").to_euler()
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "seen.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        values = np.array(image.pixels[:], np.float32).reshape(SIZE, SIZE, -1)[..., :3]
        bpy.data.images.remove(image)
    return values.mean(axis=(0, 1)).tolist()


path, order, answer = map(Path, sys.argv[1:4])
asked = json.loads(order.read_text())
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.device = "CPU"
scene.cycles.samples = 1
scene.cycles.use_denoising = False
scene.render.threads_mode, scene.render.threads = "FIXED", 1
scene.render.resolution_x = scene.render.resolution_y = SIZE
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
if path.suffix == ".py":
    runpy.run_path(str(path))
else:
    scene.world = bpy.data.worlds.new("imported")  # a dome is put into a world that is there, or nowhere
    bpy.ops.wm.usd_import(filepath=str(path))
eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
eye.data.angle = np.radians(1.0)
scene.collection.objects.link(eye)
scene.camera = eye
seen = [picture(eye, d) for d in asked["directions"]]

scene.cycles.samples = 256
scene.cycles.max_bounces = 0
bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64, location=(0, 0, 0))
sphere = bpy.context.object
bpy.ops.object.shade_smooth()
white = bpy.data.materials.new("white")
white.use_nodes = True
nodes = white.node_tree.nodes
nodes.clear()
diffuse = nodes.new("ShaderNodeBsdfDiffuse")
diffuse.inputs["Color"].default_value = (1, 1, 1, 1)
white.node_tree.links.new(diffuse.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
sphere.data.materials.append(white)
lit = []
for n in asked["normals"]:
    eye.location = 5 * Vector(n)
    lit.append(picture(eye, [-x for x in n]))
suns = [
    {
        "towards": list(emitter.matrix_world.to_quaternion() @ Vector((0, 0, 1))),
        "energy": emitter.data.energy,
        "color": list(emitter.data.color),
        "angle": emitter.data.angle,
    }
    for emitter in bpy.data.objects
    if emitter.type == "LIGHT" and emitter.data.type == "SUN"
]
answer.write_text(json.dumps({"seen": seen, "lit": lit, "suns": suns, "version": bpy.app.version_string}))
