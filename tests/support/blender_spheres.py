"""Run by the Python that has bpy: three spheres under an export, as an .exr.

python blender_spheres.py script.py|stage.usda picture.exr
"""

import runpy
import sys

import bpy
import numpy as np

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.cycles.device = "CPU"
scene.cycles.samples = 64
scene.cycles.use_denoising = False
scene.render.threads_mode, scene.render.threads = "FIXED", 1
scene.render.resolution_x, scene.render.resolution_y = 480, 180
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
scene.render.filepath = sys.argv[2]
for x, metallic, roughness, color in ((-2.3, 0, 1, 1.0), (0, 1, 0.4, 0.8), (2.3, 1, 0, 1.0)):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, location=(x, 0, 0))
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("sphere")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    shader = nodes.new("ShaderNodeBsdfGlossy" if metallic else "ShaderNodeBsdfDiffuse")
    if metallic:
        shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Color"].default_value = (color, color, color, 1)
    links.new(shader.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
    bpy.context.object.data.materials.append(material)
eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
eye.location = (0, -9, 0)
eye.rotation_euler = (np.pi / 2, 0, 0)
eye.data.sensor_fit = "VERTICAL"
eye.data.angle = np.radians(26)
scene.collection.objects.link(eye)
scene.camera = eye
if sys.argv[1].endswith(".py"):
    runpy.run_path(sys.argv[1])
else:
    scene.world = bpy.data.worlds.new("imported")
    bpy.ops.wm.usd_import(filepath=sys.argv[1])
bpy.ops.render.render(write_still=True)
